"""Publishes what was recorded, at the pace at which it was, as `ros2 bag play` does."""

import re
import time
from array import array
from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosbags.interfaces import Nodetype
from rosbags.serde import SerdeError
from rosbags.typesys.store import Typestore

from tripod_graph.liveliness import publisher_elsewhere
from tripod_graph.names import CONTROL_MODE, JOINT_TRAJECTORY, SIM_REQUEST, TARGET_POSE
from tripod_graph.transport import Transport
from tripod_record.bag import Bag, Heard, decoded, recorded_types, store_of
from tripod_record.definitions import SEPARATOR, definition_text, message_class
from tripod_record.errors import RecordError
from tripod_record.info import printable
from tripod_record.selection import ALWAYS

PERIOD = 0.005
"""Time between two looks at what is due [s]."""

DEPTH = 100
"""Messages of a topic that may wait for the middleware, and of a latched one that are kept for who comes late."""

Convert = Callable[[bytes | memoryview], bytes]
"""Turns a message as it was recorded into one of the type that is installed."""

OF_EVERY_NODE = ("/rosout", "/parameter_events")
"""Topics that every node publishes, the player itself, too: only played where they are named."""

COMMANDING = (JOINT_TRAJECTORY, CONTROL_MODE, TARGET_POSE, SIM_REQUEST)
"""Topics that could move a robot, or ask a simulator for something: only played where they are named."""


class TopicPlayer(Node):
    """Publishes the bytes of recorded messages.

    Attributes:
        done: Why it has ended, empty while it has not.
        duration: Of the recording [s].
        waiting: What it waits for: nothing.
    """

    waiting = ""

    def __init__(self, bag: Bag, wanted: Callable[[str], bool], *, start: float, rate: float) -> None:
        """`wanted`: which topics; `start` [s]. Raises RecordError if there are none, or others publish on them."""
        super().__init__("bag_play")
        self.done, self.duration = "", bag.info.duration
        self._bag, self._offset, self._count = bag, start, 0
        self._played: dict[str, Publisher] = {}
        self._convert: dict[str, Convert] = {}
        self._latched: dict[str, deque[Heard]] = {}
        self._messages = bag.messages(wanted)
        self._topics = [t for t in bag.topics if wanted(t)]
        if not self._topics:
            raise RecordError(
                f"{bag.info.path} has no message on the requested topics; `tripod bag info` lists what it has"
            )
        self._next: Heard | None = next(self._messages, None)
        self._check_others()
        for topic in self._topics:
            self._offer(topic)
        if not self._played:
            raise RecordError(
                f"{bag.info.path} has no topic whose message type is installed here in the recorded version; "
                "source the workspace with which it was recorded"
            )
        self._skip_to_start()
        self._transport = Transport(start, rate, time.monotonic())
        self.create_timer(PERIOD, self._on_timer, clock=Clock(clock_type=ClockType.STEADY_TIME))

    @property
    def paused(self) -> bool:
        """Whether it stands still."""
        return self._transport.paused

    @property
    def place(self) -> float:
        """Place in the recording [s]."""
        return min(self._transport.place(time.monotonic()), self.duration)

    def toggle(self) -> None:
        """Pause, or go on."""
        self._transport.toggle(time.monotonic())

    def step(self) -> None:
        """While paused: publish the next message."""
        if self.paused and self._next:
            self._transport.move(self._time(self._next), time.monotonic())

    def close(self) -> None:
        """Leave the graph."""
        self.destroy_node()

    def _time(self, heard: Heard) -> float:
        return 1e-9 * (heard.log_time - self._bag.start)

    def _check_others(self) -> None:
        if found := publisher_elsewhere(
            self, [t for t in self._topics if t not in ALWAYS and t not in OF_EVERY_NODE]
        ):
            topic, who = found
            raise RecordError(
                f"{who} already publishes {printable(topic)}, and their messages would mix: stop it, or "
                "choose other --topics"
            )

    def _offer(self, topic: str) -> None:
        channel = self._bag.channel(topic)
        try:
            kind = message_class(channel.type)
            convert = conversion(channel.type, recorded_types(channel))
            if convert is None:
                raise RecordError(
                    f"the fields of its type {printable(channel.type)} were others when it was recorded; install "
                    "the version of that time"
                )
        except RecordError as error:
            self.get_logger().warning(f"{printable(topic)} is not played: {error}")
            return
        reliable = "best_effort" not in channel.qos
        latched = bool(re.search(r"durability: (transient_local|1\b)", channel.qos))
        profile = QoSProfile(
            depth=DEPTH,
            reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
            durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
        )
        self._played[topic], self._convert[topic] = self.create_publisher(kind, topic, profile), convert
        if latched:
            depths = [int(d) for d in re.findall(r"depth: (\d{1,6})", channel.qos)]
            self._latched[topic] = deque(maxlen=min(max(1, *depths, len(depths)), DEPTH) if depths else 1)

    def _skip_to_start(self) -> None:
        """Publish what a late joiner would have heard at the start."""
        while self._next and self._time(self._next) < self._offset:
            if self._next.topic in self._latched:
                self._latched[self._next.topic].append(self._next)
            self._next = next(self._messages, None)
        for waiting in self._latched.values():
            for heard in waiting:
                self._publish(heard)

    def _publish(self, heard: Heard) -> None:
        if not (publisher := self._played.get(heard.topic)):
            return
        try:
            publisher.publish(self._convert[heard.topic](heard.data))
            self._count += 1
        except SerdeError as error:
            self.get_logger().warning(f"a message of {printable(heard.topic)} is not played: {error}")

    def _on_timer(self) -> None:
        place = self._transport.place(time.monotonic())
        while self._next and self._time(self._next) <= place:
            self._publish(self._next)
            self._next = next(self._messages, None)
        if self._next is None and not self.done:
            self.done = f"played {self._count} messages"


def conversion(kind: str, old: Typestore) -> Convert | None:
    """Return what turns a message of the type `kind` as it was recorded (`old`) into one of the installed type.

    None where it had other fields. Fields that have been added since get their default value, if their definition
    names one: it says what is true of a message that does not tell.

    Raises RecordError if the installed definition cannot be read.
    """
    text = definition_text(kind)
    new = store_of(kind, text)
    if old.hash_rihs01(kind) == new.hash_rihs01(kind):
        return bytes
    was, fields = (dict(store.fielddefs[kind][1]) for store in (old, new))
    parts = _parts(old, kind)
    same = all(part in new.fielddefs and old.hash_rihs01(part) == new.hash_rihs01(part) for part in parts)
    added = fields.keys() - was.keys()
    own = text.partition(SEPARATOR)[0]
    if not (same and was.items() <= fields.items() and all(_has_default(own, name) for name in added)):
        return None
    message = message_class(kind)()
    blank = {name: getattr(message, name) for name in added}
    more = {name: np.asarray(v) if isinstance(v, array) else v for name, v in blank.items()}

    def convert(data: bytes | memoryview) -> bytes:
        found = decoded(old, bytes(data), kind)
        values = {name: getattr(found, name) for name in was}
        return bytes(new.serialize_cdr(new.types[kind](**values, **more), kind))

    return convert


def _parts(store: Typestore, kind: str) -> set[str]:
    """Return the names of the message types that the fields of type `kind` hold, at any depth."""
    found: set[str] = set()
    waiting: list[Any] = [fields for _, fields in store.fielddefs[kind][1]]
    while waiting:
        nodetype, what = waiting.pop()
        if nodetype == Nodetype.NAME:
            if what not in found:
                found.add(what)
                waiting += [fields for _, fields in store.fielddefs[what][1]]
        elif nodetype in (Nodetype.ARRAY, Nodetype.SEQUENCE):
            waiting.append(what[0])
    return found


def _has_default(text: str, name: str) -> bool:
    """Return whether a field of a definition has a default value.

    A sequence cannot have an empty one; there the comment says "empty: not told".
    """
    field = rf"^\s*\S+\s+{re.escape(name)}[ \t]+"
    return bool(re.search(rf"{field}([^\s#=]|#.*empty: not told)", text, re.MULTILINE))
