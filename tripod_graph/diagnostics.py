"""What every node says about its health on `/diagnostics`, once a second, for any ROS diagnostics viewer."""

from collections.abc import Callable, Mapping
from enum import IntEnum
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from tripod_graph.names import DIAGNOSTICS
from tripod_graph.qos import RELIABLE

PERIOD = 1.0
"""Time between two messages [s]."""


class Level(IntEnum):
    """Values of diagnostic_msgs/DiagnosticStatus.level."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


Report = tuple[Level, str, Mapping[str, Any]]
"""Level, one line for people, and values by name; a float is shown with six digits."""


class Diagnostics:
    """Publishes what `report` returns as the one DiagnosticStatus of a node, at 1 Hz on the steady clock.

    The node keeps the object; destroying the node ends it.
    """

    def __init__(self, node: Node, report: Callable[[], Report], hardware_id: str = "") -> None:
        """`hardware_id`: names the device for nodes that have one."""
        self._node, self._report, self._hardware_id = node, report, hardware_id
        self._publisher = node.create_publisher(DiagnosticArray, DIAGNOSTICS, RELIABLE)
        self._timer = node.create_timer(PERIOD, self.publish, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def publish(self) -> None:
        """Publish one message now; the timer calls it."""
        message = DiagnosticArray()
        message.header.stamp = self._node.get_clock().now().to_msg()
        name = self._node.get_fully_qualified_name()
        message.status = [status_message(name, self._hardware_id, *self._report())]
        self._publisher.publish(message)


def status_message(
    name: str, hardware_id: str, level: Level, message: str, values: Mapping[str, Any]
) -> DiagnosticStatus:
    """Return the DiagnosticStatus of one report."""
    pairs = [KeyValue(key=k, value=f"{v:.6g}" if isinstance(v, float) else str(v)) for k, v in values.items()]
    return DiagnosticStatus(
        level=bytes([level]), name=name, hardware_id=hardware_id, message=message, values=pairs
    )
