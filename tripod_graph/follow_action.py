"""The action `follow_joint_trajectory` of nodes that follow trajectories: the topic's rule, with an answer.

A goal is obeyed like a message on `joint_trajectory`: its `header.frame_id` names its source, which must be in charge.
What is not obeyed is answered at once by an aborted goal whose result says why, and moves nothing. A goal ends when the
joints have arrived, when they are too far from where they should be, when somebody cancels it, when another command
is followed instead, and when nobody is in charge any more; whatever ends it early makes the joints hold.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from control_msgs.action import FollowJointTrajectory
from rclpy.action import ActionServer, CancelResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from trajectory_msgs.msg import JointTrajectory

from tripod_graph.cdr import MOST_POINTS
from tripod_graph.command import CommandError, JointNameError, LateError
from tripod_graph.control_mode import clocks
from tripod_graph.goal import Motion, Outcome, Tolerances, judge, tolerances
from tripod_graph.goal_request import BoundedTrajectory
from tripod_graph.joint import Joint
from tripod_graph.trajectory import Command, command_of, point_of, seconds

PERIOD = 0.05
"""Time between two feedbacks of a goal, and two looks at whether it has ended [s]."""

KEPT = 60
"""How long results are kept for who asks later [s]."""

Follow = Callable[[Command], str]
"""Takes a command; returns why it is not obeyed, empty if it is. Raises ValueError for one that cannot be."""


@dataclass
class _Goal:
    """A goal that is followed."""

    handle: ServerGoalHandle
    trajectory: object
    tolerance: Tolerances
    end: float


class _Server(ActionServer):
    """One whose goals are watched by a timer: a coroutine that waits would keep the executor busy all the time."""

    def notify_execute(self, goal_handle: ServerGoalHandle, execute_callback: Any) -> None:
        """Do nothing when a goal begins."""

    def finish(self, handle: ServerGoalHandle, result: FollowJointTrajectory.Result) -> None:
        """Give the result to who asks for it; the goal has ended."""
        super().notify_execute(handle, lambda _: result)


class FollowAction:
    """The action of one node, which keeps the object."""

    def __init__(
        self,
        node: Node,
        name: str,
        follow: Follow,
        motion: Callable[[], Motion],
        hold: Callable[[], None],
        refuse: Callable[[ValueError], None],
    ) -> None:
        """Offer the action.

        Args:
            node: Where.
            name: Of the action.
            follow: Takes what a goal commands.
            motion: What the node does now.
            hold: Ends the motion where it is.
            refuse: Told of what cannot be followed.
        """
        self._node, self._follow, self._motion, self._hold, self._refuse = node, follow, motion, hold, refuse
        self._goal: _Goal | None = None
        self._server = _Server(
            node, BoundedTrajectory, name, lambda _: None, handle_accepted_callback=self._begin,
            cancel_callback=self._cancel, result_timeout=KEPT,
        )  # fmt: skip
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = node.create_timer(PERIOD, self._look, clock=steady, autostart=False)

    def leave(self) -> None:
        """End the goal that is followed, if there is one: the node ends, and its client would wait for ever."""
        if self._goal is not None:
            self._end(self._goal.handle, Outcome.INVALID_GOAL, "interrupted: the node is stopping")

    def _begin(self, handle: ServerGoalHandle) -> None:
        handle.execute()
        goal = handle.request
        try:
            command = _command(goal.trajectory, *clocks(self._node))
            tolerance = _tolerances(goal, self._motion().joints)
            why = self._follow(command)
        except ValueError as error:
            self._refuse(error)
            self._end(handle, _outcome(error), str(error))
            return
        if why:
            self._end(handle, Outcome.INVALID_GOAL, why)
            return
        if self._goal is not None:
            self._end(self._goal.handle, Outcome.INVALID_GOAL, "preempted by a newer goal")
        motion = self._motion()
        end = motion.now - command.age + command.times[-1]
        self._goal = _Goal(handle, motion.trajectory, tolerance, end)
        self._timer.reset()

    def _cancel(self, handle: ServerGoalHandle) -> CancelResponse:
        if self._goal is None or self._goal.handle is not handle:
            return CancelResponse.REJECT
        self._hold_if_own(self._goal, self._motion())
        return CancelResponse.ACCEPT

    def _look(self) -> None:
        """Say how far the goal is, or how it has ended."""
        goal = self._goal
        if goal is None:
            self._timer.cancel()
            return
        motion = self._motion()
        if goal.handle.is_cancel_requested:
            self._end(goal.handle, Outcome.SUCCESSFUL, "cancelled: the joints hold")
            return
        ended = judge(motion, goal.tolerance, goal.trajectory, goal.end)
        if ended is None:
            goal.handle.publish_feedback(self._feedback(goal, motion))
            return
        outcome, why = ended
        if outcome is not Outcome.SUCCESSFUL:
            self._hold_if_own(goal, motion)
        self._end(goal.handle, outcome, why)

    def _hold_if_own(self, goal: _Goal, motion: Motion) -> None:
        if motion.trajectory is goal.trajectory:
            self._hold()

    def _end(self, handle: ServerGoalHandle, outcome: Outcome, why: str) -> None:
        if handle.is_cancel_requested:
            handle.canceled()
        elif outcome is Outcome.SUCCESSFUL:
            handle.succeed()
        else:
            handle.abort()
        if why:
            self._node.get_logger().warning(f"goal ended: {why}", throttle_duration_sec=1.0)
        self._server.finish(handle, FollowJointTrajectory.Result(error_code=int(outcome), error_string=why))
        if self._goal is not None and self._goal.handle is handle:
            self._goal = None

    def _feedback(self, goal: _Goal, motion: Motion) -> FollowJointTrajectory.Feedback:
        asked = goal.handle.request.trajectory.joint_names
        named = [i for i in range(len(motion.actual)) if motion.joints[i].name in asked]
        desired, actual = motion.desired[named], motion.actual[named]
        feedback = FollowJointTrajectory.Feedback(joint_names=[motion.joints[i].name for i in named])
        feedback.header.stamp = self._node.get_clock().now().to_msg()
        joints = [motion.joints[i] for i in named]
        feedback.desired, feedback.actual = point_of(desired, joints), point_of(actual, joints)
        feedback.error = point_of(desired - actual, joints)
        return feedback


def _command(message: JointTrajectory, wall: float, now: float) -> Command:
    """Return what a goal commands. Planners send accelerations: positions and velocities say it all, see `command`."""
    if len(message.points) > MOST_POINTS:
        raise CommandError(
            f"a trajectory has more than {MOST_POINTS} points, the largest number allowed; send a shorter one"
        )
    for point in message.points:
        point.accelerations = []
    return command_of(message, wall, now)


def _tolerances(goal: FollowJointTrajectory.Goal, joints: Sequence[Joint]) -> Tolerances:
    for what in ("multi_dof_trajectory", "component_path_tolerance", "component_goal_tolerance"):
        given = getattr(goal, what)
        if len(given.points if what == "multi_dof_trajectory" else given):
            raise CommandError(f"the goal has a {what}, which is not supported: leave it out")
    path = {t.name: t.position for t in goal.path_tolerance}
    end = {t.name: t.position for t in goal.goal_tolerance}
    return tolerances(joints, path, end, seconds(goal.goal_time_tolerance))


def _outcome(error: ValueError) -> Outcome:
    if isinstance(error, JointNameError):
        return Outcome.INVALID_JOINTS
    return Outcome.OLD_HEADER_TIMESTAMP if isinstance(error, LateError) else Outcome.INVALID_GOAL
