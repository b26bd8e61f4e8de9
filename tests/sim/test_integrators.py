"""Every implicit scheme: its own recurrence worked out by scalars, its order on the robot, its damping."""

import numpy as np
import pytest

from tests.scenes import SHARP
from tripod_sim import Simulation, load_scene

SCHEMES = {"implicit_euler": 1, "bdf2": 2, "tr_bdf2": 2}
FREE = [
    "servos=off",
    "effector=off",
    "mesh.level=1",
    "solver.tolerance=1e-10",
    "damping={mass=8.0, stiffness=0.0}",
]
DRAG, FALL = 8.0, -9.81  # [1/s], [m/s²]


def recurrence(scheme: str, h: float, steps: int) -> tuple[float, float]:
    """Height and speed of a mass with v' = FALL - DRAG v, from rest, by each scheme's formulas."""
    x = v = 0.0
    x_before = v_before = 0.0
    acceleration = 0.0
    for n in range(steps):
        if scheme == "tr_bdf2" and n > 0:
            g = 2 - np.sqrt(2)
            k = g * h / 2
            v_g = (v + k * (acceleration + FALL)) / (1 + k * DRAG)
            x_g = x + k * (v + v_g)
            p, q = 1 / (g * (2 - g)), (1 - g) ** 2 / (g * (2 - g))
            s = (1 - g) / (2 - g) * h
            v_new = (p * v_g - q * v + s * FALL) / (1 + s * DRAG)
            x, v = p * x_g - q * x + s * v_new, v_new
            acceleration = FALL - DRAG * v
        elif scheme == "bdf2" and n > 0:
            v_new = (4 * v - v_before + 2 * h * FALL) / (3 + 2 * h * DRAG)
            x_new = (4 * x - x_before + 2 * h * v_new) / 3
            x_before, v_before, x, v = x, v, x_new, v_new
        else:
            v_new = (v + h * FALL) / (1 + h * DRAG)
            x_before, v_before, x, v = x, v, x + h * v_new, v_new
            acceleration = FALL - DRAG * v
    return x, v


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_falling_body_follows_the_recurrence(scheme: str) -> None:
    simulation = Simulation(load_scene(SHARP, [*FREE, f"inertia.scheme={scheme}", "dt=0.01"]))
    rest, steps = simulation.state.positions.copy(), 30
    for _ in range(steps):
        simulation.step()
    x, v = recurrence(scheme, 0.01, steps)
    np.testing.assert_allclose(simulation.state.positions[:, 2] - rest[:, 2], x, atol=1e-9)
    np.testing.assert_allclose(simulation.state.velocities[:, 2], v, rtol=1e-7)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_the_recurrences_themselves_converge_to_the_solution(scheme: str) -> None:
    """So that the test above compares with the scheme and not with a twin of its mistakes."""
    end = 0.3
    exact = FALL / DRAG * (end - (1 - np.exp(-DRAG * end)) / DRAG)
    errors = np.array([abs(recurrence(scheme, end / n, n)[0] - exact) for n in (40, 80, 160)])
    np.testing.assert_allclose(np.log2(errors[:-1] / errors[1:]), SCHEMES[scheme], atol=0.1)


def swung(scheme: str, steps: int) -> np.ndarray:
    """Effector position 60 ms after servo 0 began to move smoothly."""
    dt = 0.06 / steps
    solver = ["solver.mode=newton", "solver.tolerance=1e-8"]
    overrides = ["mesh.level=1", f"dt={dt}", *solver, f"inertia.scheme={scheme}"]
    simulation = Simulation(load_scene(SHARP, overrides))
    for k in range(steps):
        angle = -0.1 * (1 - np.cos(np.pi * min(1.0, (k + 1) * dt / 0.03)))
        simulation.step(np.array([angle, 0, 0, 0]))
    return simulation.state.centres[0].copy()


@pytest.fixture(scope="module")
def reference() -> np.ndarray:
    return swung("tr_bdf2", 1600)


@pytest.mark.parametrize(
    ("scheme", "steps", "bound"),
    [("implicit_euler", 400, 1e-4), ("bdf2", 200, 1e-6), ("tr_bdf2", 120, 1.5e-6)],
)
def test_error_on_the_robot_falls_at_the_order_of_the_scheme(
    scheme: str, steps: int, bound: float, reference: np.ndarray
) -> None:
    """Elements, disc, driven clamps and damping by stiffness together."""
    errors = np.array([np.abs(swung(scheme, n) - reference).max() for n in (steps, 2 * steps)])
    assert np.log2(errors[0] / errors[1]) == pytest.approx(SCHEMES[scheme], abs=0.12)
    assert errors[1] < bound  # [m]


def test_second_order_schemes_keep_more_of_a_vibration() -> None:
    """Undamped, after 0.1 s at dt 1 ms, the share of a plucked piece's energy that each scheme leaves."""
    left = {}
    for scheme in SCHEMES:
        overrides = ["mesh.level=1", "gravity=off", "damping=off", "dt=0.001", f"inertia.scheme={scheme}"]
        simulation = Simulation(load_scene("silicone", overrides))
        x = simulation.state.positions
        simulation.state.velocities[:, 2] = 0.5 * (x[:, 0] - 0.045) / 0.1  # the lowest bending mode, nearly
        start = simulation.energies().kinetic
        for _ in range(100):
            simulation.step()
        e = simulation.energies()
        left[scheme] = (e.kinetic + e.strain) / start
    assert left["implicit_euler"] < left["bdf2"] < left["tr_bdf2"] <= 1.001
    assert left["tr_bdf2"] > 0.8


@pytest.mark.parametrize("scheme", SCHEMES)
def test_reset_forgets_the_history(scheme: str) -> None:
    simulation = Simulation(load_scene(SHARP, ["mesh.level=1", f"inertia.scheme={scheme}"]))
    ends = []
    for _ in range(2):
        for k in range(10):
            simulation.step(np.array([-0.03 * k, 0.01 * k, 0, 0]))
        ends.append(simulation.state.positions.tobytes())
        simulation.reset()
    assert ends[0] == ends[1]


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_jump_is_survived_in_parts(scheme: str) -> None:
    simulation = Simulation(load_scene(SHARP, ["mesh.level=1", f"inertia.scheme={scheme}"]))
    for _ in range(300):
        simulation.step(np.array([-2.1, -2.1, -2.1, 0.0]))
        assert np.isfinite(simulation.state.positions).all()
    assert simulation.energies().kinetic < 1e-6
