"""Who publishes a topic already: two that publish the same would mix."""

import time
from collections import Counter, deque
from collections.abc import Collection, Mapping
from typing import Any

from rclpy.clock import Clock, ClockType

from tripod_graph.executor import Patient
from tripod_graph.qos import RELIABLE

DISCOVERY = 3.5
"""Time within which nodes of a graph find each other, unless the machine is very busy [s]: each announces itself every
three seconds."""

NAMELESS = "_NODE_NAME_UNKNOWN_"
"""What ROS calls a node whose topics are known sooner than its name."""


PERIOD = 1.0
"""Between two looks whether another node publishes the same [s]."""

STALE = 2.0
"""Time for which it is believed that messages of two publishers came in turns [s]."""


def publisher_elsewhere(
    node: Any, topics: Collection[str], patience: float = DISCOVERY
) -> tuple[str, str] | None:
    """Return a topic and the full name of another node that publishes it; None if nobody did for `patience` [s].

    Another node may have the name of this one. One whose name does not come in time is "another node".
    """
    deadline = time.monotonic() + patience
    while True:
        found = _elsewhere(node, topics)
        if found and NAMELESS not in found[1]:
            return found
        if time.monotonic() >= deadline:
            return found and (found[0], "another node")
        time.sleep(0.05)


def _elsewhere(node: Any, topics: Collection[str]) -> tuple[str, str] | None:
    full = node.get_fully_qualified_name()
    own = Counter((publisher.topic_name, full) for publisher in node.publishers)
    found = None
    for topic in topics:
        names = Counter(
            f"{p.node_namespace.rstrip('/')}/{p.node_name}" for p in node.get_publishers_info_by_topic(topic)
        )
        for name, count in names.items():
            if count > own[node.resolve_topic_name(topic), name]:
                found = topic, name
    return found


class Mix:
    """Tells whether several nodes publish a topic that a node hears; one whose place another has taken is none.

    Each publisher counts its messages: where another takes its place the numbers fall once, in turns again and again.
    """

    def __init__(self, node: Any, topic: str) -> None:
        self._node, self._topic = node, topic
        self._number = -1
        self._falls = deque([float("-inf")] * 2, maxlen=2)

    def hear(self, info: Mapping[str, Any]) -> None:
        """Take what the middleware tells of a message."""
        number = info["publication_sequence_number"] or 0  # not every middleware counts
        if number <= self._number:
            self._falls.append(time.monotonic())
        self._number = number

    @property
    def mixed(self) -> bool:
        """Whether several publish it now."""
        return time.monotonic() - self._falls[0] < STALE and self._node.count_publishers(self._topic) > 1


class Rival:
    """Warns, once, that another node publishes a topic of this one, which hears its own topic only while one may.

    Attributes:
        notice: What is wrong and what to do, empty while nothing is.
    """

    def __init__(self, node: Any, publisher: Any) -> None:
        """`publisher`: of a topic of `node` that others of its kind publish several times a second."""
        self._node, self._kind, self._topic = node, publisher.msg_type, publisher.topic_name
        self._mix, self._ear = Mix(node, self._topic), None
        self.notice = ""
        node.create_timer(PERIOD, self._look, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _look(self) -> None:
        several = self._node.count_publishers(self._topic) > 1
        if several and self._ear is None:
            self._ear = self._node.create_subscription(
                self._kind, self._topic, self._hear, RELIABLE, raw=True, callback_group=Patient()
            )
        elif self._ear is not None and not several:
            self._node.destroy_subscription(self._ear)
            self._ear, self.notice = None, ""
        if self._mix.mixed and not self.notice and (found := _elsewhere(self._node, [self._topic])):
            who = "another node" if NAMELESS in found[1] else f"another node {found[1]}"
            self.notice = (
                f"{who} publishes the same topics as this node, such as {self._topic}, so their data mix. "
                "Stop one, or give one another namespace (__ns:=/NAME) or ROS_DOMAIN_ID"
            )
            self._node.get_logger().warning(self.notice)

    def _hear(self, _: bytes, info: Mapping[str, Any]) -> None:
        self._mix.hear(info)
