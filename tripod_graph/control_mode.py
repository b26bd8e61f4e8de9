"""The topic `control_mode` in nodes: messages to decisions and back, the two clocks, what every status says of it."""

import time
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any, Protocol

from builtin_interfaces.msg import Time
from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.node import Node
from tripod_msgs.msg import Authority, ControlMode

from tripod_graph import names
from tripod_graph.authority import OperatorAuthority
from tripod_graph.mode import REMEMBERED, REPEAT, Decision, Mode, ModeTracker
from tripod_graph.qos import LATCHED, LATCHED_OF_ALL, RELIABLE

READ_TIME = 1e-3
"""Two clocks read at most this [s] after each other count as read at once."""

EARS = (LATCHED_OF_ALL, RELIABLE)
"""With which quality of service each node listens; those who keep their word are heard by both."""

SHOWN = 8
"""How many names of ignored sources a status carries."""


def clocks(node: Node) -> tuple[float, float]:
    """Return the node's clock, with which messages are stamped, and the steady one [s], read at once."""
    for _ in range(3):
        now = time.monotonic()
        wall = 1e-9 * node.get_clock().now().nanoseconds
        if time.monotonic() - now <= READ_TIME:
            break
    return wall, now


def listen(node: Node, hear: Callable[[Decision], None]) -> None:
    """Give every message on `control_mode` to `hear`, once. Subscribe it before the commands: the executor takes what
    waits in this order, and a command may follow its mode at once.

    There are two ears: one that asks for what was said before hears nothing of those who do not keep it, as
    `ros2 topic pub` unless told, whose STOP must be heard too; the other one hears nobody's last word.
    """
    heard: deque[tuple[int, int, str]] = deque(maxlen=REMEMBERED)

    def take(message: ControlMode, info: Mapping[str, Any]) -> None:
        said = info["source_timestamp"], message.mode, message.source
        if said not in heard:
            heard.append(said)
            hear(decision_of(message))

    for quality in EARS:
        node.create_subscription(ControlMode, names.CONTROL_MODE, take, quality)


class Decider(Protocol):
    """A `OperatorAuthority`, or what has one."""

    def decide(self, mode: Mode, wall: float, now: float) -> Decision | None:
        """Decide on `mode`; return what to publish, None where that is refused."""

    def due(self, wall: float, now: float) -> Decision | None:
        """Return what to publish now, if anything."""


class Speaker:
    """Publishes what an operator decides, and repeats it."""

    def __init__(self, node: Node, decider: Decider) -> None:
        """The node keeps the object."""
        self._node, self._decider = node, decider
        self._publisher = node.create_publisher(ControlMode, names.CONTROL_MODE, LATCHED)
        self._timer = node.create_timer(REPEAT, self.repeat, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def decide(self, mode: Mode) -> None:
        """Decide on `mode` and say so, unless the operator refuses."""
        decision = self._decider.decide(mode, *clocks(self._node))
        if decision is not None:
            self.say(decision)

    def say(self, decision: Decision) -> None:
        """Publish a decision of the operator."""
        self._publisher.publish(control_mode_message(decision))

    def is_heard_by(self, count: int) -> bool:
        """Return whether at least `count` nodes listen."""
        return bool(self._publisher.get_subscription_count() >= count * len(EARS))

    def leave(self, authority: OperatorAuthority, longest: float = 0.5) -> None:
        """Withdraw what `authority` has in force, if anything; wait for its arrival, at most `longest` [s]."""
        if authority.held:
            self.say(authority.leave(*clocks(self._node)))
            self.wait(longest)

    def wait(self, longest: float) -> None:
        """Wait until the last word has arrived, at most `longest` [s]."""
        self._publisher.wait_for_all_acked(Duration(seconds=longest))

    def repeat(self) -> None:
        """Say what is due now; the timer calls it."""
        due = self._decider.due(*clocks(self._node))
        if due is not None:
            self.say(due)


def decision_of(message: ControlMode) -> Decision:
    """Return what a message says."""
    stamp = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec
    return Decision(message.mode, message.source, stamp, message.lease)


def control_mode_message(decision: Decision) -> ControlMode:
    """Return a decision as a message."""
    message = ControlMode(mode=int(decision.mode), source=decision.source, lease=float(decision.lease))
    message.header.stamp = time_of(decision.stamp)
    return message


def authority_message(tracker: ModeTracker) -> Authority:
    """Return who is in charge, for a status."""
    decisions, commands = tracker.ignored, tracker.ignored_commands
    return Authority(
        mode=int(tracker.mode),
        source=tracker.source,
        stamp=time_of(tracker.stamp),
        lost=tracker.lost,
        ignored_decisions=decisions.count,
        last_ignored_decision=decisions.last,
        ignored_commands=commands.count,
        last_ignored_command=commands.last,
        ignored_sources=list(commands.sources)[-SHOWN:],
    )


def authority_values(tracker: ModeTracker) -> dict[str, object]:
    """Return who is in charge, for diagnostics."""
    decisions, commands = tracker.ignored, tracker.ignored_commands
    ignored = ", ".join(
        f"{name or 'nobody named'} {n}" for name, n in list(commands.sources.items())[-SHOWN:]
    )
    return {
        "control mode": tracker.mode.name,
        "decided by": tracker.source,
        "ignored decisions": decisions.count,
        "last ignored decision": decisions.last,
        "ignored commands": commands.count,
        "ignored sources": ignored,
    }


def time_of(seconds: float) -> Time:
    """Return an instant [s] as a message; what a message cannot hold becomes the nearest."""
    ticks = round(1e9 * min(max(seconds, 0.0), 2.0**31 - 1.0))
    return Time(sec=ticks // 10**9, nanosec=ticks % 10**9)
