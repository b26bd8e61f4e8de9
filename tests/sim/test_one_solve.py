"""One-solve mode: one linear solve a step where its residual allows, Newton's method where it does not."""

import numpy as np
import pytest

from tripod_sim import SceneError, Simulation, load_scene
from tripod_sim.integrators.left_over import LeftOver

WORKING = ("servos.angles=[-1.4965, -1.4965, -1.4965]", "servos.slide=0.035")


def swing(t: float) -> np.ndarray:
    phase = 2 * np.pi * t / 2.0 + 2 * np.pi * np.arange(3) / 3
    return np.array([*(-1.4965 + 0.15 * min(t, 1.0) * np.sin(phase)), 0.035])


def run(scene: str, *overrides: str, steps: int = 60) -> tuple[np.ndarray, list[int], list[int]]:
    """Effector positions, linear solves and factorisations of each step."""
    simulation = Simulation(load_scene(scene, [*WORKING, *overrides]))
    positions, solves, renewals = [], [], []
    for k in range(steps):
        report = simulation.step(swing((k + 1) * simulation.scene.dt))
        positions.append(simulation.state.centres[0].copy())
        solves.append(report.iterations)
        renewals.append(report.factorisations)
    return np.array(positions), solves, renewals


@pytest.mark.parametrize("scene", ["tripod", "tripod_sofa"])
def test_smooth_motion_takes_one_solve_a_step_and_stays_close(scene: str) -> None:
    level = "mesh.level=1" if scene == "tripod" else "mesh.level=5"
    exact, solves, _ = run(scene, level, "solver.mode=newton", "solver.tolerance=1e-8")
    assert min(solves[1:]) > 1
    quick, solves, renewals = run(scene, level, "solver.mode=one_solve")
    assert set(solves) == {1}
    assert sum(renewals) == 0  # the factorisation made when the scene was built serves the whole motion
    moved = np.ptp(exact, axis=0).max()
    assert moved > 3e-4
    assert np.abs(quick - exact).max() < 0.02 * moved


@pytest.mark.parametrize("scheme", ["implicit_euler", "bdf2", "tr_bdf2"])
@pytest.mark.parametrize(("scene", "level", "bound"), [("tripod", 1, 0.03), ("tripod_sofa", 5, 0.15)])
def test_a_slow_motion_is_not_held_behind(scene: str, level: int, bound: float, scheme: str) -> None:
    """What one solve leaves over does not add up: `bound` is in parts of what the effector moves in a step."""
    words = (f"mesh.level={level}", f"inertia.scheme={scheme}")
    steps = 200
    exact, _, _ = run(scene, *words, "solver.mode=newton", "solver.tolerance=1e-8", steps=steps)
    quick, solves, renewals = run(scene, *words, "solver.mode=one_solve", steps=steps)
    assert sum(renewals) <= 1  # the factorisation is one of the start throughout
    assert np.mean(solves) < 2.01
    moved = np.linalg.norm(np.diff(exact, axis=0), axis=1)[steps // 2 :]
    behind = np.linalg.norm(quick - exact, axis=1)[steps // 2 :]
    assert np.sqrt(np.mean(behind**2)) < bound * np.sqrt(np.mean(moved**2))


def test_nothing_is_left_over_where_the_matrix_is_that_of_another_pose() -> None:
    """A body without inertia whose stiffness is not the one factored, pulled at a constant speed: it keeps up."""
    stiffness, factored, pull = np.diag([1.0, 2.0, 3.0]), np.diag([2.5, 2.0, 2.0]), np.array([1.0, -2.0, 0.5])
    lags = []
    for carried in (False, True):
        left_over, x = LeftOver(3), np.zeros(3)
        for k in range(1, 121):
            residual = stiffness @ (x - k * pull)
            if carried:
                left_over.add_to(residual, 0.01)
            x -= np.linalg.solve(factored, residual)
            left_over.note(stiffness @ (x - k * pull))
        lags.append(120 * pull - x)
    np.testing.assert_allclose(lags[0], (factored @ np.linalg.inv(stiffness) - np.eye(3)) @ pull, atol=1e-9)
    assert np.abs(lags[1]).max() < 1e-6


@pytest.mark.parametrize("ratio", [0.05, 0.5, 1.0, 1.5, 1.95])
def test_what_is_carried_makes_no_mode_unstable_that_was_stable(ratio: float) -> None:
    """One solve with k0 for a spring of k is stable for k < 2 k0, and so it stays."""
    left_over, x = LeftOver(1), np.ones(1)
    for _ in range(600):
        residual = ratio * x
        left_over.add_to(residual, 0.01)
        x -= residual
        left_over.note(ratio * x)
    assert abs(x[0]) < 1e-3


def test_what_is_left_over_belongs_to_one_length_and_one_factorisation() -> None:
    left_over, residual = LeftOver(2), np.zeros(2)
    left_over.add_to(residual, 0.01)
    left_over.note(np.array([4.0, -8.0]))
    left_over.add_to(residual, 0.01)
    np.testing.assert_array_equal(residual, [1.0, -2.0])
    left_over.add_to(residual, 0.005)
    np.testing.assert_array_equal(residual, [1.0, -2.0])
    left_over.note(np.array([4.0, 4.0]))
    left_over.drop()
    left_over.add_to(residual, 0.005)
    np.testing.assert_array_equal(residual, [1.0, -2.0])


def test_a_restored_state_knows_nothing_of_what_was_left_over() -> None:
    simulation = Simulation(load_scene("tripod", ["mesh.level=1", *WORKING]))
    for k in range(40):
        simulation.step(swing(0.005 * (k + 1)))
    saved, ends = simulation.save(), []
    for turns in (1, 3, 0):
        for k in range(turns):
            simulation.step(swing(0.2 - 0.01 * k))
        simulation.restore(saved)
        for k in range(40, 50):
            simulation.step(swing(0.005 * (k + 1)))
        ends.append(simulation.state.positions.tobytes())
        simulation.restore(saved)
    assert ends[0] == ends[1] == ends[2]


def test_a_solve_that_leaves_too_much_goes_on_to_the_tolerance() -> None:
    options = [
        "mesh.level=1",
        "solver.mode=one_solve",
        "solver.share=0.01",
        "solver.tolerance=1e-6",
        *WORKING,
    ]
    simulation = Simulation(load_scene("tripod", options))
    jump = np.array([-0.9, -1.4965, -1.4965, 0.035])
    report = simulation.step(jump)
    assert report.iterations > 2
    assert report.residual <= 1e-6
    first = report.residual
    for _ in range(200):
        report = simulation.step(jump)
    assert report.residual < 1e-4 and first > 0


def test_the_share_decides() -> None:
    strict = run("tripod", "mesh.level=1", "solver.mode=one_solve", "solver.share=0.001")[1]
    assert max(strict) > 1


def test_statics_goes_to_the_tolerance() -> None:
    options = ["mesh.level=1", "inertia=off", "damping=off", "solver.mode=one_solve", "solver.tolerance=1e-7"]
    simulation = Simulation(load_scene("tripod", options))
    report = simulation.step(np.array([-0.2, 0.0, 0.0, 0.0]))
    assert report.residual <= 1e-7


def test_a_share_out_of_range_is_named() -> None:
    with pytest.raises(SceneError, match=r"solver.share is 0.9; it must be above 0 and at most 0.5"):
        load_scene("tripod", ["solver.share=0.9"])


@pytest.mark.parametrize("scheme", ["implicit_euler", "bdf2", "tr_bdf2"])
def test_the_first_step_finds_its_factorisation_made(scheme: str) -> None:
    options = ["mesh.level=1", f"inertia.scheme={scheme}", *WORKING]
    simulation = Simulation(load_scene("tripod", options))
    ends = []
    for _ in range(2):
        first = simulation.step(swing(0.005))
        assert first.factorisations == 0
        for k in range(1, 20):
            simulation.step(swing(0.005 * (k + 1)))
        ends.append(simulation.state.copy())
        simulation.reset()
    for name in ("positions", "velocities", "modes"):
        np.testing.assert_array_equal(getattr(ends[0], name), getattr(ends[1], name))
