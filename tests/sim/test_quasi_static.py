"""A static body pays where something changes, and for nothing else."""

import numpy as np
import pytest

from tests.sim.test_unstable_equilibria import COLUMN
from tripod_sim import Simulation, load_scene
from tripod_sim.forces.gravity import GravityForce

STATIC = ("inertia=off", "damping=off")


@pytest.fixture
def robot() -> Simulation:
    simulation = Simulation(load_scene("tripod", [*STATIC, "mesh.level=2"]))
    simulation.step(np.array([-0.3, 0.0, 0.0, 0.0]))
    return simulation


def test_what_rests_needs_no_tangent_and_stays_where_it_is(robot: Simulation) -> None:
    before, residual = robot.positions.copy(), robot.report.residual
    report = robot.step()
    assert (report.iterations, report.factorisations) == (0, 0)
    assert report.residual == pytest.approx(residual, rel=1e-6)
    assert report.residual <= robot.scene.solver.tolerance
    np.testing.assert_array_equal(robot.positions, before)
    assert robot.compliance().w == pytest.approx(fresh(robot).compliance().w, rel=1e-6)


def test_servos_that_go_on_are_followed_as_if_they_had_never_rested(robot: Simulation) -> None:
    for _ in range(3):
        robot.step()
    goal = np.array([-0.4, 0.0, 0.1, 0.0])
    assert robot.step(goal).factorisations > 0
    other = Simulation(load_scene("tripod", [*STATIC, "mesh.level=2"]))
    other.step(np.array([-0.3, 0.0, 0.0, 0.0]))
    other.step(goal)
    np.testing.assert_array_equal(robot.positions, other.positions)


def test_a_body_that_was_moved_comes_back(robot: Simulation) -> None:
    rest = robot.positions.copy()
    robot.step()
    free = robot._system.reduction.free
    robot.state.positions[free] += 1e-4 * np.random.default_rng(0).uniform(-1, 1, (len(free), 3))
    assert robot.step().factorisations > 0
    np.testing.assert_allclose(robot.positions, rest, atol=1e-6)


def test_a_load_that_changes_is_taken_up(robot: Simulation) -> None:
    robot.step()
    height = robot.effector.position[2]
    weight = next(term for term in robot._system.terms if isinstance(term, GravityForce))
    weight._gradient *= 2.0
    assert robot.step().factorisations > 0
    assert robot.effector.position[2] < height - 1e-4


def test_after_a_restore_it_is_solved_anew(robot: Simulation) -> None:
    saved = robot.save()
    robot.step()
    robot.restore(saved)
    assert robot.step().factorisations > 0
    assert robot.step().factorisations == 0


def test_an_unstable_equilibrium_is_told_as_long_as_it_lasts() -> None:
    simulation = Simulation(load_scene("column", COLUMN))
    while simulation.state.time < 1.0 - 1e-9:
        assert simulation.step().factorisations > 0
    for _ in range(3):
        report = simulation.step()
        assert report.unstable
        assert report.factorisations == 0


def test_another_equilibrium_is_told_by_itself() -> None:
    straight, buckled = (Simulation(load_scene("column", COLUMN)) for _ in range(2))
    for simulation in (straight, buckled):
        while simulation.state.time < 1.0 - 1e-9:
            simulation.step()
    free = buckled._system.reduction.free
    buckled.state.positions[free] += 1e-4 * np.random.default_rng(0).uniform(-1, 1, (len(free), 3))
    assert not buckled.step().unstable
    assert straight.step().unstable
    buckled.state.copy_to(straight.state)
    assert not straight.step().unstable


def fresh(robot: Simulation) -> Simulation:
    """The same pose, gone to by another simulation."""
    other = Simulation(robot.scene)
    other.step(robot.command)
    return other
