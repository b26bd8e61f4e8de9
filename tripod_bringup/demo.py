"""The demo's node: plays `demo_session` into the graph and measures how well it is followed."""

import math
import threading
import time
from contextlib import suppress
from typing import Any

import numpy as np
from builtin_interfaces.msg import Duration, Time
from geometry_msgs.msg import PoseStamped
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from tripod_msgs.msg import BodyState, IkStatus, RobotStatus, SimStatus

from tripod_bringup.demo_session import Action, DemoSession, Heard, Phase, SessionTimes
from tripod_bringup.demo_summary import Measurements
from tripod_bringup.demo_target import DemoTarget
from tripod_bringup.watch import IK_STATES, SOLVED
from tripod_graph import names
from tripod_graph.authority import OperatorAuthority
from tripod_graph.control_mode import Speaker, clocks, listen
from tripod_graph.executor import Patient
from tripod_graph.mode import Decision
from tripod_graph.qos import NEWEST, RELIABLE, SENSOR
from tripod_graph.source import new_source

PERIOD = 0.02
"""Between two targets [s]."""

SETTLED_AFTER = 1.0
"""Targets older than this count in the tracking error [s]."""

FOLLOWERS = 2
"""Who must hear a joint trajectory: simulator and driver."""


class DemoNode(Node):
    """Publishes modes, the way to the working pose and the targets; `DemoSession` decides which and when.

    Attributes:
        session: The script.
        measured: What was heard while the targets lasted; read it after the executor stopped.
    """

    def __init__(self, track: float | None, shape: DemoTarget | None = None) -> None:
        """`track`: how long the targets last [s], None until told; `shape`: the circle, or None."""
        super().__init__("demo")
        self.session = DemoSession(SessionTimes(track=track), shape)
        self.measured = Measurements()
        self._go, self._cut = threading.Event(), threading.Event()
        self._joints, self._effector = np.full(1, np.nan), (math.nan,) * 3
        self._robot = np.zeros(0)
        self._stamp_start = 0.0
        self._authority = OperatorAuthority(new_source("demo", self.get_namespace()))
        self._speaker = Speaker(self, self._authority)
        listen(self, self._on_decision)
        self._trajectory = self.create_publisher(JointTrajectory, names.JOINT_TRAJECTORY, RELIABLE)
        self._target = self.create_publisher(PoseStamped, names.TARGET_POSE, RELIABLE)
        later = Patient()  # measured when the next target is told
        *self._until_tracking, _, _, _, _ = [
            self.create_subscription(kind, topic, callback, qos, callback_group=later)
            for kind, topic, callback, qos in (
                (JointState, names.SIM_JOINT_STATES, self._on_joints, NEWEST),
                (JointState, names.ROBOT_JOINT_STATES, self._on_robot_joints, NEWEST),
                (SimStatus, names.SIM_STATUS, self._on_sim_status, RELIABLE),
                (IkStatus, names.IK_STATUS, self._on_ik_status, NEWEST),
                (RobotStatus, names.ROBOT_STATUS, self._on_robot_status, RELIABLE),
                (PoseStamped, names.EFFECTOR_POSE, self._on_effector, NEWEST),
            )
        ]
        self.create_subscription(
            BodyState, names.BODY_STATE, self._on_body_state, SENSOR, raw=True, callback_group=later
        )
        # a steady clock: the demo goes on when the system's clock is set
        self.create_timer(PERIOD, self._on_timer, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def go(self) -> None:
        """Let the session begin; call it when every node is up."""
        self._go.set()

    def finish(self) -> None:
        """End publishing and measuring, and note if it was too early; call it before the last STOP."""
        self._cut.set()
        if not self.session.finished and self.session.phase is not Phase.TRACK:
            self.measured.session_failure = f"stopped while {self.session.phase.value}"

    def close(self) -> None:
        """Leave the graph."""
        self.destroy_node()

    @property
    def _tracking(self) -> bool:
        return self.session.phase is Phase.TRACK and not self._cut.is_set()

    def _on_timer(self) -> None:
        if not self._go.is_set() or self._cut.is_set() or self.session.finished:
            return
        was = self.session.phase
        linked = was is Phase.WAIT and self._is_linked()
        self._publish(
            self.session.step(time.monotonic(), Heard(linked, self._joints, self._effector, self._robot))
        )
        if was is not Phase.TRACK and self._tracking:
            self._stamp_start = seconds(self.get_clock().now().to_msg())
            self.measured.packets_before = self.measured.packets
            for subscription in self._until_tracking:  # where the joints are is asked no more
                self.destroy_subscription(subscription)
        if self.session.failure:
            self.measured.session_failure = self.session.failure

    def _is_linked(self) -> bool:
        return bool(
            self._trajectory.get_subscription_count() >= FOLLOWERS
            and self._speaker.is_heard_by(FOLLOWERS + 1)
            and self._target.get_subscription_count() >= 1
            and self.measured.packets is not None
        )

    def _publish(self, action: Action) -> None:
        stamp = self.get_clock().now().to_msg()
        if action.mode is not None:
            self._speaker.decide(action.mode)
        if action.pose is not None:
            self._trajectory.publish(
                trajectory_message(action.pose, action.move_time, self._authority.source)
            )
        if action.target is not None:
            self._target.publish(target_message(action.target, stamp))

    def _on_decision(self, decision: Decision) -> None:
        with suppress(ValueError):  # one that cannot be is reported by those who obey
            self._authority.hear(decision, *clocks(self))

    def _on_sim_status(self, message: Any) -> None:
        if self._tracking:
            self.measured.real_time_factor.add(message.real_time_factor)
            self.measured.step_time_median.add(message.step_time_median)
            self.measured.step_time_p99.add(message.step_time_p99)

    def _on_ik_status(self, message: Any) -> None:
        if not self._tracking:
            return
        state = IK_STATES.get(message.state, str(message.state))
        self.measured.ik_states[state] = self.measured.ik_states.get(state, 0) + 1
        late = seconds(message.header.stamp) - self._stamp_start > SETTLED_AFTER
        self.measured.ik_solved += late and message.state in SOLVED

    def _on_robot_status(self, message: Any) -> None:
        self.measured.packets, self.measured.port = int(message.packets_sent), message.port

    def _on_joints(self, message: Any) -> None:
        told = dict(zip(message.name, message.position, strict=False))
        named = names.joint_names(names.count_servos(told))
        self._joints = np.array([told.get(name, np.nan) for name in named])

    def _on_robot_joints(self, message: Any) -> None:
        told = dict(zip(message.name, message.position, strict=False))
        angles = np.array([told.get(name, np.nan) for name in names.servo_names(names.count_servos(told))])
        self._robot = angles if np.isfinite(angles).all() else np.zeros(0)

    def _on_effector(self, message: Any) -> None:
        position = message.pose.position
        self._effector = position.x, position.y, position.z
        if self._tracking and self.session.target is not None:
            age = seconds(message.header.stamp) - self._stamp_start
            if age > SETTLED_AFTER:
                self.measured.tracking.add(math.dist(self._effector, self.session.target(age)))

    def _on_body_state(self, _raw: bytes) -> None:
        if self._tracking:
            self.measured.body_states += 1


def seconds(stamp: Time) -> float:
    """Return a message's time stamp [s]."""
    return float(stamp.sec + stamp.nanosec * 1e-9)


def trajectory_message(pose: tuple[float, ...], duration: float, source: str) -> JointTrajectory:
    """Return a trajectory of `source` with one point: joint values `pose` [rad, m] after `duration` [s]."""
    whole = int(duration)
    point = JointTrajectoryPoint(
        positions=list(pose),
        time_from_start=Duration(sec=whole, nanosec=round((duration - whole) * 1e9)),
    )
    message = JointTrajectory(joint_names=list(names.joint_names(len(pose) - 1)), points=[point])
    message.header.frame_id = source
    return message


def target_message(position: tuple[float, float, float], stamp: Time) -> PoseStamped:
    """Return the target `position` [m] in `world`, upright."""
    message = PoseStamped()
    message.header.stamp, message.header.frame_id = stamp, names.WORLD
    p = message.pose.position
    p.x, p.y, p.z = position
    message.pose.orientation.w = 1.0
    return message
