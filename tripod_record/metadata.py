"""The `metadata.yaml` that rosbag2 keeps beside a recording (its version 9)."""

import textwrap
from collections.abc import Sequence

from tripod_record.topic import Topic, qos_yaml

VERSION = 9
DISTRO = "jazzy"
NO_TIME = 2**63 - 1
"""Start of a recording without messages [ns]."""


def information_yaml(
    file: str, topics: Sequence[tuple[Topic, int]], start: int | None, end: int | None
) -> str:
    """Return rosbag2's description of a recording of one mcap file.

    Args:
        file: Name of the mcap file.
        topics: Topics with their numbers of messages.
        start: Stamp of the first message [ns since 1970]; None without messages.
        end: Stamp of the last message [ns since 1970]; None without messages.
    """
    first = NO_TIME if start is None else start
    duration = 0 if start is None or end is None else end - start
    count = sum(n for _, n in topics)
    span = f"duration:\n  nanoseconds: {duration}\nstarting_time:\n  nanoseconds_since_epoch: {first}\n"
    return (
        f"version: {VERSION}\n"
        "storage_identifier: mcap\n"
        f"{span}"
        f"message_count: {count}\n"
        f"{_topics_yaml(topics)}"
        'compression_format: ""\n'
        'compression_mode: ""\n'
        f"relative_file_paths:\n  - {_quoted(file)}\n"
        f"files:\n  - path: {_quoted(file)}\n"
        f"{textwrap.indent(span, '    ')}"
        f"    message_count: {count}\n"
        "custom_data: ~\n"
        f"ros_distro: {DISTRO}\n"
    )


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
