"""The end of a closed MCAP file: what it holds in all, and its channels once more."""

import io
import zlib
from dataclasses import dataclass, field
from typing import BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Footer, Schema, Statistics

from drivers.mcap_parts import MAGIC, RECORD_HEADER

_FOOTER_BYTES = RECORD_HEADER.size + 20
_CRC_BYTES = 4


@dataclass(slots=True)
class Summary:
    """How many chunks and attachments the file was closed with, and the times of its messages [ns, Unix].

    None where the file does not tell. `definitions` are its schemas, then its channels.
    """

    definitions: list[Schema | Channel] = field(default_factory=list)
    n_parts: int | None = None
    first_ns: int | None = None
    last_ns: int | None = None

    @property
    def topics(self) -> dict[int, str]:
        """The channels' topics by their numbers."""
        return {record.id: record.topic for record in self.definitions if isinstance(record, Channel)}


def read_summary(file: BinaryIO) -> Summary | None:
    """The summary of an open MCAP file; None where it was never closed, or its end is damaged."""
    size = file.seek(0, io.SEEK_END)
    footer_at = size - len(MAGIC) - _FOOTER_BYTES
    if footer_at < len(MAGIC):
        return None
    file.seek(footer_at)
    end = file.read()
    if end[: RECORD_HEADER.size] != RECORD_HEADER.pack(Opcode.FOOTER, 20):
        return None
    footer = Footer.read(_stream(end[RECORD_HEADER.size :]))
    if footer.summary_start == 0:
        return Summary()
    if not len(MAGIC) < footer.summary_start <= footer_at:
        return None
    file.seek(footer.summary_start)
    section = file.read(footer_at - footer.summary_start)
    checksum = zlib.crc32(end[: _FOOTER_BYTES - _CRC_BYTES], zlib.crc32(section))
    if footer.summary_crc not in (0, checksum):
        return None
    try:
        return _summary_of(section)
    except Exception:  # without a checksum anything may stand there, and the decoder has its own exceptions
        return None


def _summary_of(section: bytes) -> Summary:
    summary = Summary()
    at = 0
    while at < len(section):
        opcode, length = RECORD_HEADER.unpack_from(section, at)
        at += RECORD_HEADER.size
        content = _stream(section[at : at + length])
        at += length
        if opcode == Opcode.SCHEMA:
            summary.definitions.append(Schema.read(content))
        elif opcode == Opcode.CHANNEL:
            summary.definitions.append(Channel.read(content))
        elif opcode == Opcode.STATISTICS:
            counted = Statistics.read(content)
            summary.n_parts = counted.chunk_count + counted.attachment_count
            summary.first_ns, summary.last_ns = counted.message_start_time, counted.message_end_time
    return summary


def _stream(content: bytes) -> ReadDataStream:
    return ReadDataStream(io.BytesIO(content))
