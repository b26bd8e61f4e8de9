"""The `metadata.yaml` that rosbag2 keeps beside a recording (its version 9)."""

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass

from tripod_record.topic import Topic, qos_yaml

VERSION = 9
DISTRO = "jazzy"
NO_TIME = 2**63 - 1
"""Start of a recording without messages [ns]."""


@dataclass(frozen=True)
class Part:
    """One file of a recording.

    Attributes:
        file: Its name.
        messages: How many it has.
        start: Stamp of the first message [ns since 1970]; None without messages.
        end: Stamp of the last message [ns since 1970]; None without messages.
    """

    file: str
    messages: int
    start: int | None
    end: int | None

    @property
    def span(self) -> str:
        """Return rosbag2's words for its time."""
        return _span(self.start, self.end)


def information_yaml(parts: Sequence[Part], topics: Sequence[tuple[Topic, int]]) -> str:
    """Return rosbag2's description of a recording: its files in their order, topics with their numbers of messages."""
    count = sum(n for _, n in topics)
    span = _span(
        next((p.start for p in parts if p.start is not None), None),
        next((p.end for p in reversed(parts) if p.end is not None), None),
    )
    files = "".join(
        f"  - path: {_quoted(p.file)}\n{textwrap.indent(p.span, '    ')}    message_count: {p.messages}\n"
        for p in parts
    )
    return (
        f"version: {VERSION}\n"
        "storage_identifier: mcap\n"
        f"{span}"
        f"message_count: {count}\n"
        f"{_topics_yaml(topics)}"
        'compression_format: ""\n'
        'compression_mode: ""\n'
        "relative_file_paths:\n" + "".join(f"  - {_quoted(p.file)}\n" for p in parts) + f"files:\n{files}"
        "custom_data: ~\n"
        f"ros_distro: {DISTRO}\n"
    )


def _span(start: int | None, end: int | None) -> str:
    first = NO_TIME if start is None else start
    duration = 0 if start is None or end is None else end - start
    return f"duration:\n  nanoseconds: {duration}\nstarting_time:\n  nanoseconds_since_epoch: {first}\n"


def metadata_yaml(information: str) -> str:
    """Return the text of `metadata.yaml` with that description."""
    return "rosbag2_bagfile_information:\n" + textwrap.indent(information, "  ")


def _topics_yaml(topics: Sequence[tuple[Topic, int]]) -> str:
    if not topics:
        return "topics_with_message_count: []\n"
    lines = ["topics_with_message_count:"]
    for topic, count in topics:
        lines += [
            "  - topic_metadata:",
            f"      name: {_quoted(topic.name)}",
            f"      type: {_quoted(topic.type)}",
            "      serialization_format: cdr",
            "      offered_qos_profiles:" + ("" if topic.qos else " []"),
            *([qos_yaml(topic.qos, " " * 8)] if topic.qos else []),
            f"      type_description_hash: {_quoted(topic.type_hash)}",
            f"    message_count: {count}",
        ]
    return "\n".join(lines) + "\n"


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
