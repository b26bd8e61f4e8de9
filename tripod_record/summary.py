"""Reads the summary at the end of a closed mcap file: what is in it, without reading all of it."""

import io
import zlib
from dataclasses import dataclass
from pathlib import Path

from mcap.opcode import Opcode

from tripod_record.append_file import MAGIC
from tripod_record.errors import RecordError
from tripod_record.fields import Fields
from tripod_record.reading import Reader, open_mcap

SUMMARY_LIMIT = 2**26
"""Largest summary that is read [B]."""
_FOOTER = 9 + 20


@dataclass(frozen=True)
class Summary:
    """What a closed file says of itself.

    Attributes:
        reader: With the channels of the file.
        counts: Messages of each channel, by its number.
        start: Stamp of the first message [ns since 1970].
        end: Stamp of the last message [ns since 1970].
    """

    reader: Reader
    counts: dict[int, int]
    start: int
    end: int


def read_summary(path: Path) -> Summary | None:
    """Return the summary of an mcap file, or None if it has none that can be believed.

    Raises RecordError if the file cannot be opened or is no mcap file.
    """
    reader = Reader(path)
    with open_mcap(path) as file:
        size = file.seek(0, io.SEEK_END)
        file.seek(len(MAGIC))
        try:
            head = Fields(file.read(9))
            opcode, length = head.number(1), head.number(8)
            list(reader.take(opcode, file.read(min(length, SUMMARY_LIMIT))))
            file.seek(max(0, size - _FOOTER - len(MAGIC)))
            begin = Fields(file.read(_FOOTER + len(MAGIC)))
            opcode, length = begin.number(1), begin.number(8)
            start, offsets, checksum = begin.number(8), begin.number(8), begin.number(4)
            length_of_summary = size - _FOOTER - len(MAGIC) - start
            whole = opcode == Opcode.FOOTER and length == 20 and begin.rest() == MAGIC
            if not whole or start == 0 or not 0 < length_of_summary <= SUMMARY_LIMIT:
                return None
            file.seek(start)
            data = file.read(length_of_summary)
            footer = bytes([Opcode.FOOTER]) + b"".join(n.to_bytes(8, "little") for n in (20, start, offsets))
            if checksum and zlib.crc32(footer, zlib.crc32(data)) != checksum:
                return None
            return _parsed(reader, Fields(data))
        except RecordError:
            return None


def _parsed(reader: Reader, fields: Fields) -> Summary | None:
    summary = None
    while not fields.is_empty:
        opcode = fields.number(1)
        record = fields.take(fields.number(8))
        if opcode == Opcode.STATISTICS:
            summary = _statistics(reader, Fields(record))
        elif opcode == Opcode.CHUNK_INDEX:
            index = Fields(record)
            index.take(32)
            index.table()
            index.take(8)
            reader.compressions.add(index.text() or "none")
        elif opcode == Opcode.ATTACHMENT_INDEX:
            attached = Fields(record)
            attached.take(40)
            reader.attachments.add(attached.text())
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            list(reader.take(opcode, record))
    if summary is None or not set(summary.counts) <= set(reader.channels):
        return None
    return summary


def _statistics(reader: Reader, fields: Fields) -> Summary:
    fields.take(8 + 2 + 4 + 4 + 4 + 4)
    start, end = fields.number(8), fields.number(8)
    return Summary(reader, dict(fields.table().pairs("H", "Q")), start, end)
