"""MCAP files as streams of messages, also those that were cut off or damaged: what is sound is read."""

import io
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Header, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import get_chunk_data_stream

from drivers.mcap_parts import MAGIC, RECORD_HEADER, Part, has_records, parts
from drivers.mcap_summary import Summary, read_summary

IMAGE_TOPIC = "/camera"
"""Where a flight log keeps its frames, as foxglove.CompressedImage."""
IMAGE_DATA_FIELD = 2
"""The field of foxglove.CompressedImage (protobuf) that holds the JPEG."""

_MESSAGE_HEAD = struct.Struct("<H4xQ")  # channel, sequence number (passed over), log time
_MESSAGE_HEAD_BYTES = 22  # the publish time stands behind them
_VARINT, _BYTES = 0, 2  # protobuf's wire types
_FIXED_BYTES = {1: 8, 5: 4}


@dataclass(frozen=True, slots=True)
class Damage:
    """What could not be read of a file: `n_skipped` of its `n_parts` chunks and attachments.

    `holes_ns` are the log times [ns, Unix] of the messages before and after them; there are more where not
    `is_all_known`. `n_nameless` messages are sound, but what channel they belong to stood in a damaged part. Without
    any of these only what says where things lie is damaged: nothing is missing.
    """

    n_skipped: int
    n_parts: int
    holes_ns: tuple[tuple[int, int], ...]
    is_all_known: bool
    n_nameless: int

    @property
    def missing_ns(self) -> int:
        """How much time lies in the holes [ns]."""
        return sum(after_ns - before_ns for before_ns, after_ns in self.holes_ns)


class McapFile:
    """An open MCAP file as far as it is sound. Raises ValueError for another kind of file.

    Go through `messages` or `records` once; then the other properties are known. `attachments` and `metadata` are by
    name.
    """

    def __init__(self, file: BinaryIO) -> None:
        if not has_records(file):
            raise ValueError("not an MCAP file")
        self._file = file
        self.attachments: dict[str, bytes] = {}
        self.metadata: dict[str, dict[str, str]] = {}
        self.is_closed = False
        """Whether the writer came to its end, and did not die before."""
        self._summary: Summary | None = None
        self._topics: dict[int, str] = {}
        self._n_sound = self._n_unsound = self._n_nameless = 0
        self._is_chunked = True
        self._is_flawed = False  # in a place that holds none of the messages
        self._holes_ns: list[tuple[int, int]] = []
        self._is_all_known = True
        self._last_ns: int | None = None
        self._is_after_gap = False

    @property
    def damage(self) -> Damage | None:
        """What could not be read; None where all could, up to where the file was cut off."""
        n_parts = self._n_sound + self._n_unsound
        if self._is_chunked and self._summary is not None and self._summary.n_parts is not None:
            n_parts = max(self._summary.n_parts, self._n_sound)
        n_skipped = n_parts - self._n_sound
        if not (n_skipped or self._n_unsound or self._n_nameless or self._is_flawed):
            return None
        if n_skipped == 0:  # it was an index that could not be read
            return Damage(0, n_parts, (), is_all_known=True, n_nameless=self._n_nameless)
        return Damage(n_skipped, n_parts, tuple(self._holes_ns), self._is_all_known, self._n_nameless)

    def messages(self) -> Iterator[tuple[str, int, bytes]]:
        """Topic, log time [ns, Unix] and body of each message, in the order written."""
        for opcode, content in self._sound_parts():
            if opcode == Opcode.CHUNK:
                yield from self._messages_in(content)
            elif opcode == Opcode.MESSAGE:
                message = Message.read(_stream(content), len(content))
                topic = self._topic(message.channel_id)
                self._note(message.log_time)
                if topic is not None:
                    yield topic, message.log_time, message.data
        self._finish()

    def records(self) -> Iterator[McapRecord]:
        """The header, then every schema, channel, message, attachment and metadata; chunks unpacked."""
        is_begun = is_helped = False
        for opcode, content in self._sound_parts():
            if not is_begun and opcode != Opcode.HEADER:
                yield Header(profile="", library="")
            is_begun = True
            if self._n_unsound and self._summary is not None and not is_helped:
                is_helped = True
                yield from self._summary.definitions
            for kind, body in _records_in(content) if opcode == Opcode.CHUNK else [(opcode, content)]:
                record = _record(kind, body)
                if isinstance(record, Channel):
                    self._topics[record.id] = record.topic
                elif isinstance(record, Message):
                    self._note(record.log_time)
                    if self._topic(record.channel_id) is None:
                        continue
                if record is not None:
                    yield record
        self._finish()

    def _messages_in(self, chunk: bytes) -> Iterator[tuple[str, int, bytes]]:
        """A chunk's messages.

        The library takes each field through its own stream, which for a long log takes most of the time.
        """
        log_time_ns = self._last_ns
        for opcode, body in _records_in(chunk):
            if opcode == Opcode.MESSAGE:
                channel_id, log_time_ns = _MESSAGE_HEAD.unpack_from(body)
                if self._is_after_gap:
                    self._note(log_time_ns)
                topic = self._topic(channel_id)
                if topic is not None:
                    yield topic, log_time_ns, body[_MESSAGE_HEAD_BYTES:]
            elif opcode == Opcode.CHANNEL:
                channel = Channel.read(_stream(body))
                self._topics[channel.id] = channel.topic
        self._last_ns = log_time_ns

    def _sound_parts(self) -> Iterator[tuple[int, bytes]]:
        """Opcode and content of every part that is sound: a chunk's unpacked, attachments and metadata kept."""
        self._summary = read_summary(self._file)
        self._file.seek(0)
        self._is_flawed = self._file.read(len(MAGIC)) != MAGIC
        checksum = zlib.crc32(MAGIC)
        for part in parts(self._file):
            if part.opcode is None:
                self._skip()
                continue
            if part.opcode == Opcode.DATA_END:
                self._end_data(part, checksum)
            checksum = zlib.crc32(
                part.content, zlib.crc32(RECORD_HEADER.pack(part.opcode, len(part.content)), checksum)
            )
            if part.opcode in (Opcode.CHUNK, Opcode.ATTACHMENT):
                content = self._checked(part)
                if content is None:
                    self._skip()
                    continue
                self._n_sound += 1
                yield part.opcode, content
            else:
                self.is_closed = self.is_closed or part.opcode == Opcode.FOOTER
                self._is_chunked = self._is_chunked and part.opcode != Opcode.MESSAGE
                if part.opcode == Opcode.MESSAGE or self._is_told(part):
                    yield part.opcode, part.content

    def _checked(self, part: Part) -> bytes | None:
        """What a chunk holds, or an attachment as it is; None where its checksum says that it is damaged."""
        try:
            if part.opcode == Opcode.CHUNK:
                data, n_bytes = get_chunk_data_stream(Chunk.read(_stream(part.content)), validate_crc=True)
                return bytes(data.read(n_bytes))
            crc = int.from_bytes(part.content[-4:], "little")
            if crc not in (0, zlib.crc32(part.content[:-4])):
                return None
            attachment = Attachment.read(_stream(part.content))
        except Exception:  # the decompressors and the decoder each have their own
            return None
        self.attachments[attachment.name] = attachment.data
        return part.content

    def _is_told(self, part: Part) -> bool:
        """Take what a record says of the file; False where it cannot be read. It has no checksum of its own."""
        assert part.opcode is not None  # noqa: S101
        try:
            record = _record(part.opcode, part.content)
        except Exception:  # the decoder has its own, and its texts may be none
            self._is_flawed = True
            return False
        if isinstance(record, Metadata):
            self.metadata[record.name] = record.metadata
        elif isinstance(record, Channel):
            self._topics[record.id] = record.topic
        return True

    def _end_data(self, part: Part, checksum: int) -> None:
        """The end of all but the summary, with a checksum of everything before it."""
        crc = int.from_bytes(part.content, "little")
        if crc not in (0, checksum):
            self._is_flawed = True

    def _skip(self) -> None:
        self._n_unsound += 1
        self._is_after_gap = True
        if self._summary is not None:  # what was damaged may have said what the channels are
            self._topics = self._summary.topics | self._topics

    def _note(self, log_time_ns: int) -> None:
        """A message's time: the first one after a gap tells how long that was."""
        if self._is_after_gap:
            self._is_after_gap = False
            before_ns = self._last_ns
            if before_ns is None and self._summary is not None:
                before_ns = self._summary.first_ns
            self._miss(before_ns, log_time_ns)
        self._last_ns = log_time_ns

    def _miss(self, before_ns: int | None, after_ns: int | None) -> None:
        if before_ns is None or after_ns is None:
            self._is_all_known = False
        elif after_ns > before_ns:
            self._holes_ns.append((before_ns, after_ns))

    def _topic(self, channel_id: int) -> str | None:
        topic = self._topics.get(channel_id)
        self._n_nameless += topic is None
        return topic

    def _finish(self) -> None:
        if self._is_after_gap:
            self._miss(self._last_ns, None if self._summary is None else self._summary.last_ns)
        if self._summary is None and self.is_closed:
            self._is_flawed = True


def open_messages(file: BinaryIO) -> Iterator[tuple[str, int, bytes]]:
    """The messages of an open MCAP file as far as it is sound. Raises ValueError for another kind of file."""
    return McapFile(file).messages()


def _records_in(chunk: bytes) -> Iterator[tuple[int, bytes]]:
    """Opcode and content of each record in an unpacked chunk."""
    at = 0
    while at < len(chunk):
        opcode, length = RECORD_HEADER.unpack_from(chunk, at)
        at += RECORD_HEADER.size
        yield opcode, chunk[at : at + length]
        at += length


def _record(opcode: int, content: bytes) -> McapRecord | None:
    """A record of a kind that a copy has to hold; None for the others, which a writer makes anew."""
    if opcode == Opcode.MESSAGE:
        return Message.read(_stream(content), len(content))
    for kind, of_opcode in _COPIED:
        if opcode == of_opcode:
            return kind.read(_stream(content))
    return None


_COPIED = (
    (Header, Opcode.HEADER),
    (Schema, Opcode.SCHEMA),
    (Channel, Opcode.CHANNEL),
    (Attachment, Opcode.ATTACHMENT),
    (Metadata, Opcode.METADATA),
)


def _stream(content: bytes) -> ReadDataStream:
    return ReadDataStream(io.BytesIO(content))


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
