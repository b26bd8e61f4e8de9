"""The end of an mcap file: the summary, by which readers find everything without reading it all."""

import struct
import zlib
from collections.abc import Sequence

from mcap.opcode import Opcode
from mcap.records import Channel, DataEnd, Footer, Schema, Statistics, SummaryOffset

from tripod_record.append_file import MAGIC
from tripod_record.chunk import encoded
from tripod_record.structure import Structure


def end_of_file(at: int, data: Structure, schemas: Sequence[Schema], channels: Sequence[Channel]) -> bytes:
    """Return all that follows a data section which ends at byte `at` and holds `data`."""
    data_end = encoded(DataEnd(data_section_crc=0))
    start = at + len(data_end)
    statistics = Statistics(
        attachment_count=data.attachments,
        channel_count=len(channels),
        channel_message_counts=data.counts,
        chunk_count=data.chunks,
        message_count=data.messages,
        message_start_time=data.start or 0,
        message_end_time=data.last or 0,
        metadata_count=data.metadata,
        schema_count=len(schemas),
    )
    groups = [
        (Opcode.SCHEMA, encoded(*schemas)),
        (Opcode.CHANNEL, encoded(*channels)),
        (Opcode.STATISTICS, encoded(statistics)),
        (Opcode.CHUNK_INDEX, bytes(data.chunk_indexes.end())),
        (Opcode.ATTACHMENT_INDEX, bytes(data.attachment_indexes.end())),
        (Opcode.METADATA_INDEX, bytes(data.metadata_indexes.end())),
    ]
    summary = b"".join(group for _, group in groups)
    offsets, place = [], start
    for opcode, group in groups:
        if group:
            offsets.append(SummaryOffset(group_opcode=opcode, group_start=place, group_length=len(group)))
        place += len(group)
    summary += encoded(*offsets)
    footer = struct.pack("<BQQQ", Opcode.FOOTER, 20, start, place)
    checksum = zlib.crc32(footer, zlib.crc32(summary))
    end = encoded(Footer(summary_start=start, summary_offset_start=place, summary_crc=checksum))
    return data_end + summary + end + MAGIC
