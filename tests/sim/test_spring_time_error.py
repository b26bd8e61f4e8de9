"""The estimated error of the time steps of springs, and steps chosen by it."""

import subprocess
import sys

import numpy as np
import pytest

from tests.messages import raises_naming
from tests.sim.implicit_schemes import IMPLICIT, scheme_of
from tripod_sim import SceneError, Simulation, StepError, load_scene

INTERVAL, END = 0.02, 0.8  # [s]
SCHEMES = [name for name in IMPLICIT if scheme_of(name).has_one_length]  # of the loops of springs alone


def pendulum(*words: str, scene: str = "pendulum") -> Simulation:
    return Simulation(load_scene(scene, list(words)))


def motion(simulation: Simulation, end: float = END) -> np.ndarray:
    """Positions at the ends of the intervals, shape (intervals, n, 3)."""
    every, found = round(INTERVAL / simulation.scene.dt), []
    for _ in range(round(end / INTERVAL)):
        for _ in range(every):
            simulation.step()
        found.append(simulation.state.positions.copy())
    return np.array(found)


DAMPED = ("springs.damping=0.5", "damping={mass=0.3, stiffness=1e-4}")


@pytest.fixture(scope="module", params=[(), DAMPED], ids=["undamped", "damped"])
def case(request: pytest.FixtureRequest) -> tuple[tuple[str, ...], np.ndarray]:
    fine = pendulum(*request.param, "inertia={scheme='rk4', substeps='off'}", "dt=5e-5")
    return request.param, motion(fine)


@pytest.mark.parametrize(("scheme", "dt"), [("implicit_euler", 2e-4), ("bdf2", 1.25e-3), ("tr_bdf2", 2.5e-3),
                                            ("tr_bdf2", 1.25e-3)])  # fmt: skip
def test_the_estimate_is_the_true_error_and_points_the_right_way(
    scheme: str, dt: float, case: tuple[tuple[str, ...], np.ndarray]
) -> None:
    words, reference = case
    simulation = pendulum(*words, f"inertia.scheme={scheme}", f"dt={dt!r}", "time_error={}")
    true = reference - motion(simulation)
    report, state = simulation.report.time_error, simulation.state.errors
    assert report
    assert state
    largest = np.linalg.norm(true[-1], axis=1).max()
    assert largest > 1e-5
    assert largest / 3 < report.largest < 3 * largest
    assert report.largest == pytest.approx(np.linalg.norm(state.error[0][report.node]))
    if scheme != "implicit_euler":  # whose error is too large for a linear estimate to take most of it away
        assert np.linalg.norm(true[-1] - state.error[0], axis=1).max() < 0.3 * largest
    assert np.isnan(report.effector)
    assert np.isnan(report.added)


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize(
    "words", [("pendulum",), ("pendulum", *DAMPED), ("cloth", "springs.nodes=6", "damping={}")]
)
def test_the_estimate_leaves_no_trace_in_the_motion(scheme: str, words: tuple[str, ...]) -> None:
    ends = []
    for more in ((), ("time_error={}",), ("time_error={}", "time_error=off")):
        simulation = pendulum(*words[1:], f"inertia.scheme={scheme}", *more, scene=words[0])
        motion(simulation, 0.4)
        ends.append(simulation.state.positions.tobytes() + simulation.state.velocities.tobytes())
    assert ends[0] == ends[1] == ends[2]


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_falling_chain_s_estimate_is_its_error(scheme: str) -> None:
    """v' = g - a v from rest: the exact solution is known."""
    drag, fall, dt, steps = 8.0, -9.81, 0.0005, 400  # what is left falls with dt, too
    words = ["springs.fixed_corners=[]", "springs.stiffness=0", f"damping={{mass={drag}, stiffness=0.0}}"]
    simulation = pendulum(*words, f"inertia.scheme={scheme}", f"dt={dt}", "time_error={}")
    for _ in range(steps):
        simulation.step()
    t = dt * steps
    error = fall / drag * (t - (1 - np.exp(-drag * t)) / drag) - simulation.state.positions[:, 2]
    assert np.abs(error).min() > 2e-8
    assert simulation.state.errors
    np.testing.assert_allclose(simulation.state.errors.error[0][:, 2], error, rtol=0.05)


@pytest.mark.parametrize("scheme", ["bdf2", "tr_bdf2"])
def test_automatic_steps_follow_the_tolerance(scheme: str, case: tuple[tuple[str, ...], np.ndarray]) -> None:
    words, reference = case
    errors, parts = [], []
    for tolerance in (1e-4, 1e-5, 1e-6):
        own = [f"inertia.scheme={scheme}", f"dt={INTERVAL}", "dt=auto", f"time_error.tolerance={tolerance}"]
        simulation = pendulum(*words, *own, "time_error.estimate=global")
        total, found = 0, []
        for _ in range(round(END / INTERVAL)):
            report = simulation.step()
            assert report.time_error
            assert 0 < report.time_error.added <= tolerance
            total += report.parts
            found.append(simulation.state.positions.copy())
        errors.append(np.linalg.norm(found - reference, axis=2).max())
        parts.append(total)
        assert errors[-1] / 3 < report.time_error.largest < 3 * errors[-1]
    assert errors[0] > 3 * errors[1] > 9 * errors[2]
    assert parts[0] < parts[1] < parts[2]
    assert simulation.state.time == pytest.approx(END)


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("words", [(), DAMPED], ids=["undamped", "damped"])
def test_the_local_estimate_steers_to_the_same_bits_and_tells_no_more(
    scheme: str, words: tuple[str, ...]
) -> None:
    found = []
    for more in ((), ("time_error.estimate=local",), ("time_error.estimate=global",)):
        own = (f"inertia.scheme={scheme}", f"dt={INTERVAL}", "dt=auto", "time_error.tolerance=1e-4", *more)
        simulation, ends = pendulum(*words, *own), []
        for _ in range(20):
            report = simulation.step()
            assert report.time_error
            ends.append(
                (simulation.positions.tobytes(), report.parts, report.rejected, report.time_error.added)
            )
        assert simulation.state.errors
        told, carried = report.time_error, bool(more) and more[0].endswith("global")
        assert (told.largest > 0) == carried == simulation.state.errors.error.any()
        assert np.isnan(told.largest) != carried
        assert (told.node < 0) != carried
        found.append(ends)
    assert found[0] == found[1] == found[2]


@pytest.mark.parametrize(("scheme", "order"), [("implicit_euler", 1), ("bdf2", 2), ("tr_bdf2", 2)])
@pytest.mark.parametrize("words", [(), DAMPED], ids=["undamped", "damped"])
def test_the_local_estimate_is_what_one_step_adds(scheme: str, order: int, words: tuple[str, ...]) -> None:
    fine = pendulum(*words, "inertia={scheme='rk4', substeps='off'}", "dt=5e-5")
    allowed = 1.0 if order == 1 else 1e-5  # above what a step adds; solves end at a small share of it
    true, added = [], []
    for h in (2e-3, 1e-3):
        own = (
            f"inertia.scheme={scheme}",
            f"dt={h}",
            "dt=auto",
            f"time_error.tolerance={allowed}",
            "solver.tolerance=1e-10",
        )
        simulation = pendulum(*words, *own)
        simulation.advance(round(0.3 / h) - 1)
        fine.state.positions[:], fine.state.velocities[:] = simulation.positions, simulation.state.velocities
        report = simulation.step()
        assert report.parts == 1
        assert report.time_error
        fine.advance(round(h / 5e-5))
        true.append(np.linalg.norm(simulation.positions - fine.positions, axis=1).max())
        added.append(report.time_error.added)
    np.testing.assert_allclose(added, true, rtol=0.5)
    assert added[0] / added[1] == pytest.approx(2 ** (order + 1), rel=0.25)


def test_automatic_steps_shrink_where_the_motion_is_fast() -> None:
    """The pendulum starts slowly; its end then whips round."""
    simulation = pendulum("inertia.scheme=tr_bdf2", f"dt={INTERVAL}", "dt=auto", "time_error.tolerance=1e-5")
    parts = [simulation.step().parts for _ in range(80)]
    assert max(parts[40:]) > 2 * np.mean(parts[3:12])


def test_reset_and_restore_bring_estimate_and_steps_back() -> None:
    simulation = pendulum("inertia.scheme=tr_bdf2", f"dt={INTERVAL}", "dt=auto", "time_error.estimate=global")

    def shot() -> bytes:
        e = simulation.state.errors
        assert e
        return (
            e.error.tobytes() + repr((e.known, e.proposed, e.last)).encode() + simulation.positions.tobytes()
        )

    start, ends = shot(), []
    for _ in range(2):
        motion(simulation, 0.2)
        ends.append(shot())
        simulation.reset()
        assert shot() == start
    assert ends[0] == ends[1] != start
    motion(simulation, 0.2)
    saved, after = simulation.save(), []
    for _ in range(2):
        simulation.restore(saved)
        motion(simulation, 0.1)
        after.append(shot())
    assert after[0] == after[1] != ends[0]


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("steps", ["fixed", "auto"])
def test_conjugate_gradients_estimate_what_a_factorisation_does(scheme: str, steps: str) -> None:
    found = []
    for linear in ("ldl", "cg"):
        solver = f"solver={{linear='{linear}', linear_tolerance=1e-12, tolerance=1e-11}}"
        exact = ", tolerance=1e-12, shortest=2e-3" if steps == "auto" else ""  # solves end at a share of it
        wanted = f"time_error={{steps='{steps}', estimate='global'{exact}}}"
        simulation = pendulum(*DAMPED, f"inertia.scheme={scheme}", "dt=2e-3", wanted, solver)
        for _ in range(50):
            simulation.step()
        found.append((simulation.report, simulation.state))
    (direct, one), (iterated, other) = found
    assert one.errors
    assert other.errors
    assert direct.time_error.largest > 1e-7
    assert iterated.parts == direct.parts
    largest = (
        direct.time_error.largest
    )  # an earlier factorisation leaves over up to 2 % of a load's small part
    np.testing.assert_allclose(other.errors.error[0], one.errors.error[0], rtol=0, atol=1e-3 * largest)


@pytest.mark.parametrize("steps", ["fixed", "auto"])
def test_a_step_that_cannot_be_saved_leaves_the_state(steps: str) -> None:
    own = f"time_error={{steps='{steps}', tolerance=1e-15}}"  # solves end at a share of it
    broken = pendulum("inertia.scheme=bdf2", own, "solver.max_halvings=2")
    newton = broken._stepper.newton
    newton.tolerance, newton.max_iterations = 1e-30, 1
    before = broken.positions.copy()
    with raises_naming(StepError, "step 1 at 0 s", "substeps", "unbalanced force"):
        broken.step()
    np.testing.assert_array_equal(broken.positions, before)
    assert broken.state.errors
    assert not broken.state.errors.error.any()


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["inertia=off"], ("time_error", "inertia", "at rest")),
        (["time_error={steps='auto', shortest=0.1}"], ("time_error.shortest", "0.1 s", "at most dt")),
        (["time_error.estimate=local"], ("time_error.estimate", "'local'", "fixed dt")),
        (["time_error.estimate=both"], ("time_error.estimate", "'both'", "auto, global, local")),
    ],
)
def test_what_it_cannot_estimate_is_refused(words: list[str], named: tuple[str, ...]) -> None:
    with raises_naming(SceneError, *named):
        load_scene("pendulum", ["inertia.scheme=bdf2", "time_error={}", *words])


def test_absent_it_is_not_imported() -> None:
    code = (
        "import sys; from tripod_sim import Simulation, load_scene;"
        "s = Simulation(load_scene('pendulum', ['inertia.scheme=bdf2'])); s.step(); assert s.state.errors is None;"
        "assert 'tripod_sim.integrators.stage' in sys.modules;"
        "absent = {'tripod_sim.integrators.time_error', 'tripod_sim.integrators.added_error_control'};"
        "assert not absent & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
