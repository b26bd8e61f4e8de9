"""The simulator's node in a graph of the test, and a node that listens, commands and calls services."""

import random
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy")
pytest.importorskip("tripod_msgs")

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState, PointCloud2
from shape_msgs.msg import Mesh, SolidPrimitive
from std_msgs.msg import Float64MultiArray, String, UInt8MultiArray
from std_srvs.srv import SetBool, Trigger
from tf2_msgs.msg import TFMessage
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from tripod_msgs.msg import BodyState, Compliance, ControlMode, Field, Forces, SimStatus
from visualization_msgs.msg import MarkerArray

from tests.decisions import SOURCE
from tests.services import call
from tripod_graph import names
from tripod_graph.mode import LONGEST_LEASE
from tripod_graph.qos import KEPT, LATCHED, RELIABLE, SENSOR
from tripod_graph.run import ros_arguments
from tripod_runtime.node import SimNode

DEADLINE = 60.0
"""For a loaded machine [s]; nothing here waits so long unless it fails."""

PUBLISHED = {
    names.BODY_STATE: (BodyState, SENSOR),
    names.MESH: (Mesh, LATCHED),
    names.MAZE_MESH: (Mesh, LATCHED),
    names.BALL_SHAPE: (SolidPrimitive, LATCHED),
    names.MARKERS: (MarkerArray, SENSOR),
    names.POINT_CLOUD: (PointCloud2, SENSOR),
    names.SCENE: (String, LATCHED),
    names.SIM_PICTURE: (String, LATCHED),
    names.SIM_FIGURES: (String, RELIABLE),
    names.field_topic("von_mises"): (Field, RELIABLE),
    names.FORCES: (Forces, RELIABLE),
    names.COMMANDS: (Float64MultiArray, KEPT),
    names.CHECKPOINT: (UInt8MultiArray, LATCHED),
    names.SIM_JOINT_STATES: (JointState, RELIABLE),
    names.EFFECTOR_POSE: (PoseStamped, RELIABLE),
    names.COMPLIANCE: (Compliance, RELIABLE),
    names.SIM_STATUS: (SimStatus, RELIABLE),
    names.DIAGNOSTICS: (DiagnosticArray, RELIABLE),
    names.ROBOT_DESCRIPTION: (String, LATCHED),
    names.TF: (TFMessage, RELIABLE),
    names.TF_STATIC: (TFMessage, LATCHED),
}
QUIET = (
    names.MARKERS, names.POINT_CLOUD, names.COMPLIANCE, names.TF, names.field_topic("von_mises"), names.FORCES,
)  # fmt: skip
"""Computed only while someone listens."""


def assert_finite(message: Any) -> None:
    """Fail on any number in a message, at any depth, that is not finite."""
    for name in message.get_fields_and_field_types():
        if isinstance(message, Field) and name == "values":
            continue  # NaN: no value there
        value = getattr(message, name)
        if isinstance(value, float) or type(value).__module__ in ("array", "numpy"):
            assert np.isfinite(np.asarray(value)).all(), f"{type(message).__name__}.{name} is {value}"
        elif hasattr(value, "get_fields_and_field_types"):
            assert_finite(value)
        elif isinstance(value, list) and value and hasattr(value[0], "get_fields_and_field_types"):
            for part in value:
                assert_finite(part)


class Graph:
    """The node under test in a namespace of its own, and one that listens, commands and calls services."""

    def __init__(self, domain: int, **parameters: object) -> None:
        """`parameters`: of the node under test, as on its command line."""
        words = [f"__ns:=/robot_{random.getrandbits(48):x}", *(f"{k}:={v}" for k, v in parameters.items())]
        rclpy.init(args=ros_arguments(words), domain_id=domain)
        self.executor = SingleThreadedExecutor()
        self.ear = Node("ear")
        self.executor.add_node(self.ear)
        self.heard: dict[str, list[Any]] = {topic: [] for topic in PUBLISHED}
        self._since = dict.fromkeys(PUBLISHED, 0)  # published before it [ns]: not of interest any more
        self.node: Any = None
        self.mode = self.ear.create_publisher(ControlMode, names.CONTROL_MODE, LATCHED)
        self.trajectory = self.ear.create_publisher(JointTrajectory, names.JOINT_TRAJECTORY, RELIABLE)

    def start(self, before_it_listens: Callable[[], None] = lambda: None) -> "Graph":
        self.node = SimNode()
        before_it_listens()
        self.executor.add_node(self.node)
        for topic in PUBLISHED:
            if topic not in QUIET:
                self.listen(topic)
        self.wait(self.trajectory.get_subscription_count, "the simulator's subscription")
        self.wait(self.mode.get_subscription_count, "the simulator's subscription")
        return self

    def listen(self, topic: str) -> Any:
        def keep(message: Any, info: dict[str, Any]) -> None:
            assert_finite(message)
            if info["source_timestamp"] >= self._since[topic]:
                self.heard[topic].append(message)

        kind, qos = PUBLISHED[topic]
        return self.ear.create_subscription(kind, topic, keep, qos)

    def listen_to_all(self, topic: str) -> list[Any]:
        """Return a list that gets every message of a reliable topic from now on, however late this machine is."""
        kind, qos = PUBLISHED[topic]
        every: list[Any] = []
        deep = QoSProfile(depth=10_000, reliability=qos.reliability, durability=qos.durability)
        self.ear.create_subscription(kind, topic, every.append, deep)
        return every

    def wait(self, condition: Callable[[], Any], what: str) -> Any:
        deadline = time.monotonic() + DEADLINE
        while not (value := condition()):
            assert time.monotonic() < deadline, f"waited in vain for {what}; status: {self.last_status()}"
            self.executor.spin_once(timeout_sec=0.02)
        return value

    def spin(self, seconds: float) -> None:
        """Let time pass, to see that something does not happen."""
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline:
            self.executor.spin_once(timeout_sec=0.02)

    def last_status(self) -> Any:
        statuses = self.heard[names.SIM_STATUS]
        return statuses[-1] if statuses else None

    def next(self, topic: str, condition: Callable[[Any], bool] = lambda message: True) -> Any:
        """Wait for a message that is published from now on and meets the condition."""
        heard = self.heard[topic]
        self._since[topic] = time.time_ns()
        heard.clear()
        return self.wait(lambda: next((m for m in heard if condition(m)), None), f"a message on {topic}")

    def status(self, **fields: object) -> Any:
        """Wait for a status with these values."""
        return self.next(names.SIM_STATUS, lambda s: all(getattr(s, k) == v for k, v in fields.items()))

    def joints(self) -> list[float]:
        return list(self.next(names.SIM_JOINT_STATES).position)

    def call(self, name: str, request: object) -> Any:
        kind = SetBool if isinstance(request, SetBool.Request) else Trigger
        return call(self.ear, kind, name, request, server="sim", wait=self.wait)

    def pause(self, paused: bool) -> Any:
        return self.call(names.SIM_PAUSE, SetBool.Request(data=paused))

    def reset(self) -> Any:
        return self.call(names.SIM_RESET, Trigger.Request())

    def step(self) -> Any:
        return self.call(names.SIM_STEP, Trigger.Request())

    def choose(self, mode: int) -> None:
        message = ControlMode(mode=mode, source=SOURCE, lease=LONGEST_LEASE)
        message.header.stamp = self.ear.get_clock().now().to_msg()
        self.mode.publish(message)
        if mode in (ControlMode.STOP, ControlMode.TELEOP, ControlMode.IK, ControlMode.REPLAY):
            self.wait(lambda: self.node._authority.mode == mode, f"mode {mode}")

    def command(
        self, positions: Sequence[float], joints: Sequence[str] = names.SERVOS, seconds: float = 0.0
    ) -> None:
        point = JointTrajectoryPoint(positions=list(positions))
        point.time_from_start.sec, point.time_from_start.nanosec = divmod(round(seconds * 1e9), 10**9)
        message = JointTrajectory(joint_names=list(joints), points=[point])
        message.header.frame_id = SOURCE
        self.trajectory.publish(message)

    def close(self) -> None:
        if self.node:
            self.executor.remove_node(self.node)
            self.node.close()
            assert not self.node._physics.is_alive()
            self.node.destroy_node()
        self.ear.destroy_node()
        self.executor.shutdown()
        rclpy.try_shutdown()
