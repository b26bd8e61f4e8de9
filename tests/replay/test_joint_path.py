"""A recorded motion: what of it the driver's range and speed allow."""

from dataclasses import replace

import numpy as np
import pytest

from tests.messages import raises_naming
from tripod_graph.joint import Joint
from tripod_graph.names import SERVOS
from tripod_play.errors import PlayError
from tripod_play.joint_path import SAFE_SHARE, SAFE_SPEED, JointPath, ramp_time

JOINTS = [Joint(name, "rad", -1.0, 0.5, 2.0) for name in SERVOS]
TIMES = np.linspace(0.0, 4.0, 401)


def swing(amplitude: float, servo: int = 1) -> JointPath:
    joints = np.zeros((len(TIMES), 4))
    joints[:, servo] = amplitude * np.sin(TIMES)
    return JointPath(TIMES, joints, 3)


def test_between_two_poses_joints_are_in_proportion() -> None:
    path = JointPath(np.array([1.0, 3.0]), np.array([[0.0, 1.0, 2.0], [4.0, 1.0, 0.0]]), 3)
    np.testing.assert_allclose(path.at(1.5), [1.0, 1.0, 1.5])
    np.testing.assert_allclose(path.at(9.0), [4.0, 1.0, 0.0])
    assert path.end == 3.0


def test_a_motion_within_range_and_speed_may_be_played_as_fast_as_the_servos_are() -> None:
    path = swing(0.4)
    path.check(JOINTS, start=0.0, rate=1.0)
    path.check(JOINTS, start=0.0, rate=5.0)
    remedy = ("1.15 times", "rate of 4.95")
    with raises_naming(PlayError, "servo_1", "2.28 rad/s", "3.10 s", "2.00 rad/s", *remedy):
        path.check(JOINTS, start=0.0, rate=5.7)


def test_an_angle_out_of_the_range_is_named_with_its_time_and_only_if_it_is_played() -> None:
    path = swing(0.6, servo=2)  # above 0.5 rad from 0.985 to 2.156 s
    with raises_naming(PlayError, "servo_2", "0.502 rad", "0.99 s", "-1.000 to 0.500 rad"):
        path.check(JOINTS, start=0.0, rate=1.0)
    path.check(JOINTS, start=2.2, rate=1.0)
    path.joints[-1, 2] = np.nan
    with raises_naming(PlayError, "servo_2", "nan rad", "4.00 s"):
        path.check(JOINTS, start=2.2, rate=1.0)


def test_a_start_behind_the_end_is_refused() -> None:
    with raises_naming(PlayError, "--start", "4 s", "ends at 4.00 s"):
        swing(0.1).check(JOINTS, start=4.0, rate=1.0)


def test_the_way_to_the_first_pose_is_slow_also_for_a_fast_driver() -> None:
    here, there = np.array([0.0, 0.0, 0.0]), np.array([0.1, -1.0, 0.2, 0.03])
    fast = [replace(joint, speed=50.0) for joint in JOINTS]
    assert ramp_time(here, there, fast) == pytest.approx(1.0 / SAFE_SPEED + 0.1)
    fast[1] = replace(fast[1], speed=0.1)
    assert ramp_time(here, there, fast) == pytest.approx(10.1)
    cable = [Joint("left", "m", 0.0, 0.03, 1.0)]
    assert ramp_time(np.zeros(1), np.array([0.02]), cable) == pytest.approx(0.02 / (0.03 * SAFE_SHARE) + 0.1)


def test_a_motion_of_cables_and_chambers_is_checked_in_their_units_and_by_their_names() -> None:
    joints = np.column_stack([0.01 * np.sin(TIMES / 2), 10e3 * np.sin(TIMES / 2) ** 2])
    path = JointPath(TIMES, joints, 0, ("left", "air"))
    air, left = Joint("air", "Pa", 0.0, 20e3, 20e3), Joint("left", "m", 0.0, 0.03, 0.03)
    assert path.check([air, left], start=0.0, rate=1.0) == (left, air)
    with raises_naming(PlayError, "left", "air", "servo_0"):
        path.check(JOINTS, start=0.0, rate=1.0)
    with raises_naming(PlayError, "air", "kPa", "0 kPa to 5 kPa"):
        path.check([left, replace(air, high=5e3)], start=0.0, rate=1.0)
    with raises_naming(PlayError, "left", "4.999 mm/s", "1 mm/s", "rate of 0.20"):
        path.check([replace(left, speed=1e-3), air], start=0.0, rate=1.0)
