"""When a trajectory begins, and velocities: obeyed or refused, never ignored."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.messages import raises_naming
from tripod_graph.command import (
    LATE,
    LONGEST_TRAJECTORY,
    Activity,
    CommandError,
    CommandFollower,
    CommandLimits,
)
from tripod_graph.names import SERVOS, SLIDE

LIMITS = CommandLimits()
TICK = 0.005


def standing(*joints: float) -> CommandFollower:
    follower = CommandFollower(LIMITS, joints or (-0.5, -0.5, -0.5, 0.0))
    follower.setpoint(0.0)
    return follower


def way(follower: CommandFollower, end: float, begin: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Return the times and the angles of servo 0 up to `end` [s]."""
    times = begin + TICK * np.arange(1, round((end - begin) / TICK) + 1)
    return times, np.array([follower.setpoint(t)[0] for t in times])


def test_one_that_begins_later_is_waited_for_in_place() -> None:
    follower = standing()
    follower.accept(SERVOS, [1.0], [[-1.0] * 3], 0.0, age=-2.0)
    times, angles = way(follower, 3.5)
    assert angles[times <= 2.0] == pytest.approx(-0.5)
    assert angles[times >= 3.0] == pytest.approx(-1.0)
    assert angles[times == 2.5] == pytest.approx(-0.75)
    assert follower.setpoint(3.0 + LIMITS.timeout + 0.01)[0] == pytest.approx(-1.0)
    assert follower.activity is Activity.HOLDING


def test_one_that_began_a_moment_ago_is_where_it_should_be_by_now() -> None:
    follower = standing()
    follower.accept(SERVOS, [1.0], [[-1.0] * 3], 0.0, age=0.4)
    times, angles = way(follower, 0.6)
    assert angles[-1] == pytest.approx(-1.0)
    assert (
        np.abs(np.diff(angles)).max() <= LIMITS.angle_speed * TICK + 1e-9
    )  # it catches up, it does not jump
    assert angles[times == 0.3] == pytest.approx(-0.85)


@pytest.mark.parametrize(
    ("age", "named"),
    [
        (LATE + 0.01, ("started", "0.510 s", "0.5 s")),
        (7200.0, ("started", "7200.000 s")),
        (math.nan, ("started", "nan s")),
        (-LONGEST_TRAJECTORY - 1, ("starts", "601 s", "600 s")),
        (-LONGEST_TRAJECTORY + 0.5, ("time", "point 0", "1 s", "0 to 0.5 s")),
    ],
)
def test_too_late_and_too_far_ahead_are_refused_and_move_nothing(age: float, named: tuple[str, ...]) -> None:
    follower = standing()
    with raises_naming(CommandError, *named):
        follower.accept(SERVOS, [1.0], [[-1.0] * 3], 0.0, age=age)
    assert follower.rejected == 1
    assert way(follower, 1.0)[1] == pytest.approx(-0.5)


def test_velocities_make_cubics() -> None:
    """At rest at both ends, the way between two points is 3 w^2 - 2 w^3; linearly it would be w."""
    follower = standing()
    follower.accept(SERVOS, [2.0], [[-1.5] * 3], 0.0, velocities=[[0.0] * 3])
    times, angles = way(follower, 2.0)
    w = times / 2.0
    assert angles == pytest.approx(-0.5 - (3 * w**2 - 2 * w**3), abs=1e-9)


def test_points_are_passed_with_their_velocities_and_the_next_begins_with_that() -> None:
    follower = standing()
    follower.accept(SERVOS, [1.0, 2.0], [[-0.8] * 3, [-1.4] * 3], 0.0, velocities=[[-0.5] * 3, [-0.6] * 3])
    _, before = way(follower, 1.0)
    assert (before[-1] - before[-2]) / TICK == pytest.approx(-0.5, abs=0.02)
    follower.accept(SERVOS, [1.0], [[-1.3] * 3], 1.0, velocities=[[0.0] * 3])
    assert (follower.setpoint(1.0 + TICK)[0] - before[-1]) / TICK == pytest.approx(-0.5, abs=0.02)
    assert way(follower, 2.0, 1.0 + TICK)[1][-1] == pytest.approx(-1.3)


@pytest.mark.parametrize(
    ("velocities", "named"),
    [
        ([[0.0] * 3], ("1 points", "of 2", "velocities", "or none")),
        ([[0.0] * 3, [0.0] * 2], ("point 1", "2 velocities", "3 joints")),
        ([[0.0] * 3, [0.0, 5.0, 0.0]], ("point 1", "velocity", "servo_1", "5 rad/s", "4 rad/s")),
        ([[math.nan] * 3, [0.0] * 3], ("point 0", "velocity", "servo_0", "nan rad/s")),
    ],
)
def test_velocities_that_cannot_be_kept_are_refused(velocities, named: tuple[str, ...]) -> None:
    follower = standing()
    with raises_naming(CommandError, *named):
        follower.accept(SERVOS, [1.0, 2.0], [[-1.0] * 3] * 2, 0.0, velocities=velocities)


values = st.tuples(*[st.floats(-2.1, 0.6)] * 3, st.floats(0.0, 0.04))
speeds = st.tuples(*[st.floats(-4.0, 4.0)] * 3, st.floats(-0.1, 0.1))
point = st.tuples(st.floats(0.0, 1.0), values, speeds)


@given(st.lists(point, min_size=1, max_size=5), st.floats(-1.0, LATE), st.booleans())
def test_limits_and_slew_rates_hold_for_any_trajectory(points, age, cubic) -> None:
    follower = standing()
    times = np.cumsum([t for t, _, _ in points])
    follower.accept(
        (*SERVOS, SLIDE),
        times,
        [p for _, p, _ in points],
        0.0,
        velocities=[v for _, _, v in points] if cubic else [],
        age=age,
    )
    last = follower.joints
    for k in range(1, 400):
        joints = follower.setpoint(0.02 * k)
        assert (joints >= LIMITS.lower).all()
        assert (joints <= LIMITS.upper).all()
        assert (np.abs(joints - last) <= LIMITS.speed * 0.02 + 1e-9).all()
        last = joints
    assert follower.activity is not Activity.ACTIVE or times[-1] - age > 7.0
