"""Reads the fields of one mcap record out of bytes that may be anything."""

import struct
from collections.abc import Iterator

from tripod_record.errors import RecordError

TEXT_LIMIT = 4096
"""Longest name or other text that is believed [B]."""


class Fields:
    """Fields of a record, taken in order; raises RecordError where the record does not hold them."""

    def __init__(self, data: bytes | memoryview) -> None:
        self._data = memoryview(data)
        self._at = 0

    def number(self, size: int) -> int:
        """Take an unsigned integer of `size` bytes."""
        return int.from_bytes(self.take(size), "little")

    def take(self, size: int) -> memoryview:
        """Take `size` bytes."""
        end = self._at + size
        if end > len(self._data):
            raise RecordError("a record is shorter than its fields say; the file is damaged there")
        part = self._data[self._at : end]
        self._at = end
        return part

    def rest(self) -> memoryview:
        """Take all that is left."""
        return self.take(len(self._data) - self._at)

    def text(self, limit: int = TEXT_LIMIT) -> str:
        """Take a text with its length before it; bytes that are not UTF-8 become replacement characters."""
        size = self.number(4)
        if size > limit:
            raise RecordError(f"a text has {size} bytes; allowed: at most {limit}; the file is damaged there")
        return str(self.take(size), "utf-8", "replace")

    def table(self) -> "Fields":
        """Take a table with its length before it, as fields of their own."""
        return Fields(self.take(self.number(4)))

    def pairs(self, key: str, value: str) -> Iterator[tuple[int, int]]:
        """Take pairs of integers to the end; `key`, `value`: their struct formats."""
        rest = self.rest()
        pair = struct.Struct(f"<{key}{value}")
        if len(rest) % pair.size:
            raise RecordError("a table ends within an entry; the file is damaged there")
        return pair.iter_unpack(rest)

    @property
    def is_empty(self) -> bool:
        """Whether nothing is left."""
        return self._at >= len(self._data)
