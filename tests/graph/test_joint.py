"""Joints other than servos: their limits, the driver's range, goals, and their part of a status message."""

from dataclasses import replace

import numpy as np
import pytest

from tests.messages import assert_names, raises_naming
from tripod_graph.command import CommandError, CommandFollower, CommandLimits
from tripod_graph.goal import motion_of, tolerances
from tripod_graph.joint import Joint, JointError, joint_values, joints_told
from tripod_graph.limits import LIMIT_PARAMETERS, limits_from
from tripod_graph.range import RangeWatch, cut
from tripod_graph.trajectory import point_of

TENDON = Joint("tendon", "m", 0.0, 0.03, 0.03)
AIR = Joint("air", "Pa", 1e3, 30e3, 30e3)
LIMITS = CommandLimits(others=(TENDON, AIR))
NAMES = ("servo_0", "servo_1", "servo_2", "tendon", "air", "slide")


def test_arrays_have_servos_others_and_the_slide() -> None:
    assert LIMITS.joints == NAMES
    assert LIMITS.lower.tolist() == [-2.1] * 3 + [0.0, 1e3, 0.0]
    assert LIMITS.speed.tolist() == [4.0] * 3 + [0.03, 30e3, 0.1]
    assert LIMITS.park == (0.0, 0.0, 0.0, 0.0, 1e3, 0.0)  # the nearest to 0 within the range
    assert CommandLimits().joints == (*NAMES[:3], "slide")
    values = {p.name: p.default for p in LIMIT_PARAMETERS} | {"range_time": 0.5}
    assert limits_from(values, 3, (TENDON, AIR)).others == (
        replace(TENDON, speed=0.06),
        replace(AIR, speed=58e3),
    )


def test_the_drivers_range_narrows_joints_by_name() -> None:
    watch = RangeWatch(LIMITS)
    assert watch.hear([-1.0] * 3, [0.5] * 3, [2.0] * 3, 0.0, NAMES[:3])
    assert watch.limits.upper.tolist() == [0.5] * 3 + [0.03, 30e3, 0.04]
    lower, upper, speed = [-1.0] * 3 + [0.01, 0.0], [0.5] * 3 + [0.02, 20e3], [2.0] * 3 + [0.01, 1e3]
    assert watch.hear(lower, upper, speed, 0.0, NAMES[:5])
    assert watch.limits.table[3] == Joint("tendon", "m", 0.01, 0.02, 0.01)
    assert watch.limits.table[4] == Joint("air", "Pa", 1e3, 20e3, 1e3)
    assert watch.limits.park == (0.0, 0.0, 0.0, 0.01, 1e3, 0.0)
    upper[3] = -1.0
    watch.hear(lower, upper, speed, 0.0, NAMES[:5])
    assert_names(watch.notice, "tendon", "0.01 to -1 m", "0 to 0.03 m")


def test_set_points_keep_to_the_slew_rate_of_each_joint() -> None:
    follower = CommandFollower(LIMITS)
    efforts = [[np.nan, 0.0, 0.0, 0.0, 30e3]]
    follower.accept(NAMES[:5], [0.0], [[-0.5, -0.5, -0.5, 0.03, np.nan]], 0.0, efforts=efforts)
    way = np.array([follower.setpoint(0.01 * i) for i in range(40)])
    steps = np.abs(np.diff(way, axis=0)).max(axis=0) / 0.01
    assert steps[:5] == pytest.approx([4.0] * 3 + [0.03, 30e3])
    assert way[-1][3:5] == pytest.approx([0.03 * 0.39, 1e3 + 30e3 * 0.39])
    follower.stop(0.39)
    assert follower.setpoint(0.5)[3:5] == pytest.approx(way[-1][3:5])
    parked = [follower.setpoint(0.5 + 0.1 * i) for i in range(100)][-1]
    assert parked.tolist() == list(LIMITS.park)


def test_velocities_are_refused_beside_an_effort() -> None:
    follower = CommandFollower(LIMITS)
    with raises_naming(CommandError, "velocities", "air", "leave them out"):
        follower.accept(
            NAMES[:5], [1.0], [[0.0] * 5], 0.0, velocities=[[0.0] * 5], efforts=[[0.0] * 4 + [2e3]]
        )


def test_goals_have_a_share_of_the_range_as_tolerance_and_points_have_efforts() -> None:
    found = tolerances(LIMITS.table, {"air": 100.0}, {}, 0.0)
    assert found.goal.tolist() == pytest.approx([0.01] * 3 + [0.00015, 145.0, 1e-4])
    assert found.path[4] == 100.0
    motion = motion_of(CommandFollower(LIMITS), [0.0] * 6, 0.0, "")
    point = point_of([0.1, 0.2, 0.3, 0.01, 2e3], motion.joints[:5])
    assert point.positions.tolist() == [0.1, 0.2, 0.3, 0.01, 0.0]
    assert point.effort.tolist() == [0.0, 0.0, 0.0, 0.0, 2e3]
    assert not point_of([0.1], LIMITS.table[:1]).effort


def test_a_status_tells_the_joints_or_nothing() -> None:
    told = (["servo_0", "tendon"], ["rad", "m"], [-2.0, 0.0], [0.5, 0.03], [4.0, 0.03])
    assert joints_told(*told) == (TENDON,)
    assert joints_told(*told[:4], [4.0]) == ()
    assert joints_told(*told[:2], [-2.0, np.nan], *told[3:]) == ()
    joints = np.array([0.0, 0.0, 0.0, 0.05, 2e3, 0.0])
    assert_names(cut(joints, LIMITS), "tendon", "0.050 m", "0.000 to 0.030 m")


def test_joint_states_come_in_any_order_and_the_slide_may_miss() -> None:
    assert joint_values(["servo_2", "other", "servo_0", "servo_1"], [3.0, 9.0, 1.0, 2.0]) == (1.0, 2.0, 3.0)
    assert joint_values(["slide", "servo_0"], [0.02, 1.0]) == (1.0, 0.02)
    names, positions, efforts = ["air", "tendon", "slide"], [1e-5, 0.01, 0.02], [2e3, 4.0, 0.0]
    assert joint_values(names, positions, efforts, (TENDON, AIR)) == (0.01, 2e3, 0.02)


@pytest.mark.parametrize(
    ("names", "positions", "others", "named"),
    [
        (["servo_0", "servo_2"], [0.0, 0.0], (), ("'servo_1'", "missing", "servo_0, servo_2")),
        (["slide"], [0.0], (), ("'servo_0'", "missing", "joints: slide")),
        (["servo_0", "servo_1", "servo_2"], [0.0], (), ("1 positions", "3 joints")),
        (["servo_0", "servo_1"], [0.0, float("nan")], (), ("'servo_1'", "nan")),
        (["servo_0", "slide"], [0.0, float("inf")], (), ("'slide'", "inf")),
        ([], [], (), ("'servo_0'", "missing", "none")),
        (["air"], [1e-5], (AIR,), ("'air'", "missing")),  # its effort
    ],
)
def test_joint_states_that_are_refused(names, positions, others, named: tuple[str, ...]) -> None:
    with raises_naming(JointError, *named):
        joint_values(names, positions, (), others)
