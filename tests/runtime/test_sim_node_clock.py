"""Simulated time in the graph: /clock, stamps and motions pass with the steps, however slowly those come."""

import numpy as np
import pytest

pytest.importorskip("rclpy")
pytest.importorskip("tripod_msgs")

from rosgraph_msgs.msg import Clock
from tripod_msgs.msg import ControlMode

from tripod_graph import names

pytestmark = pytest.mark.ros

DT, RATE = 0.002, "500.0"
"""Step of the scene, and poses with each [s, Hz]."""


def nanoseconds(stamp) -> int:
    return stamp.sec * 10**9 + stamp.nanosec


def test_clock_and_stamps_pass_with_the_steps_and_a_reset_does_not_set_them_back(make) -> None:
    graph = make(publish_clock="true", pose_rate=RATE).start()
    clocks: list[int] = []
    graph.ear.create_subscription(Clock, names.CLOCK, lambda m: clocks.append(nanoseconds(m.clock)), 1000)
    graph.wait(lambda: len(clocks) > 20, "the clock")
    graph.pause(True)
    graph.reset()
    graph.wait(lambda: clocks, "the clock")
    poses = graph.listen_to_all(names.EFFECTOR_POSE)
    graph.wait(lambda: graph.node._pose.get_subscription_count() == 2, "the second listener")
    for _ in range(8):
        graph.step()
    graph.wait(lambda: len(poses) >= 8, "eight poses")
    stamps = np.array([nanoseconds(p.header.stamp) for p in poses])
    np.testing.assert_array_equal(np.diff(stamps), round(1e9 * DT))
    assert (np.diff(clocks) > 0).all()
    assert stamps[0] > clocks[0]
    body = graph.next(names.BODY_STATE)
    assert nanoseconds(body.header.stamp) == stamps[-1]
    assert body.step == 8


def test_joints_move_by_simulated_time_so_that_velocities_are_those_commanded(make) -> None:
    graph = make(publish_clock="true", pose_rate=RATE).start()
    graph.pause(True)
    graph.choose(ControlMode.TELEOP)
    begin = np.array(graph.node._follower.joints[:3])
    graph.command((begin - 0.1).tolist(), seconds=0.2)
    graph.wait(
        lambda: graph.node._follower.goal is not None and graph.node._follower._times[-1] > 0.1, "the command"
    )
    joints = graph.listen_to_all(names.SIM_JOINT_STATES)
    graph.wait(lambda: graph.node._joints[0].get_subscription_count() == 2, "the second listener")
    for _ in range(100):  # each takes as long as a call of a service does
        graph.step()
    graph.wait(lambda: len(joints) >= 100, "100 joint states")
    angles = np.array([m.position[0] for m in joints])
    np.testing.assert_allclose(np.diff(angles) / DT, -0.5, atol=1e-6)
    assert angles[-1] == pytest.approx(begin[0] - 0.1, abs=0.5 * DT + 1e-9)


def test_without_it_nothing_publishes_a_clock(make) -> None:
    graph = make().start()
    assert graph.ear.count_publishers(names.CLOCK) == 0
    assert not graph.node.get_parameter("use_sim_time").value


def test_a_clock_that_nobody_publishes_is_told_once_simulated_time_is_wanted(make) -> None:
    graph = make(use_sim_time="true").start()
    own = graph.node.get_namespace()
    graph.next(
        names.DIAGNOSTICS, lambda m: m.status[0].name == f"{own}/sim" and "/clock" in m.status[0].message
    )
