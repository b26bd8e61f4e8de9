"""Closing the loop: a robot that is not as its model, measured late."""

from collections import deque

import numpy as np
import pytest

from tests.scenes import SHARP
from tripod_host.rotations import rotation_matrix
from tripod_ik.errors import IkError
from tripod_ik.feedback import ModelError
from tripod_ik.model import StaticModel
from tripod_ik.rotation import normal_of, tilt_between
from tripod_ik.tracker import Activity, Tracker
from tripod_ik.tracker_settings import Goal, TrackerSettings
from tripod_sim import load_scene

WORKING = np.full(3, -1.4965)
UP = np.array([0.0, 0.0, 1.0])
DT, DELAY = 0.02, 0.03  # [s]
OFFSET = np.radians([2.0, -2.0, 2.0])  # of the servos


class WrongRobot:
    """A Tripod of 10 % stiffer silicone whose servos stand 2 degrees off, measured 30 ms late."""

    def __init__(self):
        self.model = StaticModel(load_scene(SHARP, ["mesh.level=1"]))
        self.robot = StaticModel(load_scene(SHARP, ["mesh.level=1", "material.young=275e3"]))
        self.start = self.model.save(), self.robot.save()

    def restore(self):
        self.model.restore(self.start[0])
        self.robot.restore(self.start[1])

    def run(self, tracker, target, seconds, measured="pose"):
        """Return what was measured, late: position, normal, one row a tick, and the steps of the tracker."""
        late = deque(maxlen=round(DELAY / DT) + 1)
        command, found, steps = WORKING, [], []
        for k in range(round(seconds / DT)):
            now = k * DT
            real = self.robot.move(command + OFFSET)
            late.append((real.equilibrium, real.equilibrium_rotation[:, 2]))
            found.append(np.concatenate(late[0]))
            if tracker.correction:
                p, n = late[0]
                tracker.correction.measure(p if measured == "pose" else None, n, now)
            if k == 5:
                tracker.aim(*target, now)
            steps.append(tracker.update(self.model.move(command), now))
            command = steps[-1].result.command
        return np.array(found), steps


@pytest.fixture(scope="module")
def shared():
    return WrongRobot()


@pytest.fixture
def wrong(shared):
    yield shared
    shared.restore()


def test_a_measured_position_takes_nine_tenths_of_the_static_error_away(wrong):
    target = wrong.model.state().equilibrium + np.array([0.004, -0.003, 0.003])
    errors = []
    for correction in (None, ModelError()):
        wrong.restore()
        found, steps = wrong.run(Tracker(TrackerSettings(), correction=correction), (target, None), 4.0)
        errors.append(np.linalg.norm(found[:, :3] - target, axis=1))
    assert errors[0][-1] > 4e-4
    assert errors[1][-1] < 0.01 * errors[0][-1]
    assert errors[1].max() < 1.2 * errors[1][0] + 1e-3  # no overshoot to speak of
    assert np.ptp([s.result.command for s in steps[-20:]], axis=0).max() < 1e-4
    assert steps[-1].activity is Activity.TRACKING


def test_a_measured_tilt_alone_takes_the_error_of_an_orientation_away(wrong):
    height = float(wrong.model.state().equilibrium[2])
    target, errors = (np.array([0, 0, height]), normal_of(0.1, -0.08)), []
    for correction in (None, ModelError()):
        wrong.restore()
        tracker = Tracker(TrackerSettings(goal=Goal.ORIENTATION), correction=correction)
        found, _ = wrong.run(tracker, target, 4.0, measured="imu")
        errors.append(np.array([np.linalg.norm(tilt_between(n, target[1])) for n in found[:, 3:]]))
    assert errors[0][-1] > 0.01
    assert errors[1][-1] < 0.01 * errors[0][-1]


@pytest.mark.parametrize("unknown", [0.0, 0.1, 0.2])
@pytest.mark.parametrize("gain", [0.6, 1.4])
def test_it_is_stable_with_a_delay_that_nobody_told_it_of(gain, unknown):
    """A robot that moves by `gain` times what its model says, off by 5 mm, `unknown` later than told [s]."""
    correction = ModelError(time=0.4, delay=0.03)
    target, history, y = np.array([0.01, 0.0, 0.0]), [], np.zeros(3)
    for k in range(600):
        now = k * 0.01
        correction.predict(y, UP, now)
        history.append(gain * y + np.array([0.005, 0.0, 0.0]))
        correction.measure(history[max(0, k - round((0.03 + unknown) / 0.01))], None, now)
        y = correction.corrected(target, UP)[0]
    assert history[-1] == pytest.approx(target, abs=1e-6)


def test_nothing_winds_up_while_the_target_is_out_of_reach():
    """The model can go to 10 mm only; the correction goes to the true error of 2 mm, not to the distance."""
    correction = ModelError()
    for k in range(1000):
        y = np.clip(correction.corrected(np.array([0.05, 0, 0]), UP)[0], -0.01, 0.01)
        correction.predict(y, UP, 0.01 * k)
        correction.measure(y + np.array([0.002, 0, 0]), None, 0.01 * k)
    assert correction.shift == pytest.approx([0.002, 0, 0], abs=1e-6)


def test_what_is_measured_is_compared_with_the_pose_of_its_time():
    """A robot like its model, late: nothing to correct, also on the move."""
    correction = ModelError(delay=0.03)
    path = [np.array([0.1 * 0.01 * k, 0, 0]) for k in range(200)]
    for k, y in enumerate(path):
        correction.predict(y, UP, 0.01 * k)
        correction.measure(path[max(0, k - 3)], UP, 0.01 * k)
    assert np.abs(correction.shift).max() < 1e-9
    assert np.abs(correction.tilt).max() < 1e-9


def test_corrections_are_bounded_and_a_gap_makes_no_leap():
    correction = ModelError(most_shift=0.01, most_tilt=0.1)
    tilted = rotation_matrix(np.array([0.5, 0, 0])) @ UP
    for k in range(500):
        correction.predict(np.zeros(3), UP, 0.01 * k)
        correction.measure(np.array([0.0, 0.5, 0.0]), tilted, 0.01 * k)
    assert correction.shift == pytest.approx([0, 0.01, 0])
    assert correction.tilt == pytest.approx([0.1, 0, 0])
    correction.reset()
    assert not correction.shift.any()
    for now in (0.0, 100.0):
        correction.predict(np.zeros(3), UP, now - 0.03)
        correction.measure(np.array([0.0, 0.005, 0.0]), None, now)
    assert 0 < correction.shift[1] < 0.3 * 0.005


def test_measurements_that_are_none_are_refused_and_change_nothing():
    correction = ModelError()
    correction.predict(np.zeros(3), UP, 0.0)
    for bad in ((np.array([0, np.nan, 0]), None), (None, np.zeros(3)), (None, np.array([0, 0, np.inf]))):
        with pytest.raises(IkError, match="measured"):
            correction.measure(*bad, 0.1)
    assert not correction.shift.any()
    for settings in ({"time": 0.0}, {"delay": -0.1}, {"delay": 2.0}, {"time": np.nan}):
        with pytest.raises(IkError, match=r"feedback (time|delay)"):
            ModelError(**settings)


def test_without_a_target_a_measurement_moves_nothing(wrong):
    tracker = Tracker(TrackerSettings(), correction=ModelError())
    command = WORKING
    for k in range(60):
        tracker.correction.measure(np.array([0.01, 0.0, 0.0]), UP, DT * k)
        command = tracker.update(wrong.model.move(command), DT * k).result.command
    assert command == pytest.approx(WORKING, abs=1e-9)
