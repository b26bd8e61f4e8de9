"""Reads mcap files that may be torn, damaged or hostile: record by record, in bounded memory.

`mcap.reader` wants whole files and trusts their lengths; what a lost battery leaves is read here.
"""

import io
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

import lz4.frame  # type: ignore[import-untyped]
import zstandard
from mcap.opcode import Opcode

from tripod_host.reading import open_file
from tripod_record.append_file import MAGIC
from tripod_record.errors import RecordError
from tripod_record.fields import Fields
from tripod_record.next_chunk import next_chunk

LARGEST_FILE = 2**43
"""Longest file that is looked into [B]; it is read piece by piece."""
RECORD_LIMIT = 2**27
"""Largest record and largest chunk that is read [B]."""
UNPACKED_FREE, UNPACKED_RATIO = 2**29, 100
"""What chunks may unpack to in all [B], and besides, for each byte of the file; what exceeds it is made to do harm."""
RECORDS_FREE, BYTES_A_RECORD = 500_000, 4
"""Records that are read of any file, and besides, one for so many bytes of it: unpacked, a message has 31 or more."""
DEFINITION_LIMIT = 2**20
"""Longest definition of a type that is believed [B]."""
CHANNEL_LIMIT = 10_000
"""Most channels that are believed."""
NOT_CLOSED = (
    "the recording was not closed: it is still running, or its recorder was killed or had no "
    "disk space; the end is missing"
)

_RECORD = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<HIQQ")


class ExcessError(RecordError):
    """A file that would take time and memory out of proportion to its size."""


@dataclass(frozen=True)
class Schema:
    """A message type: its name, the encoding of its definition ("ros2msg", "ros2idl", "" for none) and that itself."""

    name: str
    encoding: str
    definition: str


NO_SCHEMA = Schema("unknown", "", "")
"""Of messages that were recorded without a type."""


@dataclass(frozen=True)
class Channel:
    """A topic in a file: its full name, type, encoding of its messages and rosbag2's text of the QoS offered."""

    topic: str
    schema: Schema
    encoding: str
    qos: str

    @property
    def type(self) -> str:
        """Name of the message type."""
        return self.schema.name


@dataclass(frozen=True)
class Message:
    """A message: channel in the file, when it was received and sent [ns since 1970], its bytes."""

    channel: int
    log_time: int
    publish_time: int
    data: memoryview


@dataclass
class Reader:
    """One mcap file, read from its start as far as it can be.

    Attributes:
        path: The file.
        profile: "ros2" for recordings of ROS 2.
        library: What wrote it.
        channels: Channels by their number, those met so far.
        attachments: Names of files that are attached, those met so far.
        compressions: Compressions of the chunks met so far; "none" for no compression.
        truncated: Where the file ends too early, empty if it does not.
        damage: What could not be read, one line for each place.
    """

    path: Path
    profile: str = ""
    library: str = ""
    channels: dict[int, Channel] = field(default_factory=dict)
    attachments: set[str] = field(default_factory=set)
    compressions: set[str] = field(default_factory=set)
    truncated: str = ""
    damage: list[str] = field(default_factory=list)
    _schemas: dict[int, Schema] = field(default_factory=dict)
    _unpacked_left: float = float("inf")
    _records_left: float = float("inf")

    def messages(self) -> Iterator[Message]:
        """Yield every message that can be read, in the order of the file.

        The end of a torn file and damaged chunks are noted in `truncated` and `damage`, not raised. What is recorded
        while the file is read is left out.

        Raises:
            RecordError: the file cannot be opened or is no mcap file.
        """
        with open_mcap(self.path) as file:
            yield from self._messages(file)

    def _messages(self, file: BinaryIO) -> Iterator[Message]:
        size = file.seek(0, io.SEEK_END)
        at = file.seek(len(MAGIC))
        self._unpacked_left = UNPACKED_FREE + UNPACKED_RATIO * size
        self._records_left = RECORDS_FREE + size // BYTES_A_RECORD
        in_summary = False
        while True:
            head = file.read(_RECORD.size)
            if len(head) < _RECORD.size:
                self.truncated = f"the file ends at byte {size} without an end mark"
                return
            opcode, length = _RECORD.unpack(head)
            if length > min(size - at - _RECORD.size, RECORD_LIMIT) or opcode == 0:
                begin = None if in_summary else next_chunk(file, at + 1, size)
                if begin is None:
                    self._end_early(file, at, size, opcode, length)
                    return
                self._note(f"byte {at}: not a record; {begin - at} bytes are skipped")
                at = file.seek(begin)
                continue
            data = file.read(length)
            try:
                if opcode == Opcode.FOOTER:
                    self._footer(Fields(data), file.read(len(MAGIC)))
                    return
                in_summary |= opcode == Opcode.DATA_END  # what follows only repeats what was read
                if not in_summary:
                    yield from self.take(opcode, data)
            except RecordError as error:
                self._note(f"byte {at}: {error}")
                # no sense in what follows, or no end
                if opcode not in (Opcode.CHUNK, Opcode.MESSAGE) or isinstance(error, ExcessError):
                    return
            at += _RECORD.size + length

    def _end_early(self, file: BinaryIO, at: int, size: int, opcode: int, length: int) -> None:
        """Note that nothing from byte `at` on can be read, where a record of such kind and length would begin."""
        if length > RECORD_LIMIT:
            self._note(
                f"byte {at}: a record has {length} bytes, more than the allowed {RECORD_LIMIT}; the rest is "
                "not read"
            )
        elif length > size - at - _RECORD.size:
            ends = f"the file ends at byte {size}, within a record of {length} bytes that begins at byte {at}"
            self.truncated = NOT_CLOSED if file.seek(0, io.SEEK_END) > size else ends
        else:  # what a file system leaves of blocks that were never written
            self.truncated = f"the file ends in zeros from byte {at} on"

    def take(self, opcode: int, data: bytes | memoryview) -> Iterator[Message]:
        """Take in one record and yield the messages that it holds; raises RecordError if it is damaged."""
        if opcode == Opcode.MESSAGE:
            yield self._message(data)
        elif opcode == Opcode.CHUNK:
            self.compressions.add(chunk_compression(data) or "none")
            records = chunk_data(data)
            self._unpacked_left -= len(records)
            if self._unpacked_left < 0:
                raise ExcessError(
                    f"the data unpack to more than {UNPACKED_RATIO} times the size of the file, which no recorder "
                    "writes; the rest is not read"
                )
            yield from self._chunk(records)
        elif opcode == Opcode.CHANNEL:
            self._channel(Fields(data))
        elif opcode == Opcode.SCHEMA:
            self._schema(Fields(data))
        elif opcode == Opcode.ATTACHMENT:
            fields = Fields(data)
            fields.take(16)
            self.attachments.add(fields.text())
        elif opcode == Opcode.HEADER:
            fields = Fields(data)
            self.profile, self.library = fields.text(), fields.text()

    def _chunk(self, data: bytes) -> Iterator[Message]:
        at, view = 0, memoryview(data)
        while at < len(view):
            if len(view) - at < _RECORD.size:
                raise RecordError("a chunk ends within a record")
            opcode, length = _RECORD.unpack_from(view, at)
            at += _RECORD.size
            self._records_left -= 1
            if self._records_left < 0:
                raise ExcessError("more records than a file of this size can hold; the rest is not read")
            if opcode == 0:
                raise RecordError("zeros in place of records")
            if length > len(view) - at:
                raise RecordError("a chunk ends within a record")
            if opcode == Opcode.CHUNK:
                raise RecordError("a chunk within a chunk")
            yield from self.take(opcode, view[at : at + length])
            at += length

    def _message(self, data: bytes | memoryview) -> Message:
        if len(data) < _MESSAGE.size:
            raise RecordError("a message is too short")
        channel, _, log_time, publish_time = _MESSAGE.unpack_from(data)
        if channel not in self.channels:
            raise RecordError(f"a message belongs to channel {channel}, which is not described before it")
        return Message(channel, log_time, publish_time, memoryview(data)[_MESSAGE.size :])

    def _schema(self, fields: Fields) -> None:
        number = fields.number(2)
        name, encoding = fields.text(), fields.text()
        self._schemas[number] = Schema(name, encoding, fields.text(DEFINITION_LIMIT))

    def _channel(self, fields: Fields) -> None:
        number, schema = fields.number(2), fields.number(2)
        topic, encoding, qos = fields.text(), fields.text(), ""
        details = fields.table()
        while not details.is_empty:
            key, value = details.text(), details.text(2**20)
            if key == "offered_qos_profiles":
                qos = value[: 2**14]
        if len(self.channels) >= CHANNEL_LIMIT and number not in self.channels:
            raise RecordError(f"more than {CHANNEL_LIMIT} channels")
        if encoding == "cdr" and not topic.startswith("/"):
            topic = f"/{topic}"  # a name that a node in the root namespace resolves so
        self.channels[number] = Channel(topic, self._schemas.get(schema, NO_SCHEMA), encoding, qos)

    def _footer(self, fields: Fields, magic: bytes) -> None:
        if magic != MAGIC:
            self.truncated = "the file ends without an end mark"
        elif fields.number(8) == 0:
            self.truncated = NOT_CLOSED

    def _note(self, text: str) -> None:
        if len(self.damage) < 20:
            self.damage.append(text)
        elif len(self.damage) == 20:
            self.damage.append("more damage is not listed")


def open_mcap(path: Path) -> BinaryIO:
    """Open a file and check that it begins as an mcap file; raises RecordError that names it."""
    try:
        file = open_file(path, LARGEST_FILE)
    except FileNotFoundError:
        raise RecordError(f"{path} does not exist") from None
    except OSError as error:
        raise RecordError(f"cannot read {path}: {error.strerror}") from None
    try:
        begin = file.read(len(MAGIC) + 1)
    except OSError as error:
        file.close()
        raise RecordError(f"cannot read {path}: {error.strerror}") from None
    if begin != MAGIC + bytes([Opcode.HEADER]):
        file.close()
        if not begin:
            raise RecordError(f"{path} is empty: nothing was recorded in it")
        raise RecordError(f"{path} is not an mcap file; give the directory or the .mcap file of a recording")
    file.seek(0)
    return file


def chunk_compression(data: bytes | memoryview) -> str:
    """Return the name of a chunk's compression, "" for none."""
    fields = Fields(data)
    fields.take(28)
    return fields.text()


def chunk_data(data: bytes | memoryview) -> bytes:
    """Return the records of a chunk; raises RecordError if it is damaged or larger than `RECORD_LIMIT`."""
    fields = Fields(data)
    fields.take(16)
    size, checksum, compression = fields.number(8), fields.number(4), fields.text()
    packed = fields.take(fields.number(8))
    if size > RECORD_LIMIT:
        raise RecordError(f"a chunk has {size} bytes, more than the allowed {RECORD_LIMIT}")
    records = unpacked(packed, compression, size)
    if len(records) != size:
        raise RecordError(f"a chunk of {len(records)} bytes instead of {size}")
    if checksum and zlib.crc32(records) != checksum:
        raise RecordError("a chunk with a wrong checksum")
    return records


def unpacked(packed: memoryview, compression: str, size: int) -> bytes:
    """Return what was packed, at most `size` + 1 bytes of it; raises RecordError."""
    try:
        if compression == "":
            return bytes(packed[: size + 1])
        if compression == "zstd":
            decompressor = zstandard.ZstdDecompressor(max_window_size=RECORD_LIMIT)
            with decompressor.stream_reader(io.BytesIO(packed)) as stream:
                return bytes(stream.read(size + 1))
        if compression == "lz4":
            return bytes(lz4.frame.LZ4FrameDecompressor().decompress(packed, max_length=size + 1))
    except (zstandard.ZstdError, RuntimeError, EOFError, ValueError) as error:
        raise RecordError(f"a chunk that does not unpack ({error})") from None
    raise RecordError(f"a chunk with unknown compression {compression[:20]!r}")
