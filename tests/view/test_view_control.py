"""Who commands, what the page sends, and when it is silent: the rules of `Control` and of its motions by table."""

import math

import numpy as np
import pytest

from tests.messages import assert_names, raises_naming
from tripod_graph.command import CommandFollower, CommandLimits
from tripod_graph.joint import Joint
from tripod_graph.mode import Decision, Mode
from tripod_graph.names import SERVOS, SLIDE, WORKING_POSE
from tripod_view.control import PERIOD, STALE, TAKEOVER, Control
from tripod_view.messages import trajectory_message
from tripod_view.motion import PEAK, motion

PARKED = np.zeros(4)
BENT = np.array([-0.3, -0.4, -0.5, 0.01])


def control() -> Control:
    return Control("/view#1", CommandLimits(), speed=0.4)


def in_teleop(joints: np.ndarray = BENT) -> Control:
    """Return a page that took control at time 0."""
    c = control()
    c.measure(joints, 0.0)
    assert c.decide(Mode.TELEOP, 100.0, 0.0) == Decision(Mode.TELEOP, "/view#1", 100.0)
    return c


@pytest.mark.parametrize(
    ("heard", "streaming", "in_control"),
    [
        ((), True, True),
        ((("teleop", Mode.TELEOP, 101.0),), False, False),
        ((("view", Mode.STOP, 101.0),), False, False),
        ((("view", Mode.IK, 101.0),), False, False),  # another page
        ((("ik", Mode.IK, 101.0),), False, False),
        ((("teleop", Mode.IK, 99.0),), True, True),  # an older decision, heard late
        ((("teleop", Mode.STOP, 99.0),), False, False),  # STOP is obeyed all the same
        ((("teleop", Mode.STOP, 101.0), ("/view#1", Mode.TELEOP, 100.0)), False, False),  # the own echo, late
    ],
)
def test_the_decision_in_force_says_who_commands(heard: tuple, streaming: bool, in_control: bool) -> None:
    c = in_teleop()
    for source, mode, stamp in heard:
        c.hear(Decision(int(mode), source, stamp), 101.0, 0.9)
    assert (c.streaming, c.in_control) == (streaming, in_control)
    c.measure(BENT, 1.0)
    assert (c.command(1.0) is not None) == streaming


def test_the_target_is_not_followed_from_half_a_motion() -> None:
    """On the way the body may be bent so that inverse kinematics folds it to the wrong side."""
    c = in_teleop()
    assert c.go("working pose", WORKING_POSE, 0.1)
    assert c.decide(Mode.IK, 100.5, 0.2) is None
    assert_names(c.notice, "working pose")
    assert c.streaming and c.moving == "working pose"
    assert c.decide(Mode.STOP, 100.6, 0.3) == Decision(Mode.STOP, "/view#1", 100.6)
    assert not c.moving
    assert c.decide(Mode.IK, 100.7, 0.4) == Decision(Mode.IK, "/view#1", 100.7)


def test_an_unknown_mode_is_refused_and_changes_nothing() -> None:
    c = in_teleop()
    with raises_naming(ValueError, "control mode 9", "unknown"):
        c.hear(Decision(9, "x", 200.0), 100.1, 0.1)
    assert c.streaming


def test_control_is_not_taken_while_the_joints_are_unknown() -> None:
    c = control()
    assert c.decide(Mode.TELEOP, 100.0, 0.0) is None
    assert_names(c.notice, "joint angles", "simulator", "driver")
    c.measure(BENT, 0.0)
    assert c.decide(Mode.TELEOP, 100.0, STALE + 0.01) is None
    assert c.decide(Mode.STOP, 100.0, STALE + 0.01) is not None  # never refused
    assert c.notice == ""


@pytest.mark.parametrize("stamp", [0.0, 5000.0, float(2**31 - 1) + 0.5])
def test_a_decision_overrules_one_from_a_clock_ahead(stamp: float) -> None:
    c = control()
    c.measure(BENT, 0.0)
    c.hear(Decision(Mode.IK, "other", stamp), 100.0, 0.0)
    c.decide(Mode.STOP, 100.1, 0.1)
    assert c.authority.mode is Mode.STOP
    c.hear(Decision(Mode.IK, "other", stamp), 100.2, 0.2)  # it has not heard of it yet
    assert c.authority.mode is Mode.STOP
    c.decide(Mode.TELEOP, 100.3, 0.3)
    assert c.streaming


def test_commands_begin_after_the_takeover_where_the_joints_are() -> None:
    c = in_teleop()
    assert c.command(TAKEOVER - 0.01) is None
    first = c.command(TAKEOVER)
    assert first is not None
    assert first.names == SERVOS  # the slide stays where it is
    assert first.times.tolist() == [PERIOD]
    assert first.positions == pytest.approx(BENT[None, :3])


@pytest.mark.parametrize(
    ("asked", "taken"), [(-0.7, -0.7), (5.0, 0.6), (-50.0, -2.1), (np.nan, -0.4), (np.inf, -0.4)]
)
def test_slider_input_is_checked_and_clamped(asked: float, taken: float) -> None:
    c = in_teleop()
    c.synced = False
    assert c.set_angle(1, asked) == np.isfinite(asked)
    assert c.angles == pytest.approx([-0.3, taken, -0.5])
    assert c.synced == (asked != taken)  # the slider on the screen is put right
    c.measure(BENT, 0.5)
    assert c.angles[1] == pytest.approx(taken)  # in control the sliders do not follow


def test_sliders_follow_the_joints_and_take_nothing_without_control() -> None:
    c = control()
    c.measure(BENT, 0.0)
    assert c.angles == pytest.approx(BENT[:3])
    assert not c.set_angle(0, 0.2)
    assert c.angles == pytest.approx(BENT[:3])
    c.measure(2 * BENT, 0.1)
    assert c.angles == pytest.approx(2 * BENT[:3])


def test_silence_of_the_joints_stops_the_commands_and_the_sliders_start_anew_from_where_they_are() -> None:
    c = in_teleop()
    c.set_angle(0, -1.0)
    assert c.command(STALE) is not None
    assert c.command(STALE + 0.1) is None
    c.measure(PARKED, 5.0)  # the simulator came back, parked
    again = c.command(5.0)
    assert again is not None
    assert again.positions == pytest.approx(np.zeros((1, 3)))


def test_a_motion_goes_out_once_then_the_sliders_hold_where_it_ended() -> None:
    c = in_teleop(PARKED)
    assert c.go("working pose", WORKING_POSE, 0.1)
    assert c.command(0.1) is None  # the takeover
    path = c.command(0.2)
    assert path is not None
    assert path.names == (*SERVOS, SLIDE)
    assert path.positions[-1] == pytest.approx(WORKING_POSE)
    for now in (0.3, 1.0, 3.0):
        c.measure(PARKED, now)
        assert c.command(now) is None
    end = 0.2 + path.times[-1] + 3 * PERIOD
    c.measure(np.array(WORKING_POSE), end)
    assert c.angles == pytest.approx(WORKING_POSE[:3])  # the sliders show the motion
    hold = c.command(end)
    assert hold is not None
    assert hold.positions == pytest.approx(np.array([WORKING_POSE]))
    assert (c.moving, c.notice) == ("", "")


def test_a_motion_that_did_not_arrive_is_reported_and_nothing_jumps() -> None:
    c = in_teleop(PARKED)
    c.go("working pose", WORKING_POSE, 0.1)
    path = c.command(0.2)
    assert path is not None
    for now in np.arange(0.3, 0.2 + path.times[-1], 0.5):
        c.measure(PARKED, now)  # the path was lost
        assert c.command(now) is None
    c.measure(PARKED, now + 1.0)
    hold = c.command(now + 1.0)
    assert hold is not None
    assert hold.positions == pytest.approx(np.zeros((1, 3)))
    assert_names(c.notice, "not reach", "working pose")


@pytest.mark.parametrize("speed", [1.0, 0.5, 0.1])
def test_a_motion_arrives_however_slow_the_simulation_is(speed: float) -> None:
    c, follower = in_teleop(PARKED), CommandFollower(CommandLimits())
    assert c.go("working pose", WORKING_POSE, 0.1)
    for k in range(1, 6000):
        now = k * PERIOD
        c.measure(follower.setpoint(speed * now), now)
        if (path := c.command(now)) is not None:
            follower.accept(path.names, path.times, path.positions, speed * now)
        if now > 1.0 and not c.moving:
            break
    assert (c.moving, c.notice) == ("", "")
    assert follower.end == pytest.approx(WORKING_POSE)


def test_a_pause_on_the_way_is_no_end_of_a_motion() -> None:
    c = in_teleop(PARKED)
    c.go("working pose", WORKING_POSE, 0.2)
    assert c.command(0.2) is not None
    c.measure(BENT, 1.0)
    assert c.command(1.0) is None
    c.measure(BENT, 60.0)
    assert c.command(60.0) is None
    assert c.moving == "working pose"


def test_after_a_restart_the_start_of_the_scene_is_commanded() -> None:
    c = in_teleop(BENT)
    c.set_angle(1, -1.0)
    start = np.array([-0.1, -0.2, 9.0, 0.02])  # one is beyond the limits
    c.restart(start[:3])
    assert c.angles[1] == -1.0  # of other joints
    c.restart(start)
    c.measure(BENT, 0.3)  # on its way when the simulation restarted
    told = c.command(0.3)
    assert told is not None
    assert told.names == (*SERVOS, SLIDE)
    assert told.positions == pytest.approx(np.array([[-0.1, -0.2, 0.6, 0.02]]))
    c.decide(Mode.STOP, 101.0, 0.4)
    c.measure(BENT, 0.4)
    c.restart(start)
    assert c.angles == pytest.approx(BENT[:3])


@pytest.mark.parametrize("end", ["slider", "stop", "others"])
def test_a_motion_ends_when_a_slider_is_touched_or_control_is_lost(end: str) -> None:
    c = in_teleop(PARKED)
    c.go("working pose", WORKING_POSE, 0.2)
    assert c.command(0.2) is not None
    c.measure(BENT, 1.0)
    if end == "slider":
        assert c.set_angle(2, -0.6)
        now = c.command(1.0)
        assert now is not None
        assert now.positions == pytest.approx(np.array([[-0.3, -0.4, -0.6]]))
    elif end == "stop":
        c.decide(Mode.STOP, 101.0, 1.0)
        assert c.command(1.0) is None
    else:
        c.hear(Decision(Mode.TELEOP, "teleop", 101.0), 101.0, 1.0)
        assert c.command(1.0) is None
    assert c.moving == ""


@pytest.mark.parametrize(
    ("goal", "named"), [((-3.0, 0, 0, 0), ("servo_0", "-3 rad")), ((0, 0, 0, 0.05), ("slide", "0.05 m"))]
)
def test_a_goal_outside_the_limits_is_refused_by_name(goal: tuple, named: tuple[str, ...]) -> None:
    c = in_teleop()
    assert not c.go("working pose", goal, 0.5)
    assert_names(c.notice, "limits", *named)
    assert c.moving == ""


def test_without_control_no_motion_begins() -> None:
    c = control()
    c.measure(PARKED, 0.0)
    assert not c.go("working pose", WORKING_POSE, 0.0)
    assert c.moving == ""


def test_a_motion_is_slow_at_both_ends_and_keeps_the_joints_in_proportion() -> None:
    path = motion(BENT, WORKING_POSE, 0.4, CommandLimits().table)
    assert path.times[-1] == pytest.approx((1.4965 - 0.3) / 0.4)
    share = (path.positions - BENT) / (np.array(WORKING_POSE) - BENT)
    assert share == pytest.approx(np.tile(share[:, :1], 4))
    speed = np.diff(path.positions[:, 0], prepend=BENT[0]) / np.diff(path.times, prepend=0.0)
    assert abs(speed[0]) < 0.01 * 0.4 * PEAK * 3
    assert abs(speed[-1]) < 0.01 * 0.4 * PEAK * 3
    assert np.abs(speed).max() == pytest.approx(0.4 * PEAK, rel=0.01)


def test_a_motion_of_the_slide_alone_and_none_at_all_still_take_time() -> None:
    assert motion(PARKED, (0, 0, 0, 0.035), 0.4, CommandLimits().table).times[-1] == pytest.approx(3.5)
    assert motion(PARKED, PARKED, 0.4, CommandLimits().table).times[-1] == pytest.approx(0.5)


def test_a_follower_keeps_up_with_the_motion_to_the_working_pose() -> None:
    limits = CommandLimits()
    follower = CommandFollower(limits)
    path = motion(PARKED, WORKING_POSE, 0.4, CommandLimits().table)
    follower.setpoint(0.0)
    follower.accept(path.names, path.times, path.positions, 0.0)
    worst = 0.0
    for now in np.arange(0.01, path.times[-1], 0.01):
        u = now / path.times[-1]
        ideal = np.array(WORKING_POSE) * u**3 * (10 - 15 * u + 6 * u**2)
        worst = max(worst, np.abs(follower.setpoint(now) - ideal)[:3].max())
    # Chords of 24 points differ from the curve by at most h^2 / 8 max|q''|, with max|s''| = 5.78.
    assert worst < 1.4965 * 5.78 / (8 * 24**2) + 1e-9
    assert follower.setpoint(path.times[-1]) == pytest.approx(WORKING_POSE)


def test_slow_servos_get_a_slower_motion() -> None:
    c = Control("view", CommandLimits(angle_speed=0.3), speed=0.4)
    c.measure(PARKED, 0.0)
    c.decide(Mode.TELEOP, 100.0, 0.0)
    c.go("working pose", WORKING_POSE, 0.2)
    path = c.command(0.2)
    assert path is not None
    speed = np.diff(path.positions[:, 0], prepend=0.0) / np.diff(path.times, prepend=0.0)
    assert np.abs(speed).max() <= 0.3


TENDON, PUSH = Joint("tendon", "m", 0.0, 0.03, 0.03), Joint("push", "Pa", 0.0, 30e3, 30e3)


def test_a_slider_in_millimetres_moves_a_cable_and_parks_it_slowly() -> None:
    c = Control("/view#1", CommandLimits(count=0, others=(TENDON, PUSH)), speed=0.4)
    c.measure(np.array([0.01, 5e3, 0.0]), 0.0)
    c.decide(Mode.TELEOP, 100.0, 0.0)
    assert c.set_shown(0, 12.5)
    assert c.set_shown(1, 20.0)
    sent = c.command(0.9)
    assert sent
    message = trajectory_message(sent, "me")
    assert list(message.joint_names) == ["tendon", "push"]
    assert message.points[0].positions.tolist() == pytest.approx([0.0125, 0.0])
    assert message.points[0].effort.tolist() == pytest.approx([0.0, 20e3])
    assert c.set_shown(0, 40.0)
    assert c.angles[0] == 0.03
    assert_names(c.notice, "tendon", "40 mm", "30 mm")
    assert not c.set_shown(0, math.nan)
    assert not c.set_shown(2, 1.0)
    c.measure(np.array([0.03, 0.0, 0.0]), 1.0)
    assert c.go("park pose", c.limits.park, 1.0)
    path = c.command(1.0)
    assert path
    assert path.names == ("tendon", "push")
    speed = np.abs(np.diff(path.positions[:, 0])) / np.diff(path.times)
    assert speed.max() <= 0.03 + 1e-9
    assert path.positions[-1].tolist() == [0.0, 0.0]
