"""Hard limits on the Tripod itself: kept at rest to nanometres, and on the way."""

import numpy as np
import pytest

from tests.scenes import SHARP
from tripod_ik.inverse import InverseSolver, Outcome
from tripod_ik.limits import AngleLimit
from tripod_ik.model import StaticModel
from tripod_ik.row_limits import EffectorBox, TorqueLimit
from tripod_ik.tasks import PositionTask
from tripod_ik.tracker import Tracker
from tripod_ik.tracker_settings import TrackerSettings
from tripod_sim import load_scene

BOX = ((-0.006, -0.005, -0.012), (0.005, 0.006, -0.004))
DT = 0.02


@pytest.fixture(scope="module")
def shared():
    return StaticModel(load_scene(SHARP, ["mesh.level=1"]))


@pytest.fixture
def model(shared):
    saved = shared.save()
    yield shared
    shared.restore(saved)


def passed(state, torque=np.inf):
    """Return by how much the box [m] and the torque [N m] are passed."""
    p = state.equilibrium
    return (
        np.maximum(p - BOX[1], BOX[0] - p).max(),
        np.abs(state.efforts).max() - torque,
    )


@pytest.mark.parametrize("target", [[0.02, 0.0, -0.008], [0.01, 0.012, -0.02], [0.0, -0.03, 0.02]])
def test_a_solution_keeps_a_hard_box_to_nanometres_however_far_the_target(model, target):
    solution = InverseSolver(
        model, AngleLimit(-2.1, 0.6), row_limits=[EffectorBox(*map(np.array, BOX), hard=True)]
    ).solve([PositionTask(target)])
    assert solution.outcome is Outcome.CLOSEST
    assert solution.active_limits
    assert solution.residual > 5e-3
    assert -1e-8 < passed(solution.state)[0] < 1e-8  # at the wall, and not through it
    assert solution.passed < 1e-6


def test_a_solution_begun_beyond_hard_limits_ends_within_them(model):
    model.move(np.array([-0.9, -1.0, -1.1]))
    assert passed(model.state())[0] > 1e-3
    rows = [EffectorBox(*map(np.array, BOX), hard=True), TorqueLimit(0.15, hard=True)]
    solution = InverseSolver(model, AngleLimit(-2.1, 0.6), row_limits=rows).solve(
        [PositionTask([0.0, -0.02, -0.008])]
    )
    assert solution.passed < 1e-6
    assert max(passed(solution.state, 0.15)) < 1e-7


def test_where_no_pose_keeps_to_the_limits_the_solution_says_so(model):
    rows = [TorqueLimit(0.02, hard=True)]
    solution = InverseSolver(model, AngleLimit(-1.9, -1.1), row_limits=rows).solve(
        [PositionTask([0.0, 0.0, -0.008])]
    )
    assert solution.passed > 1e-2


@pytest.mark.parametrize("hard", [False, True])
def test_a_tracked_target_takes_the_resting_effector_beyond_a_hard_box_neither_on_the_way_nor_at_rest(
    model, hard
):
    """Jumps to targets outside, at 3 rad/s: without tightening, the curvature takes it micrometres through the wall."""
    settings = TrackerSettings(angle_speed=3.0, box=BOX, torque_max=0.17, hard=hard)
    tracker, command, k = Tracker(settings), model.angles, 0
    worst, ends = [], []
    for target in ([0.02, 0.0, -0.008], [-0.02, 0.005, -0.02], [0.004, -0.02, 0.02], [0.0, 0.02, -0.008]):
        tracker.target = np.array(target)
        for _ in range(40):
            state = model.move(command)
            worst.append(passed(state, 0.17))
            step = tracker.update(state, k * DT)
            command, k = step.result.command, k + 1
        assert step.result.active_limits
        ends.append(passed(model.move(command), 0.17))
        assert np.abs(step.result.command - state.angles).max() < 1e-3
    assert np.max(ends, axis=0)[0] > -1e-6  # it does go to the wall
    if hard:
        assert np.max(worst) < 1e-7
    else:
        assert np.max(worst) > 1e-6
