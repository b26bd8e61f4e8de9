"""Writes one recording: a rosbag2 directory with an mcap file of raw CDR messages and its metadata.yaml."""

import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from mcap.writer import CompressionType, Writer

from tripod_record.append_file import AppendFile, sync_directory
from tripod_record.errors import RecordError
from tripod_record.metadata import information_yaml, metadata_yaml
from tripod_record.topic import Topic, qos_yaml

COMPRESSIONS = {"none": CompressionType.NONE, "lz4": CompressionType.LZ4, "zstd": CompressionType.ZSTD}
METADATA_PERIOD = 1.0
"""While recording, metadata.yaml is rewritten for new topics, and this often for the counts [s]."""


@dataclass
class _Channel:
    topic: Topic
    id: int
    count: int = 0
    kept: int = 0  # on the disk


class BagWriter:
    """A recording being written.

    Profile ros2, schemas as ros2msg text, messages as cdr, chunked with message indexes. Every `sync` ends
    the chunk and leaves a complete, readable file on the disk (see `AppendFile`); `close` adds the summary.

    Attributes:
        directory: Directory of the recording.
        path: The mcap file in it.
        messages: Messages given to `write`.
        kept: Those of them that are on the disk.
    """

    def __init__(self, directory: Path, *, compression: str = "zstd", chunk_size: int = 2**20) -> None:
        """Create `directory` (it must not exist) and begin.

        Args:
            directory: Its name is the name of the recording.
            compression: Of chunks: "none", "lz4" or "zstd".
            chunk_size: A chunk ends at this size [B], if not before.

        Raises:
            RecordError: unknown compression, or the directory exists or cannot be made.
        """
        if compression not in COMPRESSIONS:
            raise RecordError(f"compression {compression!r} is unknown; allowed: {', '.join(COMPRESSIONS)}")
        self.directory = directory
        self.path = directory / f"{directory.name}_0.mcap"
        self.messages = 0
        self.kept = 0
        self._channels: dict[str, _Channel] = {}
        self._schemas: dict[str, int] = {}
        self._start: int | None = None
        self._last = 0
        self._kept_last = 0
        self._metadata_due = 0.0
        try:
            directory.mkdir(parents=True)
            sync_directory(directory.parent)
            self._file = AppendFile(self.path)
        except OSError as error:
            raise RecordError(
                f"cannot create recording {directory}: {error.strerror}; choose another directory"
            ) from error
        # the library writes through `_file` only: nothing reaches the disk before a flush
        self._mcap = Writer(self._file, chunk_size=chunk_size, compression=COMPRESSIONS[compression])
        try:
            self._mcap.start(profile="ros2", library="tripod")
            self._add_information()
            self.sync()
        except OSError as error:
            self._file.abandon()
            self.path.unlink(missing_ok=True)
            directory.rmdir()
            raise RecordError(
                f"cannot write to {self.path}: {error.strerror}; choose another directory"
            ) from error

    def add_topic(self, topic: Topic) -> None:
        """Announce a topic before its first message; announcing it again with the same type changes nothing.

        Raises RecordError if its name is taken by another type.
        """
        if known := self._channels.get(topic.name):
            if known.topic.type != topic.type:
                raise RecordError(
                    f"topic {topic.name} is recorded as {known.topic.type}; {topic.type} was offered too"
                )
            return
        if topic.type not in self._schemas:
            self._schemas[topic.type] = self._mcap.register_schema(
                topic.type, "ros2msg", topic.definition.encode()
            )
        details = {"offered_qos_profiles": qos_yaml(topic.qos), "topic_type_hash": topic.type_hash}
        channel = self._mcap.register_channel(topic.name, "cdr", self._schemas[topic.type], details)
        self._channels[topic.name] = _Channel(topic, channel)
        self._metadata_due = 0.0

    def write(self, topic: str, data: bytes, stamp: int, *, publish_time: int = 0, sequence: int = 0) -> None:
        """Add one message.

        Args:
            topic: Name of a topic that was announced.
            data: The message as CDR with its four bytes of header.
            stamp: When it was received [ns since 1970]; one before its predecessor's becomes that, so that
                stamps never fall.
            publish_time: When it was sent [ns since 1970]; 0 if unknown, then `stamp` stands for it.
            sequence: The publisher's count, modulo 2^32; 0 if unknown.
        """
        channel = self._channels[topic]
        self._last = max(stamp, self._last)
        if self._start is None:
            self._start = self._last
        self._mcap.add_message(
            channel.id, self._last, data, publish_time or self._last, sequence & 0xFFFFFFFF
        )
        channel.count += 1
        self.messages += 1

    def sync(self) -> None:
        """End the chunk and wait until everything written so far is on the disk; raises OSError."""
        self._mcap.flush()
        self.kept, self._kept_last = self.messages, self._last
        for channel in self._channels.values():
            channel.kept = channel.count
        if time.monotonic() >= self._metadata_due:
            self._write_metadata()

    def close(self) -> None:
        """Finish file and metadata; raises OSError, and then what was synced stays as after `abandon`."""
        try:
            self.sync()
            self._add_information()
            self._mcap.finish()
            self._file.close()
        except OSError:
            self.abandon()
            raise
        self._write_metadata()

    def abandon(self) -> None:
        """Stop without a summary; what was synced stays, in a readable file."""
        self._file.abandon()
        with suppress(OSError):
            self._write_metadata()

    def _information(self) -> str:
        topics = [(c.topic, c.kept) for c in self._channels.values()]
        start, end = (self._start, self._kept_last) if self.kept else (None, None)
        return information_yaml(self.path.name, topics, start, end)

    def _add_information(self) -> None:
        # rosbag2 keeps its description in the file too, for files without their directory
        self._mcap.add_metadata("rosbag2", {"serialized_metadata": self._information()})

    def _write_metadata(self) -> None:
        target = self.directory / "metadata.yaml"
        new = self.directory / ".metadata.yaml.new"
        try:
            new.write_text(metadata_yaml(self._information()), encoding="utf-8")
            new.replace(target)  # atomic: a reader sees the old or the new text
        finally:
            new.unlink(missing_ok=True)
        self._metadata_due = time.monotonic() + METADATA_PERIOD
