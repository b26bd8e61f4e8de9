"""Explicit steps of springs as long as what they add and their stability allow: Verlet and RK4."""

import subprocess
import sys

import numpy as np
import pytest

from tests.messages import raises_naming
from tripod_sim import SceneError, Simulation, StepError, load_scene
from tripod_sim.integrators.schemes import rk4, semi_implicit_euler
from tripod_sim.springs import automatic_kernels as kernels
from tripod_sim.springs.automatic import AutomaticSprings

INTERVAL, END = 0.02, 0.8  # [s]
DAMPED = ("springs.damping=0.5", "damping={mass=0.3, stiffness=1e-4}")
BOTH = pytest.mark.parametrize("words", [(), DAMPED], ids=["undamped", "damped"])


def pendulum(*words: str, scene: str = "pendulum") -> Simulation:
    return Simulation(load_scene(scene, list(words)))


def automatic(tolerance: float, *words: str, scene: str = "pendulum") -> Simulation:
    return pendulum(f"dt={INTERVAL}", "dt=auto", f"time_error.tolerance={tolerance}", *words, scene=scene)


def fine(*words: str) -> Simulation:
    return pendulum(*words, "inertia={scheme='rk4', substeps='off'}", "dt=5e-5")


def one_part(order: int, simulation: Simulation, h: float) -> tuple[np.ndarray, np.ndarray, float]:
    """Positions, velocities and what a part of `h` added, from the state of an automatic simulation, left alone."""
    stepper, state = simulation._stepper, simulation.state
    assert isinstance(stepper, AutomaticSprings)
    x, v = state.positions.copy(), state.velocities.copy()
    longest = 1e-9 if order == kernels.RK4 else h  # Verlet's parts would be too short to take over
    outcome, _, parts, rejected, _, added, _, _ = kernels.automatic_steps(
        1, h, 1e3, 1e-9, longest, h, rk4.SCHEME.tableau, order, h, x, v, stepper.loop.links, stepper.loop.load,
        stepper._scratch,
    )  # fmt: skip
    assert (outcome, parts, rejected) == (0, 1, 0)
    return x, v, added


@BOTH
@pytest.mark.parametrize("order", [kernels.VERLET, kernels.RK4])
def test_one_part_has_its_order_and_its_estimate_is_what_it_adds(order: int, words: tuple[str, ...]) -> None:
    true, told = [], []
    for h in (8e-3, 4e-3):
        simulation = automatic(1e-6, *words)
        simulation.advance(20)
        x, v, added = one_part(order, simulation, h)
        exact = fine(*words)
        exact.state.positions[:], exact.state.velocities[:] = (
            simulation.positions,
            simulation.state.velocities,
        )
        exact.advance(round(h / 5e-5))
        errors = [np.abs(x - exact.positions).max(), h * np.abs(v - exact.state.velocities).max()]
        true.append(max(errors))
        told.append(added)
    assert np.log2(true[0] / true[1]) == pytest.approx({2: 3, 4: 5}[order], abs=0.5)
    assert np.log2(told[0] / told[1]) == pytest.approx({2: 3, 4: 4}[order], abs=0.5)
    if order == kernels.VERLET:
        assert true[1] / 2 < told[1] < 2 * true[1]
    else:
        assert true[1] < told[1]


@BOTH
def test_the_fourth_order_part_is_that_of_the_scheme(words: tuple[str, ...]) -> None:
    plain = pendulum(*words, "inertia={scheme='rk4', substeps='off'}", "dt=0.01")
    simulation = automatic(1e-6, *words)
    for _ in range(30):
        x, v, _ = one_part(kernels.RK4, simulation, 0.01)
        simulation.state.positions[:], simulation.state.velocities[:] = x, v
    plain.advance(30)
    np.testing.assert_allclose(simulation.positions, plain.positions, rtol=0, atol=1e-12)


@BOTH
def test_the_error_falls_with_the_tolerance_and_no_part_adds_more(words: tuple[str, ...]) -> None:
    exact, reference = fine(*words), []
    for _ in range(round(END / INTERVAL)):
        exact.advance(round(INTERVAL / 5e-5))
        reference.append(exact.positions.copy())
    errors, parts, orders = [], [], []
    for tolerance in (1e-2, 1e-4, 1e-6, 1e-8):
        simulation, found, count, used = automatic(tolerance, *words), [], 0, set()
        for _ in range(round(END / INTERVAL)):
            report = simulation.step()
            assert report.time_error
            assert 0 < report.time_error.added <= tolerance
            assert np.isnan(report.time_error.largest)
            count += report.parts
            found.append(simulation.positions.copy())
            used.add(simulation.state.errors.order)
        errors.append(np.linalg.norm(np.array(found) - reference, axis=2).max())
        parts.append(count)
        orders.append(used)
    assert errors[0] > 10 * errors[1] > 100 * errors[2] > 1000 * errors[3]
    assert parts[1] < parts[2] < parts[3]
    assert kernels.VERLET in orders[0]
    assert orders[3] == {kernels.RK4}
    assert simulation.state.time == pytest.approx(END)


def test_parts_shrink_where_the_motion_is_fast() -> None:
    """The pendulum starts slowly; its end then whips round."""
    simulation = automatic(1e-8)
    parts = [simulation.step().parts for _ in range(80)]
    assert max(parts[40:]) > 2 * np.mean(parts[3:12])


@pytest.mark.parametrize("rate", [0.0, 0.1, 1.0, 8.0])
def test_the_limit_of_verlet_is_where_a_mode_begins_to_grow(rate: float) -> None:
    """x'' = -x - d x', dampers taken at v + h a: the largest eigenvalue of the map of (x, v, a)."""

    def radius(h: float) -> float:
        x = np.array([1.0, h, h * h / 2])
        a = -x - rate * np.array([0.0, 1.0, h])
        v = np.array([0.0, 1.0, h / 2]) + h / 2 * a
        return float(np.abs(np.linalg.eigvals(np.array([x, v, a]))).max())

    limit = semi_implicit_euler.SCHEME.longest_step(1.0, 2 * rate)
    assert limit == pytest.approx(2 / (np.sqrt(rate**2 + 1) + rate))
    assert radius(0.999 * limit) <= 1 + 1e-9
    assert radius(1.001 * limit) > 1 + 1e-5


@pytest.mark.parametrize("words", [("springs.damping=0.0",), ("springs.damping=0.2",)])
def test_a_cloth_with_a_coarse_tolerance_stays_stable(words: tuple[str, ...]) -> None:
    """No error holds the parts back, only stability: no energy comes from nothing."""
    simulation = automatic(1.0, "springs.nodes=6", *words, scene="cloth")
    start, stepper = sum(vars(simulation.energies()).values()), simulation._stepper
    assert isinstance(stepper, AutomaticSprings)
    for k in range(100):
        report = simulation.step()
        assert INTERVAL / report.parts <= (stepper._runge_kutta if k == 0 else stepper._verlet)
        assert stepper.forces < 1.2
        assert report.rejected == 0
        e = simulation.energies()
        grown = e.kinetic + e.strain + e.gravity - start
        assert grown < 0.1 * abs(e.gravity)  # an instability knows no bound


def test_the_same_bits_at_once_one_by_one_after_reset_and_restore() -> None:
    simulation = automatic(1e-5)
    simulation.advance(20)
    ends = [simulation.positions.tobytes()]
    simulation.reset()
    for _ in range(20):
        simulation.step()
    ends.append(simulation.positions.tobytes())
    assert simulation.state.step == 20
    assert ends[0] == ends[1]
    saved, after = simulation.save(), []
    for _ in range(2):
        simulation.restore(saved)
        simulation.advance(5)
        after.append(simulation.positions.tobytes())
    assert after[0] == after[1] != ends[0]


def test_what_overflows_leaves_the_state_and_says_so() -> None:
    simulation = automatic(1e-6)
    simulation.state.velocities[3] = 1e200
    before = simulation.positions.copy()
    with raises_naming(StepError, "step 1 at 0 s", "overflows", "1e-06 s", "inertia.scheme", "tr_bdf2"):
        simulation.step()
    np.testing.assert_array_equal(simulation.positions, before)
    assert simulation.state.time == 0.0


def test_the_shortest_part_is_accepted_whatever_it_adds() -> None:
    report = automatic(1e-15, "time_error.shortest=2e-3").step()
    assert 8 <= report.parts <= 12
    assert report.time_error
    assert report.time_error.added > 1e-15


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (("time_error.estimate=global",), ("time_error.estimate", "'global'", "implicit scheme")),
        (("springs.stiffness=1e9", "springs.node_mass=1e-10"), ("dt is 0.02 s", "substeps of", "stable")),
    ],
)
def test_what_cannot_be_is_refused(words: tuple[str, ...], named: tuple[str, ...]) -> None:
    with raises_naming(SceneError, *named):
        automatic(1e-6, *words)


def test_it_needs_no_factorisation() -> None:
    assert automatic(1e-6, "solver.linear=cg").step().parts > 0


def test_it_counts_its_forces() -> None:
    simulation = automatic(1e-8)
    simulation.advance(10)
    assert 3.5 < simulation._stepper.forces < 6  # four a part of RK4, and those of the parts taken back


def test_absent_it_is_not_imported() -> None:
    code = (
        "import sys; from tripod_sim import Simulation, load_scene;"
        "s = Simulation(load_scene('pendulum', ['inertia.scheme=rk4'])); s.step();"
        "assert not {m for m in sys.modules if m.startswith('tripod_sim.springs.automatic')};"
        "s = Simulation(load_scene('pendulum', ['dt=auto'])); s.step();"
        "assert 'tripod_sim.integrators.stage' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
