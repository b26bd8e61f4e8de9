"""Simulated time as the clock of the graph: it begins at the system's time and passes with the steps."""

import time

from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from rosgraph_msgs.msg import Clock

from tripod_graph.names import CLOCK

PERIOD = 0.01
"""Simulated time between two messages at least [s]."""


class SimulatedClock:
    """Publishes /clock and makes a node use it.

    A reset of the simulation does not set it back: whoever computes velocities from stamps would be wrong.
    """

    def __init__(self, node: Node, dt: float) -> None:
        """`dt`: of a step [s]."""
        self._begin, self._dt, self._steps = time.time_ns(), dt, 0
        self._every = max(1, round(PERIOD / dt))
        self._publisher = node.create_publisher(Clock, CLOCK, QoSProfile(depth=1))
        node.set_parameters([Parameter("use_sim_time", Parameter.Type.BOOL, True)])
        self._publish()

    @property
    def elapsed(self) -> float:
        """Simulated time since the beginning [s]."""
        return self._steps * self._dt

    @property
    def stamp(self) -> int:
        """The time that it shows [ns since 1970]."""
        return self._begin + round(1e9 * self._steps * self._dt)

    def pass_by(self) -> None:
        """Take note of a step, before it is made: what it leads to is at its end."""
        self._steps += 1
        if self._steps % self._every == 0:
            self._publish()

    def _publish(self) -> None:
        message = Clock()
        message.clock.sec, message.clock.nanosec = divmod(self.stamp, 10**9)
        self._publisher.publish(message)
