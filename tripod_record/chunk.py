"""Collects messages to one chunk of an mcap file, with the indexes that follow it."""

import struct
import zlib
from collections.abc import Callable
from typing import Final

import lz4.frame  # type: ignore[import-untyped]
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Schema

_MESSAGE = struct.Struct("<BQHIQQ")
_MESSAGE_FIELDS = _MESSAGE.size - 9
_ENTRY = struct.Struct("<QQ")
_INDEX = struct.Struct("<BQHI")
_INDEX_FIELDS = _INDEX.size - 9


def _as_it_is(records: bytes) -> bytes:
    return records


def _lz4(records: bytes) -> bytes:
    return bytes(lz4.frame.compress(records))


COMPRESSIONS: Final = ("none", "lz4", "zstd")


class ChunkBuilder:
    """Records of one chunk at a time; they know nothing of their place in the file.

    Attributes:
        size: Size of the records so far [B].
    """

    def __init__(self, compression: str) -> None:
        """`compression`: one of `COMPRESSIONS`."""
        self._name = "" if compression == "none" else compression
        # one compressor for all chunks: a new one for each takes and returns megabytes twice a second
        compressors: dict[str, Callable[[bytes], bytes]] = {
            "none": _as_it_is,
            "lz4": _lz4,
            "zstd": zstandard.ZstdCompressor().compress,
        }
        self._compress = compressors[compression]
        self._clear()

    def _clear(self) -> None:
        self._parts: list[bytes] = []
        self.size = 0
        self._entries: dict[int, bytearray] = {}
        self._first = self._last = 0

    def describe(self, record: Schema | Channel) -> None:
        """Add a description; it stays here until a message comes: a chunk without any is not written."""
        self._add(encoded(record))

    def add_message(self, channel: int, sequence: int, log_time: int, publish_time: int, data: bytes) -> None:
        """Add a message; stamps [ns since 1970], `log_time` never below that of the one before."""
        if not self._entries:
            self._first = log_time
        self._last = log_time
        self._entries.setdefault(channel, bytearray()).extend(_ENTRY.pack(log_time, self.size))
        length = _MESSAGE_FIELDS + len(data)
        self._add(_MESSAGE.pack(Opcode.MESSAGE, length, channel, sequence, log_time, publish_time))
        self._add(data)

    def end(self) -> bytes:
        """Return the chunk and its indexes, and begin the next; nothing, and nothing begins, without a message."""
        if not self._entries:
            return b""
        records = b"".join(self._parts)
        chunk = Chunk(
            compression=self._name,
            data=self._compress(records),
            message_start_time=self._first,
            message_end_time=self._last,
            uncompressed_crc=zlib.crc32(records),
            uncompressed_size=len(records),
        )
        indexes = [
            _INDEX.pack(Opcode.MESSAGE_INDEX, _INDEX_FIELDS + len(entries), channel, len(entries)) + entries
            for channel, entries in self._entries.items()
        ]
        self._clear()
        return b"".join((encoded(chunk), *indexes))

    def _add(self, data: bytes) -> None:
        self._parts.append(data)
        self.size += len(data)


def encoded(*records: object) -> bytes:
    """Return records of `mcap.records` as they stand in a file."""
    builder = RecordBuilder()
    for record in records:
        record.write(builder)  # type: ignore[attr-defined]
    return bytes(builder.end())
