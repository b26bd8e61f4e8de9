"""The converged solution does not depend on the way that the search, or the body before it, has taken."""

import numpy as np
import pytest

from tests.scenes import SHARP
from tripod_ik.inverse import InverseSolver, Outcome
from tripod_ik.limits import AngleLimit
from tripod_ik.model import StaticModel
from tripod_ik.tasks import PositionTask
from tripod_sim import load_scene

SLACK = np.array([-0.966, -0.717, -1.478])
"""Angles [rad] at which a strip hangs slack: the disc rests 7 mm above the mid-plane, or 2 mm below it."""

WAYS = ([], [[-1.25, -0.72, -1.79]], [[-1.5, -1.18, -1.8]], [[-0.64, -1.65, -1.63]])


@pytest.fixture(scope="module")
def shared():
    return StaticModel(load_scene(SHARP))


@pytest.fixture
def model(shared):
    saved = shared.save()
    yield shared
    shared.restore(saved)


def along(model, home, way):
    model.restore(home)
    for angles in way:
        model.move(np.array(angles))


def test_a_slack_body_is_in_one_of_two_equilibria_and_settles_in_one(model):
    home, found, settled = model.save(), [], []
    for way in WAYS:
        along(model, home, [*way, SLACK])
        found.append(model.state().equilibrium.copy())
        other = model.settle()
        settled.append(model.state().equilibrium.copy())
        assert other == (np.linalg.norm(settled[-1] - found[-1]) > 1e-3)
        assert model.angles == pytest.approx(SLACK, abs=1e-15)
    assert np.ptp(found, axis=0).max() > 5e-3
    assert np.ptp(settled, axis=0).max() < 1e-9


@pytest.mark.parametrize(
    ("angles", "ways"),
    [(SLACK, WAYS), ([-1.45, -0.61, -0.72], [[], [[-2.08, -0.88, -0.73]], [[-0.81, -2.05, -1.01]]])],
)
def test_targets_in_a_slack_corner_have_one_solution_whatever_the_way(model, angles, ways):
    """The second has two solutions, 0.09 rad apart: which one a search from the present pose finds depends on that."""
    home, ends = model.save(), []
    target = model.move(np.array(angles)).equilibrium.copy()
    for way in ways:
        along(model, home, way)
        solution = InverseSolver(model, AngleLimit(-2.1, 0.6)).solve([PositionTask(target)])
        assert solution.outcome is Outcome.REACHED
        assert solution.state.equilibrium == pytest.approx(target, abs=1e-6)
        ends.append(solution.state.angles)
    assert np.ptp(ends, axis=0).max() < 1e-5


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_random_ways_to_random_targets_end_in_one_solution(model, seed):
    """Every second target lies where one servo is far up and strips hang slack."""
    home, rng = model.save(), np.random.default_rng(seed)
    solver = InverseSolver(model, AngleLimit(-2.1, 0.6))
    for k in range(3):
        angles = rng.uniform(-2.0, -0.7, 3)
        if k % 2:
            angles = rng.permutation([rng.uniform(-0.8, -0.6), *rng.uniform(-1.8, -1.4, 2)])
        along(model, home, [angles])
        target, ends = model.state().equilibrium.copy(), []
        for _ in range(3):
            along(model, home, rng.uniform(-2.1, -0.6, (2, 3)))
            solution = solver.solve([PositionTask(target)])
            assert solution.outcome is Outcome.REACHED
            ends.append(solution.state.angles)
        assert np.ptp(ends, axis=0).max() < 1e-5
