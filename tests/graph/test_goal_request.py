"""Goals of 100,000 points are cut before they are converted; others arrive as they were sent."""

from typing import Any

import pytest

pytest.importorskip("control_msgs", reason="the interfaces are not built: run `make setup`")

from control_msgs.action import FollowJointTrajectory
from control_msgs.msg import JointComponentTolerance, JointTolerance
from rclpy.action import ActionClient, ActionServer, GoalResponse
from rclpy.node import Node
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint, MultiDOFJointTrajectoryPoint

from tests.graph.bench import Bench
from tripod_graph.cdr import MOST_NAMES, MOST_POINTS
from tripod_graph.goal_request import BoundedTrajectory

pytestmark = pytest.mark.ros


def goal(points: int, others: int) -> FollowJointTrajectory.Goal:
    """Return one with something in every field, so many points, and so many of all else."""
    whole = FollowJointTrajectory.Goal()
    one, other = whole.trajectory, whole.multi_dof_trajectory
    one.header.frame_id, one.header.stamp.sec, one.header.stamp.nanosec = "/me", 7, 9
    one.points = [
        JointTrajectoryPoint(positions=[float(i), -0.5], velocities=[0.1, 0.2]) for i in range(points)
    ]
    other.header.frame_id = "other"
    other.points = [MultiDOFJointTrajectoryPoint() for _ in range(others)]
    one.joint_names = other.joint_names = [f"joint {i}" for i in range(others)]
    whole.path_tolerance = [JointTolerance(name=f"path {i}") for i in range(others)]
    whole.goal_tolerance = [JointTolerance(name=f"goal {i}") for i in range(others)]
    whole.component_path_tolerance = [JointComponentTolerance() for _ in range(others)]
    whole.component_goal_tolerance = [JointComponentTolerance() for _ in range(others)]
    whole.goal_time_tolerance.sec = 3
    return whole


def taken(domain: int, sent: FollowJointTrajectory.Goal) -> Any:
    """Return the goal as a server takes it."""
    bench, heard = Bench(domain), list[Any]()

    def hear(request: Any) -> GoalResponse:
        heard.append(request)
        return GoalResponse.REJECT

    node = bench.add(Node("server", context=bench.context))
    ActionServer(node, BoundedTrajectory, "follow", lambda _: None, goal_callback=hear)
    client = ActionClient(bench.add(Node("client", context=bench.context)), FollowJointTrajectory, "follow")
    bench.wait(client.server_is_ready, "server")
    future = client.send_goal_async(sent)
    bench.wait(future.done, "answer")
    bench.close()
    return heard[0]


@pytest.mark.parametrize("count", [0, 1, 3])
def test_what_is_small_arrives_as_it_was_sent(domain: int, count: int) -> None:
    sent = goal(count, count)
    assert taken(domain, sent) == sent


def test_what_is_large_is_cut_to_one_more_than_is_allowed(domain: int) -> None:
    sent = goal(100_000, 1000)
    got = taken(domain, sent)
    short: JointTrajectory = got.trajectory
    assert short.points == sent.trajectory.points[: MOST_POINTS + 1]
    assert short.header == sent.trajectory.header
    most = MOST_NAMES + 1
    assert list(short.joint_names) == sent.trajectory.joint_names[:most]
    assert got.multi_dof_trajectory.joint_names == sent.trajectory.joint_names[:most]
    assert len(got.multi_dof_trajectory.points) == most
    for what in ("path_tolerance", "goal_tolerance", "component_path_tolerance", "component_goal_tolerance"):
        assert list(getattr(got, what)) == getattr(sent, what)[:most]
    assert got.goal_time_tolerance == sent.goal_time_tolerance
