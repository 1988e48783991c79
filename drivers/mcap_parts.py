"""Where the records of an MCAP file lie, also of one that was cut off or has damaged places in it."""

import io
import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import BinaryIO

from mcap.opcode import Opcode

MAGIC = b"\x89MCAP0\r\n"
RECORD_HEADER = struct.Struct("<BQ")  # opcode, length of what follows [bytes]

_TEXT, _DATA, _REST = -4, -8, 0  # with its length before it, in 4 or 8 bytes; whatever is left
# What each record consists of, in bytes: a record whose own lengths do not add up to its length is damaged.
# The MCAP specification, version 0, section "Records".
_LAYOUT: dict[int, tuple[int, ...]] = {
    Opcode.HEADER: (_TEXT, _TEXT),
    Opcode.FOOTER: (20,),
    Opcode.SCHEMA: (2, _TEXT, _TEXT, _TEXT),
    Opcode.CHANNEL: (4, _TEXT, _TEXT, _TEXT),
    Opcode.MESSAGE: (22, _REST),
    Opcode.CHUNK: (28, _TEXT, _DATA),
    Opcode.MESSAGE_INDEX: (2, _TEXT),
    Opcode.CHUNK_INDEX: (32, _TEXT, 8, _TEXT, 16),
    Opcode.ATTACHMENT: (16, _TEXT, _TEXT, _DATA, 4),
    Opcode.ATTACHMENT_INDEX: (40, _TEXT, _TEXT),
    Opcode.STATISTICS: (42, _TEXT),
    Opcode.METADATA: (_TEXT, _TEXT),
    Opcode.METADATA_INDEX: (16, _TEXT),
    Opcode.SUMMARY_OFFSET: (17,),
    Opcode.DATA_END: (4,),
}
# Where reading goes on after a damaged place: what holds something, and what comes behind it all.
_LANDMARK = re.compile(
    b"(?=[%s].{4}\0{4})"
    % re.escape(bytes((Opcode.FOOTER, Opcode.CHUNK, Opcode.ATTACHMENT, Opcode.METADATA, Opcode.DATA_END))),
    re.DOTALL,
)
_WINDOW_BYTES = 1 << 20
_PRIVATE = 0x80  # and above: the specification leaves these opcodes to applications


@dataclass(frozen=True, slots=True)
class Part:
    """A record of a file, or, without `opcode`, a stretch of it in which none can be read."""

    opcode: int | None
    content: bytes


def parts(file: BinaryIO) -> Iterator[Part]:
    """Every record of an open MCAP file in its order, up to where it was cut off, and every damaged stretch once.

    That its lengths add up is all that is known of a record; checksums are the caller's.
    """
    size = file.seek(0, io.SEEK_END)
    at = 0
    if _read(file, 0, len(MAGIC)) == MAGIC:
        at = len(MAGIC)
    while at < size:
        header = _header(file, at, size)
        if header is None:
            landmark = _next_landmark(file, at + 1, size)
            if landmark is None and _is_cut(file, at, size):
                return
            yield Part(None, b"")
            at = size if landmark is None else landmark
            continue
        opcode, length = header
        at += RECORD_HEADER.size
        after = _read(file, at + length, len(MAGIC) + 1) if opcode == Opcode.FOOTER else None
        if after is not None and len(after) < len(MAGIC):
            return
        yield Part(opcode, _read(file, at, length))
        at += length
        if after is not None:
            if not after.startswith(MAGIC):
                yield Part(None, b"")
            return


def has_records(file: BinaryIO) -> bool:
    """Whether it is an MCAP file: by its first bytes or, where these are damaged, by a record not far behind them."""
    if _read(file, 0, len(MAGIC)) == MAGIC:
        return True
    size = file.seek(0, io.SEEK_END)
    return _next_landmark(file, 0, size, until=_WINDOW_BYTES) is not None


def _header(file: BinaryIO, at: int, size: int) -> tuple[int, int] | None:
    """Opcode and length of the record at `at`; None where there is none, or one whose lengths do not add up."""
    head = _read(file, at, RECORD_HEADER.size)
    if len(head) < RECORD_HEADER.size:
        return None
    opcode, length = RECORD_HEADER.unpack(head)
    at += RECORD_HEADER.size
    end = at + length
    if opcode >= _PRIVATE and end < size:  # another tool's own: to be passed over, where it is a record at all
        following = _read(file, end, 1)
        return (opcode, length) if following[0] in _LAYOUT and _header(file, end, size) is not None else None
    if opcode not in _LAYOUT or end > size:
        return None
    for field in _LAYOUT[opcode]:
        if field == _REST:
            at = max(at, end)
        elif field > 0:
            at += field
        else:
            at += -field + int.from_bytes(_read(file, at, -field), "little")
        if at > end:
            return None
    return (opcode, length) if at == end else None


def _next_landmark(file: BinaryIO, at: int, size: int, until: int | None = None) -> int | None:
    """Where the next record of a kind in _LANDMARK begins; None where none does (before `until`)."""
    while at < (size if until is None else min(until, size)):
        window = _read(file, at, _WINDOW_BYTES + RECORD_HEADER.size)
        for match in _LANDMARK.finditer(window):
            if _header(file, at + match.start(), size) is not None:
                return at + match.start()
        at += _WINDOW_BYTES
    return None


def _is_cut(file: BinaryIO, at: int, size: int) -> bool:
    """Whether the file ends within the record at `at`, as when the power went."""
    head = _read(file, at, RECORD_HEADER.size)
    if len(head) < RECORD_HEADER.size:
        return True
    opcode, length = RECORD_HEADER.unpack(head)
    return opcode in _LAYOUT and at + RECORD_HEADER.size + length > size


def _read(file: BinaryIO, at: int, n_bytes: int) -> bytes:
    file.seek(at)
    return file.read(n_bytes)
