"""MCAP files as streams of messages, also those that were cut off when the power went."""

import io
import struct
from collections.abc import Iterator
from typing import TYPE_CHECKING, BinaryIO, cast

from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, McapRecord, Message
from mcap.stream_reader import StreamReader, get_chunk_data_stream

if TYPE_CHECKING:
    from typing_extensions import Buffer

MAGIC = b"\x89MCAP0\r\n"
IMAGE_TOPIC = "/camera"
"""Where a flight log keeps its frames, as foxglove.CompressedImage."""
IMAGE_DATA_FIELD = 2
"""The field of foxglove.CompressedImage (protobuf) that holds the JPEG."""

_RECORD_HEADER = struct.Struct("<BQ")  # opcode, length of what follows [bytes]
_MESSAGE_HEAD = struct.Struct("<H4xQ")  # channel, sequence number (passed over), log time
_MESSAGE_HEAD_BYTES = 22  # the publish time stands behind them
_FOOTER_OPCODE = 0x02
_VARINT, _BYTES = 0, 2  # protobuf's wire types
_FIXED_BYTES = {1: 8, 5: 4}


def whole_records(file: BinaryIO) -> tuple[int, bool]:
    """How many bytes of the file hold whole records, and whether the last of them is the footer.

    A log that was cut off ends within a record; what stands before it is sound.
    """
    size = file.seek(0, io.SEEK_END)
    end = len(MAGIC)
    while end + _RECORD_HEADER.size <= size:
        file.seek(end)
        opcode, length = _RECORD_HEADER.unpack(file.read(_RECORD_HEADER.size))
        if end + _RECORD_HEADER.size + length > size:
            break
        next_record = end + _RECORD_HEADER.size + length
        if opcode == _FOOTER_OPCODE:
            is_closed = size >= next_record + len(MAGIC)
            return (size if is_closed else end), is_closed
        end = next_record
    return end, False


def messages(stream: BinaryIO, attachments: dict[str, bytes] | None = None) -> Iterator[tuple[str, int, bytes]]:
    """Topic, log time [ns, Unix] and body of each message, in the order written; fills `attachments` by name."""
    topics: dict[int, str] = {}
    for record in _records(stream, emit_chunks=True):
        if isinstance(record, Chunk):
            yield from _messages_in(record, topics)
        elif isinstance(record, Channel):
            topics[record.id] = record.topic
        elif isinstance(record, Message):
            yield topics[record.channel_id], record.log_time, record.data
        elif isinstance(record, Attachment) and attachments is not None:
            attachments[record.name] = record.data


def _messages_in(chunk: Chunk, topics: dict[int, str]) -> Iterator[tuple[str, int, bytes]]:
    """A chunk's messages; its channels join `topics`.

    The library takes each field through its own stream, which for a long log is most of the time that reading takes.
    """
    unpacked, n_bytes = get_chunk_data_stream(chunk, validate_crc=True)
    data = unpacked.read(n_bytes)
    at = 0
    while at < n_bytes:
        opcode, length = _RECORD_HEADER.unpack_from(data, at)
        at += _RECORD_HEADER.size
        if opcode == Opcode.MESSAGE:
            channel_id, log_time_ns = _MESSAGE_HEAD.unpack_from(data, at)
            yield topics[channel_id], log_time_ns, data[at + _MESSAGE_HEAD_BYTES : at + length]
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(ReadDataStream(io.BytesIO(data[at : at + length])))
            topics[channel.id] = channel.topic
        at += length


def open_messages(file: BinaryIO, attachments: dict[str, bytes] | None = None) -> Iterator[tuple[str, int, bytes]]:
    """The messages of an open MCAP file as far as it is whole. Raises ValueError for another kind of file."""
    return messages(_whole(file), attachments)


def open_records(file: BinaryIO) -> Iterator[McapRecord]:
    """Every record of an open MCAP file as far as it is whole, chunks unpacked. Raises ValueError for another kind."""
    return _records(_whole(file))


def _records(stream: BinaryIO, *, emit_chunks: bool = False) -> Iterator[McapRecord]:
    try:
        yield from StreamReader(stream, emit_chunks=emit_chunks, validate_crcs=True, record_size_limit=None).records
    except EndOfFile:
        # The stream holds whole records only: this is the end of a log that was never closed.
        return


def _whole(file: BinaryIO) -> BinaryIO:
    """The part of an open MCAP file that holds whole records, from its beginning."""
    if file.read(len(MAGIC)) != MAGIC:
        raise ValueError("not an MCAP file")
    whole_bytes, _ = whole_records(file)
    file.seek(0)
    return cast("BinaryIO", _Head(file, whole_bytes))


class _Head(io.RawIOBase):
    """The first bytes of a file, as a file of its own."""

    def __init__(self, file: BinaryIO, n_bytes: int) -> None:
        self._file = file
        self._left = n_bytes

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: "Buffer") -> int:
        view = memoryview(buffer).cast("B")
        piece = self._file.read(min(len(view), self._left))
        view[: len(piece)] = piece
        self._left -= len(piece)
        return len(piece)


def bytes_field(message: bytes, number: int) -> bytes:
    """The bytes field `number` of a protobuf message; empty when it has none."""
    at = 0
    while at < len(message):
        key, at = _varint(message, at)
        wire_type = key & 7
        if wire_type == _VARINT:
            _, at = _varint(message, at)
        elif wire_type == _BYTES:
            length, at = _varint(message, at)
            if key >> 3 == number:
                return message[at : at + length]
            at += length
        else:
            at += _FIXED_BYTES[wire_type]
    return b""


def _varint(message: bytes, at: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        byte = message[at]
        value |= (byte & 0x7F) << shift
        at += 1
        shift += 7
        if byte < 0x80:
            return value, at
