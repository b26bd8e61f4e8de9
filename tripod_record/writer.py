"""Writes one recording: a rosbag2 directory with mcap files of raw CDR messages and their metadata.yaml."""

import os
import stat
import time
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from mcap.records import Attachment, Channel, Header, Metadata, Schema

from tripod_record.append_file import MAGIC, AppendFile, make_private_directory
from tripod_record.chunk import COMPRESSIONS, ChunkBuilder, encoded
from tripod_record.errors import FileLostError, RecordError
from tripod_record.metadata import Part, information_yaml, metadata_yaml
from tripod_record.structure import Structure, read_structure
from tripod_record.summary_records import end_of_file
from tripod_record.topic import Topic, qos_yaml

METADATA_PERIOD = 1.0
"""While recording, metadata.yaml is rewritten for new topics, and this often for the counts [s]."""


@dataclass
class _Recorded:
    topic: Topic
    schema: Schema
    channel: Channel
    count: int = 0  # in the present file
    kept: int = 0  # of these on the disk
    published: int = 0


class BagWriter:
    """A recording being written.

    Profile ros2, schemas as ros2msg text, messages as cdr, chunked with message indexes. Every `sync` ends
    the chunk and leaves a complete, readable file on the disk (see `AppendFile`); `close` adds the summary, which it
    reads from the file: nothing of the past stays in memory, and the counts are those of what is there. `split` does so
    too and goes on in a new file of the same directory.

    Attributes:
        directory: Directory of the recording.
        path: The mcap file in it that is being written.
        messages: Messages given to `write`, without those that were lost with a part of the file.
        kept: Those of them that are on the disk.
    """

    def __init__(self, directory: Path, *, compression: str = "zstd", chunk_size: int = 2**20) -> None:
        """Create `directory` (it must not exist) for its owner only, and begin.

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
        self._parts: list[
            tuple[Part, dict[str, int]]
        ] = []  # the files before the present one; messages by topic
        self._attached: dict[str, Attachment] = {}
        self.path = _file_in(directory, 0)
        self.messages = 0
        self.kept = 0
        self._recorded: dict[str, _Recorded] = {}
        self._schemas: dict[str, Schema] = {}
        self._chunk, self._chunk_size = ChunkBuilder(compression), chunk_size
        self._start: int | None = None
        self._last = 0
        self._kept_last = 0
        self._metadata_due = 0.0
        try:
            make_private_directory(directory)
            self._file = AppendFile(self.path)
        except OSError as error:
            raise RecordError(
                f"cannot create recording {directory}: {error.strerror}; choose another directory"
            ) from error
        try:
            self._file.write(self._head())
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
        if known := self._recorded.get(topic.name):
            if known.topic.type != topic.type:
                raise RecordError(
                    f"topic {topic.name} is recorded as {known.topic.type}, but is also published as "
                    f"{topic.type}; only the first is recorded"
                )
            return
        if (schema := self._schemas.get(topic.type)) is None:
            schema = Schema(
                id=len(self._schemas) + 1,
                name=topic.type,
                encoding="ros2msg",
                data=topic.definition.encode(),
            )
            self._schemas[topic.type] = schema
            self._chunk.describe(schema)
        channel = Channel(
            id=len(self._recorded) + 1,
            topic=topic.name,
            message_encoding="cdr",
            schema_id=schema.id,
            metadata={"offered_qos_profiles": qos_yaml(topic.qos), "topic_type_hash": topic.type_hash},
        )
        self._chunk.describe(channel)
        self._recorded[topic.name] = _Recorded(topic, schema, channel)
        self._metadata_due = 0.0

    def write(self, topic: str, data: bytes, stamp: int, *, publish_time: int = 0, sequence: int = 0) -> None:
        """Add one message.

        Args:
            topic: Name of a topic that was announced.
            data: The message as CDR with its four bytes of header.
            stamp: When it was received [ns since 1970]; one before its predecessor's becomes that, so that
                stamps never fall.
            publish_time: When it was sent [ns since 1970]; 0 if unknown, then `stamp` stands for it. It neither
                falls within a topic nor exceeds `stamp`.
            sequence: The publisher's count, modulo 2^32; 0 if unknown.
        """
        recorded = self._recorded[topic]
        self._last = max(stamp, self._last)
        if self._start is None:
            self._start = self._last
        recorded.published = max(min(publish_time or self._last, self._last), recorded.published)
        self._chunk.add_message(
            recorded.channel.id, sequence & 0xFFFFFFFF, self._last, recorded.published, data
        )
        recorded.count += 1
        self.messages += 1
        if self._chunk.size > self._chunk_size:
            self._file.write(self._chunk.end())

    def attach(self, name: str, data: bytes, stamp: int, *, media_type: str = "text/plain") -> None:
        """Add a file of its own to the recording, and to each file of it that follows; a new one of the same name comes
        after the old one. `stamp`: when it was known [ns since 1970].
        """
        known = self._attached.get(name)
        if known and known.data == data:
            return
        self._attached[name] = Attachment(stamp, stamp, name, media_type, data)
        if chunk := self._chunk.end():
            self._file.write(chunk)
        self._file.write(encoded(self._attached[name]))

    @property
    def size(self) -> int:
        """Size of the present file [B], a chunk that is not written yet as if it were not compressed."""
        return self._file.tell() + self._chunk.size

    @property
    def duration(self) -> float:
        """Time from the first to the last message of the present file [s]."""
        return 0.0 if self._start is None else (self._last - self._start) / 1e9

    def split(self) -> None:
        """Finish the present file, if it has messages, and go on in the next. Raises as `sync`: then it stays."""
        self.sync()
        if self._start is None:
            return
        path = _file_in(self.directory, len(self._parts) + 1)
        new = AppendFile(path)
        try:
            self._finish()
        except BaseException:
            new.abandon()
            path.unlink(missing_ok=True)
            raise
        self._parts.append((self._part(), {name: r.kept for name, r in self._recorded.items()}))
        self.path, self._file, self._start = path, new, None
        for recorded in self._recorded.values():
            recorded.count = recorded.kept = 0
        self._file.write(self._head() + encoded(*self._attached.values()))
        for record in (*self._schemas.values(), *(r.channel for r in self._recorded.values())):
            self._chunk.describe(record)
        self._metadata_due = 0.0
        self.sync()

    def sync(self) -> None:
        """End the chunk and wait until everything written so far is on the disk.

        Raises:
            FileLostError: the file is not there any more as it was written; see `rescue`.
            OSError: the disk does not take it; it waits for the next `sync`.
        """
        if chunk := self._chunk.end():
            self._file.write(chunk)
        self._file.flush()
        for recorded in self._recorded.values():
            recorded.kept = recorded.count
        self.kept, self._kept_last = self.messages, self._last
        if time.monotonic() >= self._metadata_due:
            self._write_metadata()

    def rescue(self, directory: Path) -> int:
        """Go on in a new file in the new `directory`, with what can still be read of the present one.

        The files before it go along, as far as they are still there. Returns how many messages that were on the disk
        are lost. Raises OSError if it cannot be done; then nothing has changed.
        """
        path = _file_in(directory, len(self._parts))
        make_private_directory(directory)
        given = self.messages
        again = encoded(*self._schemas.values(), *(r.channel for r in self._recorded.values()))
        head = self._head() + encoded(*self._attached.values())
        if chunk := self._chunk.end():
            self._file.write(chunk)
        try:
            self._file.rescue(path, lambda fd, size: self._structure(fd, size).end, head, again)
        except OSError:
            directory.rmdir()
            raise
        self._take_along(directory)
        self.directory, self.path = directory, path
        found = self._structure(self._file.descriptor, self._file.size)
        for recorded in self._recorded.values():
            recorded.count = recorded.kept = found.counts.get(recorded.channel.id, 0)
        self.messages = self.kept = found.messages + sum(part.messages for part, _ in self._parts)
        self._start, self._kept_last = found.start, found.last or 0
        self._metadata_due = 0.0
        return given - self.messages

    def close(self) -> None:
        """Finish file and metadata; raises as `sync` does, and then what was synced stays as after `abandon`.

        Raises:
            RecordError: less can be read from the file than was written to it.
        """
        self.sync()
        self._finish()
        self._write_metadata()

    def _finish(self) -> None:
        """Write the end of the present file, in which all is synced."""
        self._file.write(encoded(self._information_record()))
        self._file.flush()
        found = self._structure(self._file.descriptor, self._file.size)
        if found.messages != self._part().messages or found.end != self._file.size:
            raise FileLostError("was changed by another program")
        channels = [recorded.channel for recorded in self._recorded.values()]
        self._file.write(end_of_file(self._file.size, found, list(self._schemas.values()), channels))
        self._file.close()

    def _take_along(self, directory: Path) -> None:
        """Let the files before the present one stand in `directory`, too; forget those that are gone."""
        kept = []
        for number, (part, counts) in enumerate(self._parts):
            path = _file_in(directory, number)
            with suppress(OSError):
                os.link(self.directory / part.file, path)
                kept.append((replace(part, file=path.name), counts))
        self._parts = kept

    def abandon(self) -> None:
        """Stop without a summary; what was synced stays, in a readable file."""
        self._file.abandon()
        with suppress(OSError):
            self._write_metadata()

    def _structure(self, fd: int, size: int) -> Structure:
        return read_structure(fd, size, since=self._start or 0)

    def _head(self) -> bytes:
        header = Header(profile="ros2", library="tripod")
        return MAGIC + encoded(header, self._information_record())

    def _information(self) -> str:
        topics = [
            (r.topic, r.kept + sum(counts.get(name, 0) for _, counts in self._parts))
            for name, r in self._recorded.items()
        ]
        return information_yaml([*(part for part, _ in self._parts), self._part()], topics)

    def _part(self) -> Part:
        count = sum(recorded.kept for recorded in self._recorded.values())
        return Part(self.path.name, count, *((self._start, self._kept_last) if count else (None, None)))

    def _information_record(self) -> Metadata:
        # rosbag2 keeps its description in the file too, for files without their directory
        return Metadata(name="rosbag2", metadata={"serialized_metadata": self._information()})

    def _write_metadata(self) -> None:
        target = self.directory / "metadata.yaml"
        new = self.directory / ".metadata.yaml.new"
        try:
            _write_private(new, metadata_yaml(self._information()))
            new.replace(target)  # atomic: a reader sees the old or the new text
        finally:
            new.unlink(missing_ok=True)
        self._metadata_due = time.monotonic() + METADATA_PERIOD


def _file_in(directory: Path, number: int) -> Path:
    return directory / f"{directory.name}_{number}.mcap"


def _write_private(path: Path, text: str) -> None:
    path.unlink(missing_ok=True)
    fd = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, stat.S_IRUSR | stat.S_IWUSR)
    with os.fdopen(fd, "w", encoding="utf-8") as file:
        file.write(text)
