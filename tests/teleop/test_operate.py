"""When the terminal commands, and when it must not."""

import math

import numpy as np
import pytest

from tests.messages import assert_names, raises_naming
from tripod_graph.command import CommandLimits
from tripod_graph.joint import Joint, JointError
from tripod_graph.mode import LEASE, NONE, RETURN, Decision, Mode
from tripod_graph.names import SERVOS, SLIDE, WORKING_POSE
from tripod_teleop.drive import Drive
from tripod_teleop.joints import STALE, JointWatch
from tripod_teleop.keys import KEYS, Act, Choose, Move
from tripod_teleop.operate import NO_JOINTS, TAKEOVER, Operator, Toss
from tripod_teleop.screen import angles_text, status_line

JOINTS = (-0.1, -0.2, -0.3, 0.02)
PARK = (0.0, 0.0, 0.0, 0.0)
UP, DOWN = Move(0, 1), Move(0, -1)


def operator() -> Operator:
    return Operator("/teleop#1", Drive(CommandLimits(), speed=0.5, hold=0.2, pose_time=3.0))


def driving(now: float = 0.0, stamp: float = 100.0) -> Operator:
    made = operator()
    assert made.act(Act.TELEOP, JOINTS, stamp, now) == Decision(Mode.TELEOP, "/teleop#1", stamp)
    return made


def test_it_says_nothing_until_a_key_asks() -> None:
    made = operator()
    assert not made.is_driving
    assert made.setpoint(JOINTS, 1.0) is None


def test_teleop_starts_where_the_joints_are_after_the_takeover() -> None:
    made = driving()
    assert made.setpoint(JOINTS, TAKEOVER / 2) is None
    for now in (TAKEOVER, 1.0, 100.0):  # it streams also while no key is down: silence would be loss
        assert made.setpoint(JOINTS, now) == pytest.approx(JOINTS)


def test_without_joint_angles_it_takes_no_control() -> None:
    made = operator()
    for intent in (Act.TELEOP, Act.WORK, Act.PARK, Act.CATCH, Act.THROW):
        assert made.act(intent, None, 100.0, 0.0) is None
        assert made.notice == NO_JOINTS
        assert not made.is_driving


def test_arrows_never_take_control() -> None:
    made = operator()
    assert made.act(UP, JOINTS, 100.0, 0.0) is None
    assert_names(made.notice, "press t")
    made.hear(Decision(Mode.TELEOP, "view", 100.0), 100.0, 0.0)
    assert made.act(UP, JOINTS, 101.0, 0.0) is None
    assert made.setpoint(JOINTS, 1.0) is None


def test_an_arrow_moves_its_servo_only() -> None:
    made = driving()
    made.setpoint(JOINTS, 1.0)
    assert made.act(UP, JOINTS, 101.0, 1.0) is None
    points = [made.setpoint(JOINTS, 1.0 + 0.05 * i) for i in range(1, 10)]
    assert points[-1] == pytest.approx([0.0, -0.2, -0.3, 0.02])
    assert made.notice == ""


def test_a_servo_that_a_key_brings_to_its_limit_is_named_once_for_each_arrival() -> None:
    made = operator()
    upper = float(made.drive.limits.upper[0])
    near = (upper - 0.01, *JOINTS[1:])
    made.act(Act.TELEOP, near, 100.0, 0.0)
    made.setpoint(near, 1.0)
    said = []
    for move, since in ((UP, 1.0), (DOWN, 2.0), (UP, 3.0)):
        for i in range(8):
            made.act(move, near, 101.0, since + 0.05 * i)
            made.setpoint(near, since + 0.05 * i + 0.02)
            said.append(made.notice)
    assert [bool(text) for text in said[8:16]] == [False] * 8
    arrivals = [text for text in said if text]
    assert len(arrivals) == 2
    assert_names(arrivals[0], "servo_0", f"{math.degrees(upper):.1f} degrees")


@pytest.mark.parametrize(("intent", "pose"), [(Act.WORK, WORKING_POSE), (Act.PARK, PARK)])
@pytest.mark.parametrize("before", [Mode.STOP, Mode.IK, Mode.TELEOP])
def test_a_pose_takes_control_and_is_reached(intent: Act, pose, before: Mode) -> None:
    made = operator()
    made.hear(Decision(before, "view", 100.0), 101.0, 0.0)
    assert made.act(intent, JOINTS, 101.0, 0.0) == Decision(Mode.TELEOP, "/teleop#1", 101.0)
    points = [made.setpoint(JOINTS, 0.05 * i) for i in range(80)]
    assert points[3] is None  # the former source falls silent first
    assert points[4] == pytest.approx(JOINTS)
    assert points[-1] == pytest.approx(pose)


@pytest.mark.parametrize(("intent", "angle"), [(Act.CATCH, -math.pi / 3), (Act.THROW, -math.pi / 4)])
def test_catch_and_throw_jump_and_leave_the_slide(intent: Act, angle: float) -> None:
    made = operator()
    decision = made.act(intent, JOINTS, 101.0, 0.0)
    assert decision == Decision(Mode.TELEOP, "/teleop#1", 101.0)  # they take control as other letters do
    assert made.setpoint(JOINTS, TAKEOVER / 2) is None
    for now in (TAKEOVER, 1.0, 2.0):
        assert made.setpoint(JOINTS, now) == pytest.approx([angle] * 3 + [0.02])
    assert made.drive.at_once
    made.act(Act.WORK, JOINTS, 102.0, 2.0)  # and away again, slowly
    assert not made.drive.at_once
    assert made.setpoint(JOINTS, 2.05) == pytest.approx([angle] * 3 + [0.02], abs=0.01)
    assert made.setpoint(JOINTS, 9.0) == pytest.approx(WORKING_POSE)


def test_a_jump_ends_a_motion_and_stays_within_the_limits() -> None:
    made = Operator(
        "teleop",
        Drive(CommandLimits(angle_min=-1.0), speed=0.5, hold=0.2, pose_time=3.0),
        Toss(catch=(-0.1, -0.5, -1.5), throw=(0.1, 0.2, 0.3)),
    )
    made.act(Act.PARK, JOINTS[:3], 100.0, 0.0)
    made.setpoint(JOINTS[:3], 1.0)
    made.act(Act.CATCH, JOINTS[:3], 101.0, 1.0)
    assert made.drive.motion == ""
    assert made.setpoint(JOINTS[:3], 1.05) == pytest.approx([-0.1, -0.5, -1.0])
    made.act(Act.THROW, JOINTS[:3], 102.0, 1.1)
    assert made.setpoint(JOINTS[:3], 1.15) == pytest.approx([0.1, 0.2, 0.3])
    made.act(UP, JOINTS[:3], 103.0, 1.2)
    assert not made.drive.at_once


def test_a_pose_while_driving_starts_from_the_set_point() -> None:
    made = driving()
    made.setpoint(JOINTS, 1.0)
    made.act(UP, JOINTS, 100.5, 1.0)
    for i in range(1, 8):
        last = made.setpoint(JOINTS, 1.0 + 0.05 * i)
    assert made.act(Act.WORK, JOINTS, 101.0, 1.35) is None  # control is ours already
    assert made.setpoint(JOINTS, 1.4) == pytest.approx(last, abs=0.002)


@pytest.mark.parametrize(("intent", "mode"), [(Act.STOP, Mode.STOP), (Act.IK, Mode.IK)])
def test_stop_and_ik_end_driving_at_once(intent: Act, mode: Mode) -> None:
    made = driving()
    made.act(Act.WORK, JOINTS, 100.5, 1.0)
    assert made.act(intent, None, 101.0, 1.5) == Decision(mode, "/teleop#1", 101.0)  # joints or none
    assert made.setpoint(JOINTS, 1.6) is None
    made.act(Act.TELEOP, JOINTS, 102.0, 2.0)
    assert made.setpoint(JOINTS, 3.0) == pytest.approx(JOINTS)  # the motion is forgotten


@pytest.mark.parametrize("stamp", [0.0, 50.0, 5000.0, 1e18, math.nan])
def test_its_stop_is_obeyed_whatever_was_heard_and_so_is_what_it_decides_then(stamp: float) -> None:
    made = operator()
    made.hear(Decision(Mode.IK, "another", stamp), 100.0, 0.0)
    made.act(Act.STOP, None, 100.0, 0.0)
    assert made.mode is Mode.STOP
    made.act(Act.TELEOP, JOINTS, 100.0, 0.0)
    assert made.is_driving


# other operators -------------------------------------------------------------------------------------------


def test_its_own_words_coming_back_change_nothing() -> None:
    made = driving()
    made.setpoint(JOINTS, 1.0)
    made.act(UP, JOINTS, 101.0, 1.0)
    made.hear(Decision(Mode.STOP, "/teleop#1", 99.0), 101.0, 1.0)  # late
    assert made.is_driving
    assert made.setpoint(JOINTS, 1.1)[0] == pytest.approx(-0.05)


@pytest.mark.parametrize("mode", list(Mode))
@pytest.mark.parametrize("stamp", [0.0, 100.5, 5000.0])
def test_the_word_of_another_ends_driving_and_its_own_is_withdrawn(mode: Mode, stamp: float) -> None:
    made = driving()
    made.hear(Decision(mode, "/teleop#2", stamp), 100.6, 0.6)  # a second terminal
    assert not made.is_driving
    assert (made.mode, made.decider) == (mode, "teleop")
    assert made.setpoint(JOINTS, 1.0) is None
    assert made.due(100.7, 0.7) == Decision(NONE, "/teleop#1", 100.7)
    assert made.due(100.9, 0.9) is None


@pytest.mark.parametrize("stamp", [99.0, math.nan])
def test_an_old_word_of_another_does_not_unless_it_is_stop(stamp: float) -> None:
    made = driving()
    made.hear(Decision(Mode.IK, "view", stamp), 100.1, 0.1)
    assert made.is_driving
    made.hear(Decision(Mode.STOP, "view", stamp), 100.1, 0.1)
    assert not made.is_driving


def test_an_unknown_mode_is_refused() -> None:
    made = driving()
    with raises_naming(ValueError, "control mode 9"):
        made.hear(Decision(9, "view", 200.0), 100.1, 0.1)
    assert made.is_driving


def test_it_repeats_what_it_decided_and_a_stop_once() -> None:
    made = driving()
    for k in range(1, 20):
        assert made.due(100.0 + 0.2 * k, 0.2 * k) == Decision(Mode.TELEOP, "/teleop#1", 100.0)
    made.act(Act.STOP, None, 104.0, 4.0)
    assert made.due(104.2, 4.2) is None


def test_held_up_for_long_it_has_lost_control_and_for_a_moment_it_starts_where_the_joints_are() -> None:
    made = driving()
    made.act(Act.WORK, JOINTS, 100.0, 0.0)
    assert made.setpoint(JOINTS, 1.0) is not None
    assert made.due(100.2 + LEASE, 0.2 + LEASE) is not None
    assert made.is_driving
    late = 0.3 + 2 * LEASE + RETURN
    assert made.due(100.0 + late, late) == Decision(NONE, "/teleop#1", 100.0 + late)
    assert not made.is_driving
    assert made.setpoint(JOINTS, late) is None


def test_after_a_gap_it_starts_from_where_the_joints_then_are() -> None:
    made = driving()
    made.act(Act.WORK, JOINTS, 100.5, 1.0)
    assert made.setpoint(JOINTS, 2.0) is not None
    assert made.setpoint(None, 3.0) is None
    assert made.notice == NO_JOINTS
    elsewhere = (-1.0, -1.0, -1.0, 0.0)
    assert made.setpoint(elsewhere, 4.0) == pytest.approx(elsewhere)
    assert made.setpoint(elsewhere, 5.0) == pytest.approx(elsewhere)  # the motion is over
    assert made.notice == ""


def test_a_slide_that_appears_is_taken_from_where_it_is() -> None:
    made = operator()
    made.act(Act.TELEOP, JOINTS[:3], 100.0, 0.0)
    assert made.setpoint(JOINTS[:3], 1.0).shape == (3,)
    assert made.setpoint(JOINTS, 1.1) == pytest.approx(JOINTS)


def test_a_digit_chooses_what_plus_and_minus_move_of_any_number_of_servos() -> None:
    made = Operator("teleop", Drive(CommandLimits(count=5), speed=0.5, hold=0.2, pose_time=3.0))
    joints = (-0.1, -0.2, -0.3, -0.4, -0.5, 0.02)
    made.act(Act.TELEOP, joints, 100.0, 0.0)
    made.setpoint(joints, 1.0)
    made.act(KEYS["4"], joints, 101.0, 1.0)
    assert made.chosen == 4
    assert_names(made.notice, "+", "-", "servo_4")
    made.act(KEYS["-"], joints, 101.0, 1.0)
    points = [made.setpoint(joints, 1.0 + 0.05 * i) for i in range(1, 10)]
    assert points[-1] == pytest.approx([-0.1, -0.2, -0.3, -0.4, -0.6, 0.02])
    made.act(Choose(5), joints, 102.0, 2.0)
    assert made.chosen == 4
    assert_names(made.notice, "no servo_5", "has 5")
    made.act(Act.WORK, joints, 103.0, 2.0)
    assert made.setpoint(joints, 12.0) == pytest.approx([-1.4965] * 5 + [0.035])
    made.act(Act.CATCH, joints, 104.0, 13.0)
    assert made.setpoint(joints, 13.1) == pytest.approx([-math.pi / 3] * 5 + [0.035])


def test_a_throw_of_another_number_of_angles_is_refused() -> None:
    drive = Drive(CommandLimits(count=4), speed=0.5, hold=0.2, pose_time=3.0)
    made = Operator("teleop", drive, Toss(catch=(-0.1, -0.2, -0.3)))
    made.act(Act.CATCH, (0.0,) * 4, 100.0, 0.0)
    assert_names(made.notice, "catch", "throw", "3 angles", "4 servos")
    assert made.setpoint((0.0,) * 4, 1.0) == pytest.approx([0.0] * 4)


def test_plus_without_a_servo_says_so() -> None:
    made = Operator("teleop", Drive(CommandLimits(count=2), speed=0.5, hold=0.2, pose_time=3.0))
    made.act(Act.TELEOP, (0.0, 0.0), 100.0, 0.0)
    made.act(KEYS["+"], (0.0, 0.0), 100.0, 0.5)
    assert_names(made.notice, "no servo_2", "has 2")


def test_a_simulator_and_a_driver_of_other_robots_are_no_place_to_start_from() -> None:
    watch = JointWatch()
    watch.hear_sim(("servo_0", "servo_1", "servo_2", "servo_3", SLIDE), (1.0, 2.0, 3.0, 4.0, 0.01), 10.0)
    assert (watch.servos, watch.joints(10.0)) == (4, (1.0, 2.0, 3.0, 4.0, 0.01))
    watch.hear_robot(SERVOS, (1.0, 2.0, 3.0), 10.0)
    assert watch.joints(10.0) is None
    assert_names(watch.trouble, "simulator", "4 servos", "driver 3")


# joint states ----------------------------------------------------------------------------------------------


def test_the_robot_counts_before_the_simulator_and_the_old_not_at_all() -> None:
    watch = JointWatch()
    assert watch.joints(0.0) is None
    watch.hear_sim((*SERVOS, SLIDE), (1.0, 2.0, 3.0, 0.01), 10.0)
    assert watch.joints(10.5) == (1.0, 2.0, 3.0, 0.01)
    watch.hear_robot((SERVOS[2], "other", SERVOS[0], SERVOS[1]), (6.0, math.nan, 4.0, 5.0), 10.5)
    assert watch.joints(10.6) == (4.0, 5.0, 6.0, 0.01)
    assert watch.joints(10.2 + STALE) == (4.0, 5.0, 6.0)
    assert watch.joints(10.6 + STALE) is None
    watch.hear_sim(SERVOS, (1.0, 2.0, 3.0), 20.0)
    assert watch.joints(20.0) == (1.0, 2.0, 3.0)


# the screen ------------------------------------------------------------------------------------------------


def columns(mode: Mode = Mode.TELEOP, **changes) -> list[str]:
    values = {"joints": JOINTS, "driving": True, "motion": "", "notice": "", **changes}
    return status_line(mode, "view", **values).split(" | ")


def test_the_status_line() -> None:
    who, where = columns()
    assert_names(who, "TELEOP", "these keys")
    angles, slide = where.split(",")
    assert angles.split() == ["-5.7", "-11.5", "-17.2", "deg"]
    assert_names(slide, "slide", "20.0 mm")
    assert_names(columns(driving=False)[0], "TELEOP", "view")
    _, motion, _ = columns(motion="working pose")
    assert_names(motion, "working pose")
    _, notice, _ = columns(motion="working pose", notice="x does nothing")
    assert notice == "x does nothing"
    assert_names(columns(joints=None)[-1], "angles", "unknown")
    who, where = columns(Mode.STOP, joints=None, driving=False)
    assert_names(who, "STOP", "hold")
    assert_names(where, "angles", "unknown")


def test_the_angles_keep_their_places() -> None:
    texts = [angles_text((a, -a, a, 0.001)) for a in np.linspace(-2.1, 0.6, 7)]
    assert {len(t) for t in texts} == {len(texts[0])}


# other joints -----------------------------------------------------------------------------------------------

TENDON, PUSH = Joint("tendon", "m", 0.0, 0.03, 0.03), Joint("push", "N", -1.0, 1.0, 0.1)


def test_keys_move_other_joints_by_a_share_of_their_range_up_to_the_limit() -> None:
    limits = CommandLimits(count=0, others=(TENDON, PUSH))
    made = Operator("teleop", Drive(limits, speed=0.5, hold=0.2, pose_time=3.0))
    start = (0.01, 0.0)
    made.act(Act.TELEOP, start, 100.0, 0.0)
    made.setpoint(start, 1.0)
    made.act(KEYS["+"], start, 101.0, 1.0)
    points = [made.setpoint(start, 1.0 + 0.05 * i) for i in range(1, 10)]
    assert points[-1] == pytest.approx([0.01 + 0.2 * 0.25 * 0.03, 0.0])
    made.act(KEYS["1"], start, 102.0, 2.0)
    assert_names(made.notice, "push")
    made.act(KEYS["-"], start, 102.0, 2.0)
    points = [made.setpoint(start, 2.0 + 0.05 * i) for i in range(1, 10)]
    assert points[-1] == pytest.approx([0.0115, -0.02])  # no faster than its slew rate
    for name, wrong in (
        ("5", ("joint 5", "2", "tendon, push")),
        ("Q", ("catch", "servos")),
        ("a", ("working pose",)),
    ):
        made.act(KEYS[name], start, 103.0, 3.0)
        assert_names(made.notice, *wrong)
    made.act(KEYS["0"], start, 104.0, 4.0)
    for i in range(200):
        made.act(KEYS["-"], start, 105.0 + 0.05 * i, 5.0 + 0.05 * i)
        points.append(made.setpoint(start, 5.0 + 0.05 * i, 0.05))
    assert points[-1][0] == 0.0
    assert min(p[0] for p in points) == 0.0
    made.act(Act.PARK, start, 120.0, 20.0)
    assert made.setpoint(start, 30.0) == pytest.approx([0.0, 0.0])


def test_the_command_of_an_effort_joint_is_its_effort() -> None:
    watch = JointWatch()
    watch.others = (TENDON, PUSH)
    watch.hear_sim(("tendon", "push"), (0.01, 0.5), 1.0, (3.0, -0.25))
    assert watch.joints(1.0) == (0.01, -0.25)
    with raises_naming(JointError, "'push'", "missing"):
        watch.hear_sim(("tendon",), (0.01,), 1.0, (3.0,))
    with raises_naming(JointError, "'push'", "nan"):
        watch.hear_sim(("tendon", "push"), (0.01, 0.5), 1.0, (3.0, math.nan))
