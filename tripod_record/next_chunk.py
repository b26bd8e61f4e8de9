"""Finds where a damaged recording goes on: a chunk tells itself by three lengths that must agree."""

import re
from typing import BinaryIO, Final

SEARCHED: Final = 2**20
"""Bytes that are looked through at a time."""

_HEAD: Final = (
    re.compile(  # opcode and length; stamps, size and checksum; compression; size of what is packed
        rb"(?=\x06(.{3}[\x00-\x08]\0{4}).{28}(\0{4}|\x04\0{3}zstd|\x03\0{3}lz4)(.{8}))", re.DOTALL
    )
)
_RECORD, _FIXED, _SIZE, _LONGEST = 9, 28, 8, 53


def next_chunk(file: BinaryIO, at: int, size: int) -> int | None:
    """Return where the first chunk at or behind byte `at` of a file of `size` bytes begins; None if there is none."""
    while at < size:
        file.seek(at)
        data = file.read(SEARCHED)
        for found in _HEAD.finditer(data):
            length, packed = (int.from_bytes(found[i], "little") for i in (1, 3))
            begin = at + found.start()
            if length == _FIXED + len(found[2]) + _SIZE + packed and begin + _RECORD + length <= size:
                return begin
        if len(data) < _LONGEST:
            break
        at += len(data) - _LONGEST + 1
    return None
