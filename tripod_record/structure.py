"""What the data section of a recording holds, told by its structure: nothing is unpacked, nothing is believed."""

import os
import struct
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import AttachmentIndex, ChunkIndex, MetadataIndex

from tripod_record.append_file import MAGIC
from tripod_record.next_chunk import next_chunk

_RECORD = struct.Struct("<BQ")
_CHUNK = struct.Struct("<QQQII")  # first and last stamp, size, checksum, length of the compression's name
_SIZE = struct.Struct("<Q")
_INDEX = struct.Struct("<HI")  # channel, size of the entries
_ENTRY = 16
_WINDOW = 2**14
_NAME_LIMIT = 64


@dataclass
class Structure:
    """Whole records of a data section, in memory that grows with its chunks.

    Attributes:
        end: Where they end in the file.
        counts: Messages by channel, as the indexes of the chunks have them.
        start: Stamp of the first message [ns since 1970]; None without messages.
        last: Stamp of the last message [ns since 1970]; None without messages.
        chunks: Number of chunks.
        chunk_indexes: Records of the summary, one for each chunk.
        metadata: Number of metadata records.
        metadata_indexes: Records of the summary, one for each metadata record.
        attachments: Number of attachments.
        attachment_indexes: Records of the summary, one for each attachment.
    """

    end: int = 0
    counts: dict[int, int] = field(default_factory=dict)
    start: int | None = None
    last: int | None = None
    chunks: int = 0
    chunk_indexes: RecordBuilder = field(default_factory=RecordBuilder)
    metadata: int = 0
    metadata_indexes: RecordBuilder = field(default_factory=RecordBuilder)
    attachments: int = 0
    attachment_indexes: RecordBuilder = field(default_factory=RecordBuilder)

    @property
    def messages(self) -> int:
        """Number of messages."""
        return sum(self.counts.values())


def read_structure(fd: int, size: int, *, since: int = 0, begin: int = len(MAGIC)) -> Structure:
    """Return what the first `size` bytes of an open file hold, from `begin` to the first that is no record of a data
    section.

    A chunk with a stamp before `since` [ns since 1970] is of somebody else and ends it too. Raises OSError.
    """
    found, window = Structure(), _Window(fd, size)
    if window.take(0, len(MAGIC)) != MAGIC:
        return found
    found.end = begin
    chunk: ChunkIndex | None = None
    while head := window.take(found.end, _RECORD.size):
        opcode, length = _RECORD.unpack(head)
        body, end = found.end + _RECORD.size, found.end + _RECORD.size + length
        if end > size:
            break
        if opcode == Opcode.MESSAGE_INDEX and chunk is not None:
            if length < _INDEX.size:
                break
            channel, entries = _INDEX.unpack(window.take(body, _INDEX.size))
            found.counts[channel] = found.counts.get(channel, 0) + entries // _ENTRY
            chunk.message_index_offsets[channel] = found.end
            chunk.message_index_length += end - found.end
        elif opcode == Opcode.CHUNK:
            _add(found, chunk)
            chunk = _chunk_index(window, found.end, end)
            if chunk is None or chunk.message_start_time < since:
                chunk = None
                break
            found.start = chunk.message_start_time if found.start is None else found.start
            found.last = chunk.message_end_time
        elif opcode == Opcode.METADATA:
            (name_size,) = struct.unpack("<I", window.take(body, 4) or bytes(4))
            name = window.take(body + 4, min(name_size, _NAME_LIMIT)).decode("utf-8", "replace")
            MetadataIndex(found.end, end - found.end, name).write(found.metadata_indexes)
            found.metadata += 1
        elif opcode == Opcode.ATTACHMENT:
            if (index := _attachment_index(window, found.end, end)) is None:
                break
            index.write(found.attachment_indexes)
            found.attachments += 1
        elif opcode not in (Opcode.HEADER, Opcode.SCHEMA, Opcode.CHANNEL):
            break
        found.end = end
    _add(found, chunk)
    return found


def messages_kept(path: Path) -> int:
    """Return how many messages can be read from a file; 0 if it is not there."""
    kept = 0
    with suppress(OSError), path.open("rb") as file:
        size = os.fstat(file.fileno()).st_size
        begin: int | None = len(MAGIC)
        while begin is not None:
            found = read_structure(file.fileno(), size, begin=begin)
            kept += found.messages
            begin = next_chunk(file, max(begin, found.end) + 1, size)
    return kept


def _chunk_index(window: "_Window", begin: int, end: int) -> ChunkIndex | None:
    at = begin + _RECORD.size
    if end - at < _CHUNK.size:
        return None
    first, last, size, _, name_size = _CHUNK.unpack(window.take(at, _CHUNK.size))
    at += _CHUNK.size
    if name_size > _NAME_LIMIT or at + name_size + _SIZE.size > end:
        return None
    name = window.take(at, name_size).decode("utf-8", "replace")
    (packed,) = _SIZE.unpack(window.take(at + name_size, _SIZE.size))
    return ChunkIndex(
        chunk_start_offset=begin,
        chunk_length=end - begin,
        compression=name,
        compressed_size=packed,
        uncompressed_size=size,
        message_start_time=first,
        message_end_time=last,
        message_index_offsets={},
        message_index_length=0,
    )


def _attachment_index(window: "_Window", begin: int, end: int) -> AttachmentIndex | None:
    at, texts = begin + _RECORD.size + 16, []
    for _ in range(2):
        (length,) = struct.unpack("<I", window.take(at, 4) or b"\xff" * 4)
        if length > _NAME_LIMIT or at + 4 + length + _SIZE.size > end:
            return None
        texts.append(window.take(at + 4, length).decode("utf-8", "replace"))
        at += 4 + length
    logged, created = struct.unpack("<QQ", window.take(begin + _RECORD.size, 16))
    (size,) = _SIZE.unpack(window.take(at, _SIZE.size))
    return AttachmentIndex(begin, end - begin, logged, created, size, *texts)


def _add(found: Structure, chunk: ChunkIndex | None) -> None:
    if chunk is not None:
        found.chunks += 1
        chunk.write(found.chunk_indexes)


class _Window:
    """Small pieces of a file that are read in the order of their places."""

    def __init__(self, fd: int, size: int) -> None:
        self._fd, self._size = fd, size
        self._begin, self._data = 0, b""

    def take(self, at: int, count: int) -> bytes:
        """Return `count` bytes from `at`, nothing where they would be beyond the end; raises OSError."""
        if at + count > self._size:
            return b""
        if not self._begin <= at <= at + count <= self._begin + len(self._data):
            self._begin = at
            self._data = os.pread(self._fd, max(count, min(_WINDOW, self._size - at)), at)
        data = self._data[at - self._begin : at - self._begin + count]
        if len(data) < count:
            raise OSError("the file became shorter while it was read; another program changes it")
        return data
