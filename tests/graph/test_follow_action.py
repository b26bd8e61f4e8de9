"""The action `follow_joint_trajectory`: followed, refused, cancelled, preempted, interrupted, missed; one line each."""

import re
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

pytest.importorskip("control_msgs", reason="the interfaces are not built: run `make setup`")

from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Duration
from control_msgs.action import FollowJointTrajectory
from control_msgs.msg import JointComponentTolerance, JointTolerance
from rclpy.node import Node
from trajectory_msgs.msg import MultiDOFJointTrajectoryPoint

from tests.goals import Goals
from tests.goals import goal as goal_of
from tests.graph.bench import Bench
from tests.messages import assert_names
from tripod_graph.command import Activity, CommandFollower, CommandLimits
from tripod_graph.control_mode import clocks
from tripod_graph.follow_action import FollowAction
from tripod_graph.goal import Motion, motion_of
from tripod_graph.mode import LONGEST_LEASE, Decision, Mode, ModeTracker
from tripod_graph.names import SERVOS
from tripod_graph.trajectory import Command

pytestmark = pytest.mark.ros

Goal, Result = FollowJointTrajectory.Goal, FollowJointTrajectory.Result
SOURCE = "/operator"
START = (-0.1, -0.1, -0.1, 0.0)
THERE = (-0.4, -0.5, -0.6)


class Robot(Node):
    """A node that follows, as simulator and driver do, and whose joints may be held by a hand."""

    def __init__(self, context: Any) -> None:
        super().__init__("robot", context=context)
        self.follower = CommandFollower(CommandLimits(timeout=20.0, park_after=60.0), START)
        self.authority, self.refused = ModeTracker(), list[str]()
        self.held: float | None = None
        self.decide(Mode.TELEOP)
        self.action = FollowAction(
            self, "robot/follow_joint_trajectory", self._follow, self._motion, self._hold,
            lambda error: self.refused.append(str(error)),
        )  # fmt: skip
        self.create_timer(0.005, lambda: self.follower.setpoint(time.monotonic()))

    def decide(self, mode: Mode, source: str = SOURCE) -> None:
        wall, now = clocks(self)
        if self.authority.hear(Decision(mode, source, wall, LONGEST_LEASE), wall, now):
            self.follower.rest(now)

    def _follow(self, command: Command) -> str:
        why = self.authority.admits(command.source, command.now)
        if not why:
            self.follower.accept(
                command.names, command.times, command.positions, command.now, velocities=command.velocities,
                age=command.age,
            )  # fmt: skip
        return why

    def _motion(self) -> Motion:
        joints = self.follower.joints[:3].copy()
        if self.held is not None:
            joints[1] = self.held
        return motion_of(self.follower, joints, time.monotonic(), self.authority.in_force)

    def _hold(self) -> None:
        self.follower.stop(time.monotonic())


class ActionBench(Bench):
    """The robot, and a client that sends goals."""

    def __init__(self, domain: int) -> None:
        super().__init__(domain)
        self.robot = self.add(Robot(self.context))
        self.node = self.add(Node("client", context=self.context))
        self.goals = Goals(self.node, "robot/follow_joint_trajectory", self.wait)
        self.send, self.end = self.goals.send, self.goals.end


@pytest.fixture
def bench(domain: int) -> Iterator[ActionBench]:
    one = ActionBench(domain)
    yield one
    one.close()


def goal(*rows: Any, seconds: float = 0.3, source: str = SOURCE, **more: Any) -> Any:
    return goal_of(*(rows or [THERE]), seconds=seconds, source=source, **more)


def late() -> Any:
    one = goal()
    one.trajectory.header.stamp.sec = 1_000_000
    return one


def other_dofs() -> Any:
    one = goal()
    one.multi_dof_trajectory.points = [MultiDOFJointTrajectoryPoint()]
    return one


def test_a_goal_is_followed_with_feedback_to_its_end(bench: ActionBench) -> None:
    one = goal((-0.3, -0.3, -0.3), THERE, seconds=1.0)
    for point in one.trajectory.points:
        point.accelerations = [0.1, 0.1, 0.1]  # as planners send them
    handle = bench.send(one)
    bench.wait(lambda: bench.goals.feedback, "feedback")
    assert handle.status in (GoalStatus.STATUS_ACCEPTED, GoalStatus.STATUS_EXECUTING)
    assert bench.end(handle) == (GoalStatus.STATUS_SUCCEEDED, Result.SUCCESSFUL, "")
    assert bench.robot.follower.joints[:3] == pytest.approx(THERE, abs=0.01)
    for told in bench.goals.feedback:
        assert told.joint_names == list(SERVOS)
        assert told.header.stamp.sec > 0
        error = np.subtract(told.desired.positions, told.actual.positions)
        assert told.error.positions == pytest.approx(error)
        assert -0.61 < told.actual.positions[2] < -0.09


@pytest.mark.parametrize(
    ("make", "code", "named"),
    [
        (lambda: goal(source=""), -1, ("header.frame_id", "ignored", "'/operator'")),
        (lambda: goal(source="world"), -1, ("'world'", "ignored", "'/operator'")),
        (lambda: goal(joints=("a", "b", "c")), -2, ("joint 'a'", "servo_0, servo_1, servo_2, slide")),
        (lambda: goal((0.0, 0.0), joints=SERVOS[:2]), -2, ("'servo_2'", "missing", ", ".join(SERVOS))),
        (late, -3, ("started", "0.5 s")),
        (lambda: goal((0.0, 0.0, np.nan)), -1, ("point 0", "servo_2", "nan rad", "-2.1 to 0.6 rad")),
        (lambda: goal((0.0, 0.0, 0.7)), -1, ("point 0", "servo_2", "0.7 rad", "-2.1 to 0.6 rad")),
        (Goal, -1, ("header.frame_id", "ignored")),
        (lambda: goal(*[THERE] * 2001, seconds=0.01), -1, ("trajectory", "2000 points")),
        (other_dofs, -1, ("multi_dof_trajectory", "not supported")),
        (
            lambda: goal(component_goal_tolerance=[JointComponentTolerance()]),
            -1,
            ("component_goal_tolerance", "not supported"),
        ),
        (
            lambda: goal(goal_tolerance=[JointTolerance(name="elbow", position=0.1)]),
            -1,
            ("goal_tolerance", "'elbow'"),
        ),
    ],
)
def test_what_is_not_followed_says_why_and_lets_the_motion_go_on(
    bench: ActionBench, make, code: int, named: tuple[str, ...]
) -> None:
    first = bench.send(goal())
    before = bench.robot.follower.trajectory
    status, error, text = bench.end(bench.send(make()))
    assert (status, error) == (GoalStatus.STATUS_ABORTED, code)
    assert_names(text, *named)
    assert "\n" not in text
    assert bench.robot.follower.trajectory is before
    assert [*bench.robot.refused, bench.robot.authority.ignored_commands.last] != [""]
    assert bench.end(first)[0] == GoalStatus.STATUS_SUCCEEDED


def test_in_the_wrong_mode_nothing_moves(bench: ActionBench) -> None:
    bench.robot.decide(Mode.STOP)
    ended = bench.end(bench.send(goal()))
    assert ended[:2] == (GoalStatus.STATUS_ABORTED, Result.INVALID_GOAL)
    assert_names(ended[2], "STOP", "ignored", "'/operator'")
    bench.robot.decide(Mode.IK)
    assert_names(bench.end(bench.send(goal()))[2], "IK", "ignored", "'/operator'")
    assert bench.robot.follower.joints == pytest.approx(START)
    assert bench.robot.follower.trajectory is None


def test_a_cancelled_goal_holds_where_it_is(bench: ActionBench) -> None:
    handle = bench.send(goal(seconds=9.0))
    bench.wait(lambda: bench.robot.follower.joints[0] < -0.11, "some motion")
    assert bench.goals.cancel(handle) == 1
    here = bench.robot.follower.joints.copy()
    ended = bench.end(handle)
    assert ended[:2] == (GoalStatus.STATUS_CANCELED, Result.SUCCESSFUL)
    assert_names(ended[2], "cancelled", "hold")
    assert bench.robot.follower.activity is Activity.HOLDING
    assert bench.robot.follower.joints == pytest.approx(here, abs=1e-12)
    assert bench.goals.cancel(handle) == 0  # it has ended


def test_a_newer_goal_preempts_and_another_command_replaces(bench: ActionBench) -> None:
    first = bench.send(goal((0.5, 0.5, 0.5), seconds=9.0))
    second = bench.send(goal(seconds=2.0))
    ended = bench.end(first)
    assert ended[:2] == (GoalStatus.STATUS_ABORTED, Result.INVALID_GOAL)
    assert_names(ended[2], "preempted", "newer goal")
    bench.robot.follower.accept(SERVOS, [0.1], [THERE], time.monotonic())
    ended = bench.end(second)
    assert ended[:2] == (GoalStatus.STATUS_ABORTED, Result.INVALID_GOAL)
    assert_names(ended[2], "another command")
    bench.wait(lambda: bench.robot.follower.joints[2] == pytest.approx(THERE[2]), "the other command's end")


def test_stop_and_a_lost_operator_end_a_goal(bench: ActionBench) -> None:
    handle = bench.send(goal(seconds=9.0))
    bench.robot.decide(Mode.STOP, "/panic")
    ended = bench.end(handle)
    assert ended[:2] == (GoalStatus.STATUS_ABORTED, Result.INVALID_GOAL)
    assert_names(ended[2], "interrupted", "STOP", "/panic")
    assert bench.robot.follower.activity is Activity.HOLDING


def test_a_node_that_ends_tells_so(bench: ActionBench) -> None:
    handle = bench.send(goal(seconds=9.0))
    bench.robot.action.leave()
    ended = bench.end(handle)
    assert ended[:2] == (GoalStatus.STATUS_ABORTED, Result.INVALID_GOAL)
    assert_names(ended[2], "interrupted", "node")
    bench.robot.action.leave()  # without a goal it does nothing


def test_joints_that_do_not_follow_end_it_where_that_matters(bench: ActionBench) -> None:
    bench.robot.held = -0.2
    near = goal(seconds=9.0, path_tolerance=[JointTolerance(name="servo_1", position=0.15)])
    status, code, why = bench.end(bench.send(near))
    assert (status, code) == (GoalStatus.STATUS_ABORTED, Result.PATH_TOLERANCE_VIOLATED)
    assert_names(why, "servo_1", "-0.2000 rad", "path_tolerance", "0.15 rad")
    assert min(map(float, re.findall(r"-\d\.\d+", why))) < -0.35  # where it should have been
    assert bench.robot.follower.activity is Activity.HOLDING
    soon = goal(goal_time_tolerance=Duration(nanosec=200_000_000))
    status, code, why = bench.end(bench.send(soon))
    assert (status, code) == (GoalStatus.STATUS_ABORTED, Result.GOAL_TOLERANCE_VIOLATED)
    assert_names(why, "servo_1", "-0.2000 rad", "-0.5000", "goal_tolerance", "0.01 rad")
    wide = goal(goal_tolerance=[JointTolerance(name="servo_1", position=0.5)])
    assert bench.end(bench.send(wide))[0] == GoalStatus.STATUS_SUCCEEDED
