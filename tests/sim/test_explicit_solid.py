"""Explicit schemes on solids: recurrence, order, agreement with an implicit scheme, division, flag."""

import re

import numpy as np
import pytest

from tests.messages import names, raises_naming
from tripod_sim import Simulation, StepError, load_scene
from tripod_sim.integrators import force_kernels

ORDERS = {"explicit_euler": 1, "semi_implicit_euler": 1, "rk4": 4}
DRAG, FALL = 8.0, -9.81


def recurrence(scheme: str, h: float, steps: int) -> tuple[float, float]:
    """Height and speed of a mass with v' = FALL - DRAG v, from rest."""
    x = v = 0.0
    for _ in range(steps):
        a = FALL - DRAG * v
        if scheme == "explicit_euler":
            x, v = x + h * v, v + h * a
        elif scheme == "semi_implicit_euler":
            v += h * a
            x += h * v
        else:
            z = -h * DRAG
            grown = 1 + z + z**2 / 2 + z**3 / 6 + z**4 / 24  # of v - FALL / DRAG
            mean = 1 + z / 2 + z**2 / 6 + z**3 / 24
            rest = FALL / DRAG
            x += h * (rest + (v - rest) * mean)
            v = rest + (v - rest) * grown
    return x, v


@pytest.mark.parametrize("scheme", ORDERS)
def test_a_falling_body_follows_the_recurrence(scheme: str) -> None:
    words = ["mesh.level=1", "mesh.element=t4", f"inertia={{scheme='{scheme}', substeps='off'}}", "dt=1e-5",
             f"damping={{mass={DRAG}, stiffness=0.0}}"]  # fmt: skip
    simulation = Simulation(load_scene("silicone_free", words))
    rest = simulation.positions.copy()
    for _ in range(40):
        simulation.step()
    x, v = recurrence(scheme, 1e-5, 40)
    np.testing.assert_allclose(simulation.positions - rest, [[0, 0, x]] * len(rest), atol=1e-12)
    np.testing.assert_allclose(simulation.state.velocities[:, 2], v, rtol=1e-9)


def bent(words: list[str], steps: int, end: float = 0.002) -> np.ndarray:
    """Positions of the silicone piece, struck at the start, after `end` [s]."""
    base = ["mesh.level=1", "solver.tolerance=1e-7", f"dt={end / steps}"]
    simulation = Simulation(load_scene("silicone", [*base, *words]))
    x = simulation.positions
    simulation.state.velocities[:, 2] = 3.0 * (x[:, 0] - 0.045) / 0.1
    simulation.state.velocities[simulation._system.groups.fixed] = 0.0
    for _ in range(steps):
        simulation.step()
    return simulation.positions.copy()


@pytest.mark.parametrize("element", ["h8", "h8_modes"])
def test_error_falls_at_the_order_of_the_scheme(element: str) -> None:
    base = [f"mesh.element={element}", "damping=off"]
    reference = bent([*base, "inertia={scheme='rk4', substeps='off'}"], 160)
    for scheme, steps in (("explicit_euler", 160), ("semi_implicit_euler", 160), ("rk4", 20)):
        words = [*base, f"inertia={{scheme='{scheme}', substeps='off'}}"]
        errors = [np.abs(bent(words, n) - reference).max() for n in (steps, 2 * steps)]
        assert np.log2(errors[0] / errors[1]) == pytest.approx(ORDERS[scheme], abs=0.25), scheme
        assert errors[1] < {"rk4": 1e-7}.get(scheme, 1e-4)


def test_explicit_and_implicit_agree_on_a_damped_body() -> None:
    damping = ["damping={mass=20.0, stiffness=1e-5}", "mesh.element=t4"]
    explicit = bent([*damping, "inertia={scheme='rk4', substeps='off'}"], 80)
    implicit = bent([*damping, "inertia.scheme=bdf2"], 200)
    undamped = bent(["damping=off", "mesh.element=t4", "inertia={scheme='rk4', substeps='off'}"], 80)
    assert np.abs(explicit - undamped).max() > 1e-5
    np.testing.assert_allclose(explicit, implicit, atol=2e-6)


def test_steps_are_divided_until_they_are_stable() -> None:
    words = [
        "mesh.level=1",
        "mesh.element=t4",
        "inertia.scheme=semi_implicit_euler",
        "damping=off",
        "dt=0.005",
    ]
    simulation = Simulation(load_scene("silicone", words))
    for _ in range(10):
        report = simulation.step()
        assert report.parts == np.ceil(0.005 / (0.5 * report.dt_limit))
        assert report.growth == 0.0
    e = simulation.energies()
    assert abs(e.kinetic + e.strain + e.gravity) < 0.02 * e.kinetic


def test_explicit_euler_without_damping_is_told_to_be_stable_at_no_step() -> None:
    words = ["mesh.level=1", "mesh.element=t4", "inertia.scheme=explicit_euler", "damping=off"]
    simulation = Simulation(load_scene("silicone", words))
    with raises_naming(StepError, "limit is 0 s", "every dt", "[damping]"):
        for _ in range(50):
            simulation.step()


def test_a_step_of_far_too_many_parts_is_refused_at_once() -> None:
    """It would take minutes: damping by 0.05 s lets a part be no longer than 27 ns."""
    with raises_naming(StepError, "substeps", "2.7e-08 s", "implicit scheme") as caught:
        Simulation(load_scene("tripod_sofa", ["inertia.scheme=semi_implicit_euler"])).step()
    count = max(int(number) for number in re.findall(r"\b\d+\b", str(caught.value)))
    assert 100_000 <= count < 1_000_000


@pytest.mark.parametrize("scheme", ["semi_implicit_euler", "rk4"])
def test_rounding_of_a_body_that_nothing_moves_is_no_growth(scheme: str) -> None:
    simulation = Simulation(
        load_scene("silicone_free", ["mesh.level=1", "gravity=off", f"inertia.scheme={scheme}"])
    )
    for _ in range(5):
        assert not simulation.step().grew_at


def test_undivided_steps_are_flagged_and_stop_at_the_last_good_state() -> None:
    words = ["mesh.level=1", "mesh.element=t4", "inertia={scheme='semi_implicit_euler', substeps='off'}", "damping=off",
             "dt=2e-4"]  # fmt: skip
    simulation = Simulation(load_scene("silicone", words))
    flagged = 0
    with raises_naming(StepError, "element", "limit is", "dt 0.0002 s") as caught:
        for step in range(1, 300):
            report = simulation.step()
            flagged = flagged or (step if report.growth > 0 else 0)
    assert any(names(caught.value, fault) for fault in ("turned inside out", "crushed", "blown up"))
    assert np.isfinite(simulation.positions).all()
    assert 0 < flagged <= simulation.state.step


def test_modes_are_balanced_where_their_force_is_a_share_of_all_components_of_the_nodes_forces() -> None:
    g, floor = np.array([[3.0, -1.0, 0.5], [0.0, 2.0, -4.0]]), 0.25
    limit = force_kernels.BALANCED**2 * (floor + (g**2).sum())
    assert force_kernels._balanced(0.999 * limit, g, floor)
    assert not force_kernels._balanced(1.001 * limit, g, floor)
    assert force_kernels._balanced(np.nan, g, floor)  # nothing is to be gained there
