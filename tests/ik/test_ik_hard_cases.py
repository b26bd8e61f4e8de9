"""Hard cases on the Tripod itself: nothing that is not a number, no limit broken, a status that says which."""

import dataclasses

import numpy as np
import pytest

from tests.scenes import SHARP
from tripod_ik.errors import IkError
from tripod_ik.model import StaticModel
from tripod_ik.rotation import normal_of
from tripod_ik.tracker import Activity, Tracker
from tripod_ik.tracker_settings import Goal, TrackerSettings
from tripod_sim import load_scene

WORKING = np.full(3, -1.4965)
LOW, HIGH, SPEED, DT = -2.1, -0.4, 3.0, 0.02


@pytest.fixture(scope="module")
def shared():
    return StaticModel(load_scene(SHARP, ["mesh.level=1"]))


@pytest.fixture
def model(shared):
    saved = shared.save()
    yield shared
    shared.restore(saved)


def run(model, tracker, ticks, start=0):
    """Let the robot obey; return the steps, after a look at every one of them."""
    steps, command = [], model.angles
    for k in range(start, start + ticks):
        step = tracker.update(model.move(np.clip(command, -2.1, 0.6)), k * DT)
        result = step.result
        for value in (result.command, result.d_tau, result.error, result.residual, result.kkt, step.error):
            assert np.isfinite(value).all()
        assert result.ok
        assert result.kkt < 1e-6
        assert (result.command >= LOW).all()
        assert (result.command <= HIGH).all()
        assert np.abs(result.command - command).max() <= SPEED * DT + 1e-12
        command = result.command
        steps.append(step)
    return steps


def settings(**changes):
    return TrackerSettings(angle_min=LOW, angle_max=HIGH, angle_speed=SPEED, **changes)


@pytest.mark.parametrize("angles", [WORKING, [-0.6, -0.6, -0.6], [-2.1, -0.7, -1.3], [-1.0, -2.0, -1.5]])
@pytest.mark.parametrize("goal", list(Goal))
def test_beginning_moves_nothing_from_any_pose(model, angles, goal):
    model.move(np.array(angles))
    steps = run(model, Tracker(settings(goal=goal)), 20)
    for step in steps:
        assert step.result.command == pytest.approx(angles, abs=1e-8)
        assert step.activity is Activity.TRACKING
    tracker = Tracker(settings(goal=goal))
    tracker.aim(np.array([0.01, 0.0, 0.0]), normal_of(0.1, 0.1), 0.0)
    (first,) = run(model, tracker, 1)
    assert first.result.command == pytest.approx(angles, abs=1e-12)  # there was no time to move in


@pytest.mark.parametrize(
    "target", [[0, 0, 0.1], [0, 0, -0.1], [0.1, 0, 0], [-0.06, 0.08, 0.0], [0.02, 0.02, 0.02]]
)
def test_a_jump_out_of_reach_ends_at_rest_at_the_closest_pose(model, target):
    tracker = Tracker(settings(torque_max=np.inf))
    tracker.target = np.array(target, float)
    steps = run(model, tracker, 160)
    assert steps[1].activity is Activity.TRACKING
    assert any(name.endswith("speed") for name in steps[1].result.active_limits)
    assert steps[-1].activity is Activity.CLOSEST
    rest = np.array([step.result.command for step in steps[-20:]])
    assert np.ptp(rest, axis=0).max() < 1e-4
    assert steps[-1].error < np.linalg.norm(np.array(target) - [0, 0, -0.00825])


def test_all_angle_limits_active_at_once(model):
    tracker = Tracker(dataclasses.replace(settings(), angle_min=-1.6, angle_max=HIGH))
    tracker.target = np.array([0.0, 0.0, -0.05])
    last = run(model, tracker, 30)[-1]
    assert last.activity is Activity.CLOSEST
    assert set(last.result.active_limits) == {f"servo_{i} angle min" for i in range(3)}
    assert last.result.command.tolist() == [-1.6] * 3


@pytest.mark.parametrize("dead", ["servos", "effector", "all"])
def test_a_singular_compliance_moves_nothing_and_breaks_nothing(model, dead):
    state = model.state()
    W = np.array(state.W)
    rows = {"servos": slice(6, 9), "effector": slice(0, 6), "all": slice(0, 9)}[dead]
    W[rows], W[:, rows] = 0.0, 0.0
    tracker = Tracker(settings())
    tracker.target = np.array([0.005, 0.0, -0.006])
    for k in range(5):
        step = tracker.update(dataclasses.replace(state, W=W), k * DT)
        assert step.result.ok
        assert step.result.command == pytest.approx(WORKING, abs=1e-12)
    assert step.activity is Activity.CLOSEST


def test_a_target_that_is_not_a_number_is_refused_and_the_old_one_stays(model):
    tracker = Tracker(settings(goal=Goal.POSE))
    tracker.aim(np.array([0.002, 0.0, -0.007]), None, 0.0)
    for bad in (([np.nan, 0, 0], None), ([0, 0, np.inf], None), ([0, 0, 0], [0, np.nan, 1])):
        with pytest.raises(IkError, match=r"target|normal"):
            tracker.aim(*bad, 0.1)
    assert tracker.target.tolist() == [0.002, 0.0, -0.007]


def test_beyond_a_fold_the_command_comes_back_and_rests(model):
    """Targets above the highest pose of the branch: the angles may go on, the effector would sink again."""
    tracker = Tracker(dataclasses.replace(settings(torque_max=np.inf), angle_max=0.5))
    model.move(np.full(3, -0.5))
    tracker.target = model.state().equilibrium + np.array([0.0, 0.0, 0.02])
    command, steps = model.angles, []
    for k in range(150):
        steps.append(tracker.update(model.move(command), k * DT))
        command = steps[-1].result.command
    assert steps[-1].activity is Activity.CLOSEST
    assert np.abs(np.diff([s.result.command for s in steps[-20:]], axis=0)).max() < 1e-4
    tracker.target = np.array([0.0, 0.0, 0.0])
    for k in range(150, 300):
        command = tracker.update(model.move(command), k * DT).result.command
    assert command == pytest.approx(command[:1].repeat(3), abs=1e-4)
    assert model.state().equilibrium == pytest.approx([0, 0, 0], abs=1e-5)
    assert command.max() < -1.0  # on the branch that it began on
