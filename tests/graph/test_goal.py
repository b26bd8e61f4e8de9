"""How a trajectory that somebody waits for has ended: arrived, too far off, interrupted or replaced."""

import numpy as np
import pytest

from tests.messages import assert_names, raises_naming
from tripod_graph.command import CommandError, CommandFollower, CommandLimits
from tripod_graph.goal import GOAL_ANGLE, Outcome, judge, motion_of, tolerances
from tripod_graph.names import SERVOS

LIMITS = CommandLimits(timeout=0.5)
JOINTS = LIMITS.joints
END = 1.0


def follower() -> CommandFollower:
    one = CommandFollower(LIMITS, (0.0, 0.0, 0.0, 0.0))
    one.accept(SERVOS, [END], [[-0.5, -0.6, -0.7]], 0.0)
    return one


def judged(one: CommandFollower, now: float, off: float = 0.0, **asked):
    """Judge at `now` [s], the second servo `off` [rad] from the set-point."""
    mine = one.trajectory
    one.setpoint(now)
    actual = one.joints[:3] + np.array([0.0, off, 0.0])
    tolerance = tolerances(LIMITS.table, asked.get("path", {}), asked.get("goal", {}), asked.get("time", 0.0))
    return judge(motion_of(one, actual, now, "nobody"), tolerance, asked.get("mine", mine), END)


def run(one: CommandFollower, until: float) -> None:
    for k in range(round(until / 0.05)):
        one.setpoint(0.05 * k)


def test_it_goes_on_until_the_joints_have_arrived() -> None:
    one = follower()
    run(one, 0.9)
    assert judged(one, 0.9) is None
    assert judged(one, 1.0) == (Outcome.SUCCESSFUL, "")


def test_without_a_tolerance_the_way_is_free_and_the_end_is_not() -> None:
    one = follower()
    run(one, 0.5)
    assert judged(one, 0.5, off=0.4) is None
    run(one, 1.0)
    assert judged(one, 1.0, off=1.1 * GOAL_ANGLE) is None  # it may still arrive
    assert judged(one, 1.2, off=0.9 * GOAL_ANGLE) == (Outcome.SUCCESSFUL, "")
    ended = judged(one, 1.6, off=1.1 * GOAL_ANGLE)  # nobody waits any more: the joints hold
    assert ended[0] is Outcome.GOAL_TOLERANCE_VIOLATED
    assert_names(ended[1], "servo_1", "-0.5890 rad", "-0.6000", "goal_tolerance", "0.01 rad")


def test_it_ends_too_where_nobody_asks_for_set_points_as_while_a_simulator_is_paused() -> None:
    one = follower()
    here, given = one.joints[:3].copy(), tolerances(LIMITS.table, {}, {}, 0.0)
    assert judge(motion_of(one, here, END + 0.4, "nobody"), given, one.trajectory, END) is None
    ended = judge(motion_of(one, here, END + 0.6, "nobody"), given, one.trajectory, END)
    assert ended and ended[0] is Outcome.GOAL_TOLERANCE_VIOLATED


def test_tolerances_that_are_given_count() -> None:
    one = follower()
    run(one, 0.5)
    assert judged(one, 0.5, off=0.04, path={"servo_1": 0.05}) is None
    assert judged(one, 0.5, off=0.06, path={"servo_0": 0.05}) is None
    outcome, why = judged(one, 0.5, off=0.06, path={"servo_1": 0.05})
    assert outcome is Outcome.PATH_TOLERANCE_VIOLATED
    assert_names(why, "servo_1", "-0.2400 rad", "-0.3000", "path_tolerance", "0.05 rad")
    run(one, 1.1)
    assert judged(one, 1.1, off=0.1, goal={"servo_1": 0.2})[0] is Outcome.SUCCESSFUL
    assert judged(one, 1.1, off=9.0, goal={"servo_1": -1.0})[0] is Outcome.SUCCESSFUL
    assert judged(one, 1.1, off=0.1, time=0.2) is None
    assert judged(one, 1.25, off=0.1, time=0.2)[0] is Outcome.GOAL_TOLERANCE_VIOLATED


def test_an_unknown_angle_is_beyond_any_tolerance() -> None:
    one = follower()
    run(one, 0.5)
    assert judged(one, 0.5, off=np.nan, path={"servo_1": -1.0})[0] is Outcome.PATH_TOLERANCE_VIOLATED


def test_who_interrupts_it_is_told_and_who_replaces_it() -> None:
    one = follower()
    mine = one.trajectory
    one.stop(0.5)
    outcome, why = judged(one, 0.5, mine=mine)
    assert outcome is Outcome.INVALID_GOAL
    assert_names(why, "interrupted", "nobody")
    one.accept(SERVOS, [END], [[-0.5, -0.6, -0.7]], 0.5)
    outcome, why = judged(one, 0.6, mine=mine)
    assert outcome is Outcome.INVALID_GOAL
    assert_names(why, "another command")


@pytest.mark.parametrize(
    ("path", "goal", "named"),
    [
        ({"elbow": 0.1}, {}, ("path_tolerance", "'elbow'", "servo_0, servo_1, servo_2, slide")),
        ({}, {"elbow": 0.1}, ("goal_tolerance", "'elbow'")),
        ({}, {"slide": np.nan}, ("goal_tolerance", "slide", "nan", "any number")),
    ],
)
def test_tolerances_that_say_nothing_are_refused(path, goal, named: tuple[str, ...]) -> None:
    with raises_naming(CommandError, *named):
        tolerances(LIMITS.table, path, goal, 0.0)
