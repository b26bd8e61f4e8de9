"""What the tests say to the driver node and hear from it."""

from typing import TYPE_CHECKING

import numpy as np

from tests.decisions import SOURCE
from tripod_driver.protocol import RESOLUTION
from tripod_graph import names
from tripod_graph.mode import LONGEST_LEASE, Mode
from tripod_graph.qos import LATCHED, RELIABLE

if TYPE_CHECKING:
    from tests.driver.conftest import Board

EXACT = RESOLUTION + 1e-9

LONGEST_STEP = 4.0 * 0.02 + 2 * RESOLUTION
"""Of two packets [rad], at 4 rad/s: what a servo may do from pulse to pulse, however late the driver comes."""


class Operator:
    """What the tests say to the driver and hear from it."""

    def __init__(self, client) -> None:
        from sensor_msgs.msg import JointState
        from trajectory_msgs.msg import JointTrajectory
        from tripod_msgs.msg import ControlMode, RobotStatus

        self.client = client
        self.statuses: list[RobotStatus] = []
        self.joint_states: list[JointState] = []
        node = client.node
        self._trajectory = node.create_publisher(JointTrajectory, names.JOINT_TRAJECTORY, RELIABLE)
        self._mode = node.create_publisher(ControlMode, names.CONTROL_MODE, LATCHED)
        node.create_subscription(RobotStatus, names.ROBOT_STATUS, self.statuses.append, RELIABLE)
        node.create_subscription(JointState, names.ROBOT_JOINT_STATES, self.joint_states.append, RELIABLE)

    @property
    def status(self):
        return self.statuses[-1]

    def mode(
        self, mode: int, *, stamp: float | None = None, source: str = SOURCE, lease: float = LONGEST_LEASE
    ) -> None:
        from rclpy.time import Time
        from tripod_msgs.msg import ControlMode

        message = ControlMode(mode=int(mode), source=source, lease=lease)
        now = self.client.node.get_clock().now()
        message.header.stamp = (now if stamp is None else Time(nanoseconds=int(stamp * 1e9))).to_msg()
        self._mode.publish(message)

    def stop_once_heard(self, stamp: float) -> None:
        """Say STOP as another operator, when the driver listens."""
        self.client.wait(self._mode.get_subscription_count, "its subscription")
        self.mode(Mode.STOP, stamp=stamp, source="/panic")

    def send(self, *points: list[float], joints=names.SERVOS, times=(0.0,), source: str = SOURCE) -> None:
        from builtin_interfaces.msg import Duration
        from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

        message = JointTrajectory(joint_names=list(joints))
        message.header.frame_id = source
        for point, t in zip(points, times, strict=True):
            since = Duration(sec=int(t), nanosec=round((t % 1) * 1e9))
            message.points.append(JointTrajectoryPoint(positions=point, time_from_start=since))
        self._trajectory.publish(message)

    def ready(self, mode: Mode = Mode.TELEOP, lease: float = LONGEST_LEASE) -> None:
        """Wait until the driver has a link and hears the operator, then choose the mode."""
        self.client.wait(lambda: self.statuses and self.status.state >= 2, "the driver")
        for publisher in (self._trajectory, self._mode):
            self.client.wait(lambda p=publisher: p.get_subscription_count() >= 1, "its subscription")
        self.mode(mode, lease=lease)

    def wait_hold(self, board: "Board") -> int:
        """Wait until the driver holds and `board` has all that was sent before; return how many packets that is."""

        def has_all() -> bool:
            status = self.status
            at_goal = status.state == status.HOLDING and near(status.sent, status.commanded)
            return at_goal and len(board.packets) >= status.packets_sent

        self.statuses.clear()
        self.client.wait(lambda: self.statuses and has_all(), "the hold")
        return len(board.packets)

    def wait_state(self, state: int, what: str) -> None:
        self.client.wait(lambda: self.statuses and self.status.state == state, what)


def near(angles, wanted) -> bool:
    return bool(np.abs(np.subtract(angles, wanted)).max() <= EXACT)


def changes(packets) -> list[list[float]]:
    """Return the packets without repetitions."""
    rows = [list(p) for p in packets]
    return [row for i, row in enumerate(rows) if i == 0 or row != rows[i - 1]]
