"""Goals for the action `follow_joint_trajectory`, and how they ended."""

from collections.abc import Sequence
from typing import Any

from control_msgs.action import FollowJointTrajectory
from rclpy.action import ActionClient
from rclpy.node import Node
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from tests.services import Wait
from tripod_graph.names import SERVOS


class Goals:
    """A client of the action `name`.

    Attributes:
        feedback: All that was heard.
    """

    def __init__(self, node: Node, name: str, wait: Wait) -> None:
        self._client, self._wait = ActionClient(node, FollowJointTrajectory, name), wait
        self.feedback: list[Any] = []
        wait(self._client.server_is_ready, f"the action {name}")

    def send(self, goal: Any) -> Any:
        """Return the handle of a goal; all are accepted."""
        future = self._client.send_goal_async(
            goal, feedback_callback=lambda m: self.feedback.append(m.feedback)
        )
        self._wait(future.done, "an answer to the goal")
        assert future.result().accepted
        return future.result()

    def cancel(self, handle: Any) -> int:
        """Return how many goals are cancelled then."""
        future = handle.cancel_goal_async()
        self._wait(future.done, "an answer to the cancellation")
        return len(future.result().goals_canceling)

    def end(self, handle: Any) -> tuple[int, int, str]:
        """Wait for the end of a goal; return status, error code and error string."""
        future = handle.get_result_async()
        self._wait(future.done, "the result")
        answer = future.result()
        return answer.status, answer.result.error_code, answer.result.error_string


def goal(
    *rows: Sequence[float], seconds: float, source: str, joints: Sequence[str] = SERVOS, **more: Any
) -> FollowJointTrajectory.Goal:
    """Return a goal of `source` through `rows`, joint values `seconds` apart."""
    points = []
    for k, row in enumerate(rows, start=1):
        point = JointTrajectoryPoint(positions=list(row))
        point.time_from_start.sec, point.time_from_start.nanosec = divmod(round(1e9 * k * seconds), 10**9)
        points.append(point)
    trajectory = JointTrajectory(joint_names=list(joints), points=points)
    trajectory.header.frame_id = source
    return FollowJointTrajectory.Goal(trajectory=trajectory, **more)
