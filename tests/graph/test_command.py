"""The command follower: what it refuses, and limits, slew rate, hold and park for any input."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.messages import assert_names, raises_naming
from tripod_graph.command import Activity, CommandError, CommandFollower, CommandLimits
from tripod_graph.names import SERVOS, SLIDE

LIMITS = CommandLimits(park=(-0.2, -0.4, 0.1, 0.01))
ROUNDING = 1e-9  # far above what double precision loses, far below any angle that matters


def follow(follower: CommandFollower, start: float, end: float, dt: float = 0.01) -> np.ndarray:
    """Return the set-points from `start` to `end` [s], shape (n, 4)."""
    times = start + dt * np.arange(1, round((end - start) / dt) + 1)
    return np.array([follower.setpoint(t) for t in times])


def goto(follower: CommandFollower, joints: list[float], now: float, *, time: float = 0.0) -> None:
    follower.accept((*SERVOS, SLIDE)[: len(joints)], [time], [joints], now)


# refusals -------------------------------------------------------------------------------------------------

GOOD = [-0.5, -0.5, -0.5]


@pytest.mark.parametrize(
    ("names", "times", "positions", "wrong"),
    [
        (SERVOS, [0.0], [[math.nan, 0.0, 0.0]], ("point 0", "servo_0", "nan rad", "-2.1 to 0.6 rad")),
        (SERVOS, [0.0, 1.0], [GOOD, [0, 0, math.inf]], ("point 1", "servo_2", "inf rad", "-2.1 to 0.6 rad")),
        (SERVOS, [0.0], [[0.0, 0.7, 0.0]], ("point 0", "servo_1", "0.7 rad", "-2.1 to 0.6 rad")),
        (SERVOS, [0.0], [[0.0, -2.2, 0.0]], ("point 0", "servo_1", "-2.2 rad", "-2.1 to 0.6 rad")),
        ((*SERVOS, SLIDE), [0.0], [[*GOOD, 0.05]], ("point 0", "slide", "0.05 m", "0 to 0.04 m")),
        ((*SERVOS, SLIDE), [0.0], [[*GOOD, -0.01]], ("point 0", "slide", "-0.01 m", "0 to 0.04 m")),
        ((*SERVOS, "elbow"), [0.0], [[*GOOD, 0.0]], ("'elbow'", "servo_0, servo_1, servo_2")),
        (("servo_0", "servo_2"), [0.0], [[0.0, 0.0]], ("'servo_1'", "missing", "servo_0, servo_1, servo_2")),
        ((SLIDE,), [0.0], [[0.01]], ("'servo_0'", "missing")),
        ((), [0.0], [[]], ("'servo_0'", "missing")),
        ((*SERVOS, "servo_1"), [0.0], [[*GOOD, 0.0]], ("'servo_1'", "twice")),
        (SERVOS, [], [], ("0 points", "0 times", "at least one")),
        (SERVOS, [0.0, 1.0], [GOOD], ("1 points", "2 times")),
        (SERVOS, [0.0], [[0.0, 0.0]], ("point 0", "2 positions", "3 joints")),
        (SERVOS, [0.0, 1.0], [GOOD, [*GOOD, 0.0]], ("point 1", "4 positions", "3 joints")),
        (SERVOS, [-0.1], [GOOD], ("time", "point 0", "-0.1 s", "0 to 600 s")),
        (SERVOS, [0.0, 2.0, 1.5], [GOOD] * 3, ("time", "point 2", "1.5 s", "2 to 600 s")),
        (SERVOS, [601.0], [GOOD], ("time", "point 0", "601 s", "0 to 600 s")),
        (SERVOS, [math.nan], [GOOD], ("time", "point 0", "nan s")),
        (SERVOS, [0.0, math.inf], [GOOD] * 2, ("time", "point 1", "inf s")),
        (SERVOS, [0.0, math.nan, 1.0], [GOOD] * 3, ("time", "point 1", "nan s")),
    ],
)
def test_bad_trajectory_is_refused_by_name_value_and_range(
    names, times, positions, wrong: tuple[str, ...]
) -> None:
    follower = CommandFollower(LIMITS)
    goto(follower, [0.0, -0.3, -0.6], 0.0, time=1.0)
    twin = CommandFollower(LIMITS)
    goto(twin, [0.0, -0.3, -0.6], 0.0, time=1.0)
    follow(follower, 0.0, 0.5)
    with raises_naming(CommandError, *wrong):
        follower.accept(names, times, positions, 0.5)
    assert follower.rejected == 1
    assert_names(follower.last_rejection, *wrong)
    follow(twin, 0.0, 0.5)
    np.testing.assert_array_equal(follow(follower, 0.5, 1.2), follow(twin, 0.5, 1.2))  # motion goes on


def test_an_absurdly_long_joint_name_does_not_fill_the_status() -> None:
    follower = CommandFollower(LIMITS)
    with pytest.raises(CommandError):
        follower.accept(["x" * 100_000, *SERVOS], [0.0], [[0.0] * 4], 0.0)
    assert len(follower.last_rejection) < 200


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"angle_min": math.nan}, ("angle_min", "nan")),
        ({"park_after": math.inf}, ("park_after", "inf")),
        ({"angle_min": 0.6}, ("angle_min 0.6 rad", "angle_max 0.6 rad")),
        ({"angle_speed": 0.0}, ("angle_speed", 0.0, "positive")),
        ({"slide_speed": -1.0}, ("slide_speed", -1.0, "positive")),
        ({"timeout": 0.0}, ("timeout", 0.0, "positive")),
        ({"slide_max": -0.1}, ("slide_max", -0.1, "negative")),
        ({"park_after": -1.0}, ("park_after", -1.0, "negative")),
        ({"park": (0.0, 0.0, 1.0, 0.0)}, ("park", "servo_2", "1 rad", "-2.1 to 0.6 rad")),
        ({"park": (0.0, 0.0, 0.0)}, ("park", "3 values", 4, "servo_0, servo_1, servo_2, slide")),
    ],
)
def test_bad_limits_are_refused_by_name(change, named: tuple[object, ...]) -> None:
    with raises_naming(CommandError, *named):
        CommandLimits(**change)


def test_start_outside_the_limits_is_refused() -> None:
    with raises_naming(CommandError, "start", "servo_1", "-3 rad", "-2.1 to 0.6 rad"):
        CommandFollower(LIMITS, (0.0, -3.0, 0.0, 0.0))


# what a trajectory does -----------------------------------------------------------------------------------


def test_points_are_interpolated_from_where_the_joints_are() -> None:
    follower = CommandFollower(LIMITS, (0.0, 0.0, 0.0, 0.0))
    follower.setpoint(9.0)
    follower.accept(
        ("servo_2", "servo_0", "servo_1"), [1.0, 3.0], [[-0.3, -0.1, -0.2], [0.3, -0.1, 0.2]], 9.0
    )
    expected = {9.5: [-0.05, -0.1, -0.15, 0.0], 10.0: [-0.1, -0.2, -0.3, 0.0], 11.5: [-0.1, 0.1, 0.15, 0.0]}
    seen = {t: follower.setpoint(t) for t in np.round(np.arange(9.02, 12.0, 0.02), 2)}
    for t, joints in expected.items():
        np.testing.assert_allclose(seen[t], joints, atol=1e-12)


def test_a_jump_is_followed_at_the_slew_rate() -> None:
    follower = CommandFollower(LIMITS, (0.0, 0.0, 0.0, 0.0))
    follower.setpoint(0.0)
    goto(follower, [-1.0, 0.5, 0.0, 0.04], 0.0)
    after = follow(follower, 0.0, 0.1)[-1]  # 0.1 s at 4 rad/s and 0.1 m/s
    np.testing.assert_allclose(after, [-0.4, 0.4, 0.0, 0.01], atol=1e-12)
    np.testing.assert_allclose(follower.goal, [-1.0, 0.5, 0.0, 0.04], atol=1e-12)


def test_a_command_without_the_slide_leaves_it() -> None:
    follower = CommandFollower(LIMITS, (0.0, 0.0, 0.0, 0.03))
    goto(follower, [-0.1, -0.1, -0.1], 0.0)
    assert follow(follower, 0.0, 0.4)[-1] == pytest.approx([-0.1, -0.1, -0.1, 0.03])


def test_silence_holds_then_parks_all_joints_together() -> None:
    follower = CommandFollower(LIMITS, (0.0, 0.0, 0.0, 0.0))
    goto(follower, [-1.0, -1.0, -0.5, 0.02], 0.0, time=1.0)  # silent 0.5 s after the point at 1 s
    follow(follower, 0.0, 1.49)
    assert follower.activity is Activity.ACTIVE
    held = follow(follower, 1.5, 6.49)
    assert follower.activity is Activity.HOLDING
    np.testing.assert_allclose(held, np.tile([-1.0, -1.0, -0.5, 0.02], (len(held), 1)), atol=1e-12)
    parking = follow(follower, 6.49, 6.6)
    assert follower.activity is Activity.PARKED
    park = np.array(LIMITS.park)
    left = (parking - park) / ([-1.0, -1.0, -0.5, 0.02] - park)  # the same fraction of every joint's way
    assert 0.2 < left[-1, 0] < 0.9
    np.testing.assert_allclose(left, np.tile(left[:, :1], (1, 4)), atol=1e-9)
    np.testing.assert_allclose(follow(follower, 6.6, 7.5)[-1], park, atol=1e-12)


def test_the_activity_is_current_between_two_set_points() -> None:
    follower = CommandFollower(LIMITS)
    follower.setpoint(0.0)
    goto(follower, [-0.5, -0.5, -0.5], 0.0)
    assert follower.activity is Activity.ACTIVE
    follower.stop(0.0)
    assert follower.activity is Activity.HOLDING


def test_stop_holds_at_once_on_the_way_to_a_point_and_on_the_way_to_park() -> None:
    follower = CommandFollower(LIMITS, (0.0, 0.0, 0.0, 0.0))
    goto(follower, [-2.0, -2.0, -2.0], 0.0, time=2.0)
    moving = follow(follower, 0.0, 1.0)[-1]
    follower.stop(1.0)
    np.testing.assert_array_equal(follow(follower, 1.0, 5.9)[-1], moving)
    assert follower.activity is Activity.HOLDING
    parking = follow(follower, 5.9, 6.1)[-1]
    assert not np.allclose(parking, moving)
    assert not np.allclose(parking, LIMITS.park)
    follower.stop(6.1)
    np.testing.assert_array_equal(follow(follower, 6.1, 11.0)[-1], parking)
    np.testing.assert_allclose(follow(follower, 11.0, 13.0)[-1], LIMITS.park, atol=1e-12)


def test_a_command_after_the_park_is_followed_by_a_whole_hold() -> None:
    follower = CommandFollower(LIMITS)
    follower.setpoint(0.0)
    goto(follower, [-0.5, -0.5, -0.5], 20.0)
    held = follow(follower, 20.0, 25.49)[-1]  # silent at 20.5 s, held 5 s
    np.testing.assert_allclose(held[:3], [-0.5, -0.5, -0.5], atol=1e-12)
    assert follower.activity is Activity.HOLDING


def test_it_begins_parked_or_holds_where_it_starts() -> None:
    parked = CommandFollower(LIMITS)
    np.testing.assert_array_equal(parked.setpoint(100.0), LIMITS.park)
    assert parked.activity is Activity.PARKED
    elsewhere = CommandFollower(LIMITS, (-1.0, -1.0, -1.0, 0.0))
    np.testing.assert_array_equal(elsewhere.setpoint(100.0), [-1.0, -1.0, -1.0, 0.0])
    assert elsewhere.activity is Activity.HOLDING
    np.testing.assert_allclose(follow(elsewhere, 104.9, 107.0)[-1], LIMITS.park, atol=1e-12)


def test_a_stalled_caller_does_not_catch_up_in_one_jump() -> None:
    follower = CommandFollower(LIMITS, (0.0, 0.0, 0.0, 0.0), longest_step=0.05)
    follower.setpoint(0.0)
    goto(follower, [-2.0, -2.0, -2.0], 10.0)
    assert follower.setpoint(10.0) == pytest.approx([-0.2, -0.2, -0.2, 0.0])  # 0.05 s at 4 rad/s


def test_a_clock_that_goes_back_gains_no_time() -> None:
    follower = CommandFollower(LIMITS, (0.0, 0.0, 0.0, 0.0))
    goto(follower, [-2.0, -2.0, -2.0], 1.0)
    joints = [follower.setpoint(t) for t in (1.0, 0.5, 1.0, 1.01)]
    assert joints[-1] == pytest.approx([-0.04, -0.04, -0.04, 0.0])


# properties -----------------------------------------------------------------------------------------------

angle = st.floats(LIMITS.angle_min, LIMITS.angle_max)
point = st.tuples(angle, angle, angle, st.floats(0.0, LIMITS.slide_max))
wild = st.floats(allow_nan=True, allow_infinity=True, width=64)
trajectory = st.lists(st.tuples(st.floats(0.0, 2.0), point), min_size=1, max_size=5).map(
    lambda points: ([t for t, _ in sorted(points)], [list(p) for _, p in sorted(points)])
)
event = st.one_of(
    st.tuples(st.just("accept"), trajectory),
    st.tuples(st.just("garbage"), st.lists(st.lists(wild, max_size=5), max_size=3)),
    st.tuples(st.just("stop"), st.none()),
    st.tuples(st.just("wait"), st.floats(0.001, 1.0)),
)
limits = st.builds(
    CommandLimits,
    angle_speed=st.floats(0.01, 20.0),
    slide_speed=st.floats(0.001, 1.0),
    timeout=st.floats(0.01, 1.0),
    park_after=st.floats(0.0, 1.0),
    park=point,
)


@given(limits, st.none() | point, st.lists(event, max_size=12), st.floats(0.002, 0.3))
def test_limits_and_slew_rate_are_never_exceeded(bounds, start, events, dt: float) -> None:
    follower = CommandFollower(bounds, start)
    now, before = 5.0, follower.setpoint(5.0)

    def run(duration: float) -> None:
        nonlocal now, before
        for _ in range(math.ceil(duration / dt)):
            now += dt
            joints = follower.setpoint(now)
            assert (joints >= bounds.lower).all()
            assert (joints <= bounds.upper).all()
            assert (np.abs(joints - before) <= bounds.speed * dt + ROUNDING).all()
            before = joints

    for kind, value in events:
        if kind == "accept":
            follower.accept((*SERVOS, SLIDE), *value, now)
        elif kind == "garbage":
            try:
                follower.accept(
                    (*SERVOS, SLIDE)[: len(value[0]) if value else 4], [0.0] * len(value), value, now
                )
            except CommandError:
                np.testing.assert_array_equal(follower.joints, before)
        elif kind == "stop":
            follower.stop(now)
            rest = before
            run(dt)
            if bounds.park_after > 2 * dt:
                np.testing.assert_array_equal(before, rest)
        run(value if kind == "wait" else dt)


@given(limits, point, trajectory)
def test_every_trajectory_ends_in_hold_and_every_hold_in_park(bounds, start, points) -> None:
    follower = CommandFollower(bounds, start)
    follower.accept((*SERVOS, SLIDE), *points, 0.0)
    silent_at = points[0][-1] + bounds.timeout
    assert follower.setpoint(silent_at - 1e-6) is not None
    assert follower.activity is Activity.ACTIVE
    held = follower.setpoint(silent_at + 1e-6)
    parks_at = silent_at + 1e-6 + bounds.park_after
    if bounds.park_after > 1e-3:
        assert follower.activity is Activity.HOLDING
        np.testing.assert_array_equal(follower.setpoint(parks_at - 1e-4), held)
    way = np.abs(held - bounds.park) / bounds.speed
    ticks = min(math.ceil(way.max() / 0.1) + 2, 5000)  # 0.1 s is the longest step that counts
    for i in range(ticks):
        follower.setpoint(parks_at + 1e-3 + 0.1 * i)
    assert follower.activity is Activity.PARKED
    np.testing.assert_allclose(follower.joints, bounds.park, atol=1e-9)


def test_a_long_trajectory_is_checked_in_reasonable_time() -> None:
    follower = CommandFollower(replace(LIMITS, park=(0.0, 0.0, 0.0, 0.0)))
    points = [[-0.5, -0.5, -0.5]] * 20_000
    points[-1] = [-0.5, 9.0, -0.5]
    with raises_naming(CommandError, "point 19999", "servo_1", "9 rad"):
        follower.accept(SERVOS, [0.01 * i for i in range(20_000)], points, 0.0)
