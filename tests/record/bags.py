"""Recordings for the tests of this directory, and the independent reader that judges them."""

import struct
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from mcap.writer import Writer
from rosbags.rosbag2 import Reader as RosbagsReader

from tripod_record.topic import Qos, Topic
from tripod_record.writer import BagWriter

START = 1_700_000_000_000_000_000  # [ns]
STRING = Topic("/chatter", "std_msgs/msg/String", "string data\n", (Qos(),), "RIHS01_" + "0" * 64)
LATCHED = Topic(
    "/mesh",
    "std_msgs/msg/String",
    "string data\n",
    (Qos(durability="transient_local"), Qos(reliability="best_effort")),
)


def cdr_string(text: str) -> bytes:
    data = text.encode() + b"\0"
    return b"\0\1\0\0" + struct.pack("<I", len(data)) + data


def write_some(writer: BagWriter, count: int, *, first: int = 0) -> None:
    """Write `count` messages on /chatter, 10 ms apart, and a tenth of that on /mesh."""
    for i in range(first, first + count):
        writer.write("/chatter", cdr_string(f"message {i}"), START + i * 10**7, sequence=i)
        if i % 10 == 0:
            writer.write("/mesh", cdr_string("x" * 1000), START + i * 10**7)


def new_bag(directory: Path, **options) -> BagWriter:
    writer = BagWriter(directory, **options)
    writer.add_topic(STRING)
    writer.add_topic(LATCHED)
    return writer


def read_with_rosbags(path: Path) -> dict[str, list[tuple[int, bytes]]]:
    """Return stamp and bytes of every message by topic, as the rosbags library reads them."""
    found: dict[str, list[tuple[int, bytes]]] = {}
    with RosbagsReader(path) as reader:
        for connection, stamp, data in reader.messages():
            found.setdefault(connection.topic, []).append((stamp, bytes(data)))
    return found


def string_of(data: bytes) -> str:
    """Return the text of a std_msgs/msg/String as CDR; rclpy pads it at the end."""
    (size,) = struct.unpack_from("<I", data, 4)
    return data[8 : 8 + size - 1].decode()


@dataclass(frozen=True)
class Foreign:
    """A topic as another program recorded it; `messages`: place [s] and CDR of each."""

    topic: str
    type: str
    messages: Iterable[tuple[float, bytes]]
    definition: str = "string data\n"
    definition_encoding: str = "ros2msg"
    encoding: str = "cdr"


def write_foreign(path: Path, *topics: Foreign) -> Path:
    """Write a recording with the `mcap` package, as other programs do, and return its path."""
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2", library="other")
        for one in topics:
            text = one.definition.encode()
            schema = writer.register_schema(one.type, one.definition_encoding, text) if one.type else 0
            channel = writer.register_channel(one.topic, one.encoding, schema)
            for place, data in one.messages:
                stamp = START + round(1e9 * place)
                writer.add_message(channel, stamp, data, stamp)
        writer.finish()
    return path
