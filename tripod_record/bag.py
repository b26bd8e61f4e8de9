"""A recording as a sequence of messages, decoded by the definitions that it carries itself: no ROS is needed."""

import math
import re
import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.base import TypesysError
from rosbags.typesys.store import Typestore

from tripod_record.definitions import definition_text
from tripod_record.errors import RecordError
from tripod_record.info import BagInfo, printable, read_info
from tripod_record.reading import NO_SCHEMA, NOT_CLOSED, Channel, Reader

IDL_HEAD = re.compile(r"^={80}\nIDL: .*\n", re.MULTILINE)
"""What stands before each type of an IDL definition in an mcap file."""

IDL_INCLUDE = re.compile(r"^[ \t]*#.*$", re.MULTILINE)
"""A line for the preprocessor: the included types follow in the same definition."""


@dataclass(frozen=True)
class Heard:
    """A recorded message.

    Attributes:
        topic: Full name.
        log_time: When it was received [ns since 1970].
        data: The message as CDR with its four bytes of header.
    """

    topic: str
    log_time: int
    data: memoryview


class Bag:
    """A recording of ROS 2.

    Attributes:
        info: What is in it.
        unread: What could not be read of it so far, one line for each place, and whether that was told.
        damaged: Whether any of that is damage, not only a file that ends too early.
        span: Log times of the messages that are read: from the first on, before the second [ns].
    """

    def __init__(self, path: str | Path) -> None:
        """Look into an mcap file, or the directory of a recording. Raises RecordError."""
        self.info: BagInfo = read_info(path)
        self.unread: dict[str, bool] = {}
        self.damaged = False
        self.span = (-math.inf, math.inf)
        self._channels: dict[str, Channel] = {}
        self._decoders: dict[str, Callable[[bytes], Any]] = {}

    @cached_property
    def topics(self) -> tuple[str, ...]:
        """Names of the topics that have messages."""
        return tuple(t.name for t in self.info.topics if t.count)

    @property
    def start(self) -> int:
        """Stamp of the first message [ns since 1970]; 0 without messages."""
        return self.info.start or 0

    def messages(self, wanted: Callable[[str], bool] = lambda _: True) -> Iterator[Heard]:
        """Yield the messages of the wanted topics that can be read, in the order of the files. Raises RecordError."""
        for file in self.info.files:
            reader = Reader(Path(file))
            chosen: dict[int, bool] = {}
            try:
                for message in reader.messages():
                    channel = reader.channels[message.channel]
                    if message.channel not in chosen:
                        chosen[message.channel] = wanted(channel.topic)
                        self._channels.setdefault(channel.topic, channel)
                    if chosen[message.channel] and self.span[0] <= message.log_time < self.span[1]:
                        yield Heard(channel.topic, message.log_time, message.data)
            finally:
                self._note(reader)

    def _note(self, reader: Reader) -> None:
        """Keep what could not be read; that a recorder was killed costs nothing that was in the file."""
        torn = [reader.truncated] if reader.truncated not in ("", NOT_CLOSED) else []
        for line in (*reader.damage, *torn):
            self.unread.setdefault(f"{reader.path}: {line}", False)
        self.damaged |= bool(reader.damage)

    def left_out(self) -> str:
        """Return in one line what could not be read and was not told yet, and count it as told; empty: nothing."""
        first, *others = [line for line, told in self.unread.items() if not told] or [""]
        self.unread = dict.fromkeys(self.unread, True)
        more = f" (and {len(others)} more)" if others else ""
        return f"left out, because it cannot be read: {printable(first)}{more}" if first else ""

    @contextmanager
    def accounted(self) -> Iterator[None]:
        """Let what is refused within also tell what could not be read: that may be why."""
        try:
            yield
        except ValueError as error:
            if left := self.left_out():
                error.args = (f"{error}; {left}",)
            raise

    def channel(self, topic: str) -> Channel:
        """Return type, definition and quality of service of a topic that has messages. Raises RecordError."""
        if topic not in self._channels:
            next(self.messages(topic.__eq__), None)
        return self._channels[topic]

    def can_decode(self, topic: str) -> bool:
        """Return whether the messages of a topic can be decoded; what cannot is noted in `unread`."""
        next(self.messages(topic.__eq__), None)
        if topic not in self._channels:  # the summary names it, but no message of it can be read
            return False
        try:
            self._decoders.setdefault(topic, self._decoder(self._channels[topic]))
        except RecordError as error:
            self.unread.setdefault(str(error), False)
            return False
        return True

    def decoded(self, heard: Heard) -> Any:
        """Return a message with its fields as attributes, arrays of numbers as numpy arrays.

        Raises RecordError if it, or the definition of its type, cannot be read.
        """
        if heard.topic not in self._decoders:
            self._decoders[heard.topic] = self._decoder(self._channels[heard.topic])
        try:
            return self._decoders[heard.topic](bytes(heard.data))
        except (SerdeError, struct.error, AssertionError, IndexError, KeyError, ValueError) as error:
            raise RecordError(f"a message of {printable(heard.topic)} cannot be read: {error}") from None

    @staticmethod
    def _decoder(channel: Channel) -> Callable[[bytes], Any]:
        store = recorded_types(channel)
        return lambda data: decoded(store, data, channel.type)


def recorded_types(channel: Channel) -> Typestore:
    """Return what reads the messages of a channel.

    It goes by the recorded definition (.msg or IDL). Where none was recorded, as rosbag2 does for a type whose
    definition it does not find, it goes by the installed type, or by that of ROS 2 Jazzy.

    Raises:
        RecordError: the topic is not one of ROS 2, or its definition is neither recorded nor installed, or cannot be
            read.
    """
    topic, schema = printable(channel.topic), channel.schema
    if channel.encoding != "cdr":
        raise RecordError(
            f"topic {topic} has messages in the encoding {printable(channel.encoding)!r}; only 'cdr', "
            "which ROS 2 writes, can be read"
        )
    if schema is NO_SCHEMA:
        raise RecordError(f"topic {topic} was recorded without a message type")
    if schema.encoding in ("ros2msg", "ros2idl"):
        try:
            return store_of(schema.name, schema.definition, schema.encoding)
        except RecordError as error:
            raise RecordError(f"{error} (type of topic {topic})") from None
    if schema.definition:
        raise RecordError(
            f"topic {topic} has its definition as {printable(schema.encoding)!r}; only .msg and IDL can "
            "be read"
        )
    known = get_typestore(Stores.ROS2_JAZZY)
    if schema.name in known.fielddefs:
        return known
    try:
        return store_of(schema.name, definition_text(schema.name))
    except RecordError as error:
        raise RecordError(
            f"the definition of topic {topic} was not recorded, and its {printable(str(error))}"
        ) from None


def store_of(kind: str, definition: str, encoding: str = "ros2msg") -> Typestore:
    """Return what reads messages of the type `kind` by its definition, in .msg or, as "ros2idl", in IDL.

    Raises RecordError if the definition cannot be read.
    """
    store = get_typestore(Stores.EMPTY)
    try:
        if encoding == "ros2idl":
            for text in IDL_HEAD.split(IDL_INCLUDE.sub("", definition)):
                if text.strip():
                    store.register(get_types_from_idl(text))
            store.fielddefs[kind]  # KeyError: it describes other types only
        else:
            store.register(get_types_from_msg(definition, kind))
    except (TypesysError, AssertionError, KeyError, ValueError) as error:
        what = f"the definition of {printable(kind)}"
        raise RecordError(f"{what} cannot be read: {printable(str(error))}") from None
    return store


def decoded(store: Typestore, data: bytes, kind: str) -> Any:
    """Return a message of the type `kind`; raises SerdeError if it cannot be read."""
    try:
        return store.deserialize_cdr(data, kind)
    except SerdeError:  # what ends with an empty sequence may be padded to 8 bytes, which rosbags refuses
        return store.deserialize_cdr(data[:-4], kind)
