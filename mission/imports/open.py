"""Find out what kind of log a file is, and read it."""

import enum
import hashlib
import lzma
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import BinaryIO

from mission.imports.autopilot_log import AutopilotLog, Tell
from mission.imports.errors import AutopilotLogError

_ENDINGS = ".ulg (PX4), .bin (ArduPilot), .tlog or .tlog.xz (telemetry)"
_BLOCK_BYTES = 4096  # small: what is unpacked of a block in which the damage lies is lost
_MAX_PIECE_BYTES = 1 << 20
_MAX_UNPACKED_BYTES = 4 << 30  # hours of telemetry; more is no log


def read_autopilot_log(path: Path, tell: Tell) -> list[AutopilotLog]:
    """Read an autopilot's log, by its file's ending; telemetry may hold several starts of the autopilot, each a log.

    `tell` hears of the progress where the library tells. Raises AutopilotLogError when it cannot be used, also when it
    holds no position and attitude.
    """
    try:
        size = path.stat().st_size
        if path.is_dir():
            raise AutopilotLogError(f"{path} is a folder; name one of the logs in it: {_ENDINGS}.")
        if not size:
            raise AutopilotLogError(f"The log {path} is empty; fetch it from the vehicle once more.")
        logs = _reader(path)(path, tell)
    except OSError as error:
        raise AutopilotLogError(
            f"The log {path} cannot be read ({error.strerror or error}); check its name and its rights."
        ) from error
    flown = [log for log in logs if len(log.states) > 1]
    if not flown:
        raise AutopilotLogError(f"{path} holds no position with attitude, so there is nothing to lay beside our log.")
    return flown


def digest(path: Path) -> str:
    """The file's SHA-256 as hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _reader(path: Path) -> Callable[[Path, Tell], list[AutopilotLog]]:
    name = path.name.lower()
    if name.endswith(".ulg"):
        return _read_ulog
    if name.endswith(".bin"):
        return _read_dataflash
    if name.endswith(".tlog"):
        return _read_telemetry
    if name.endswith(".tlog.xz"):
        return _read_packed_telemetry
    raise AutopilotLogError(f"{path} is no log that can be imported; name one of {_ENDINGS}.")


# Each library is imported only for its own kind of log.


def _read_ulog(path: Path, _: Tell) -> list[AutopilotLog]:
    from mission.imports.ulog import read_ulog

    return [read_ulog(path)]


def _read_dataflash(path: Path, tell: Tell) -> list[AutopilotLog]:
    from mission.imports.mavlink_logs import read_dataflash_log

    return [read_dataflash_log(path, tell)]


def _read_telemetry(path: Path, tell: Tell) -> list[AutopilotLog]:
    from mission.imports.mavlink_logs import read_telemetry_log

    return read_telemetry_log(path, tell)


def _read_packed_telemetry(path: Path, tell: Tell) -> list[AutopilotLog]:
    """Unpack it to a file of its own, which is what the library reads."""
    with tempfile.TemporaryDirectory() as folder:
        unpacked = Path(folder) / path.name.removesuffix(".xz")
        with path.open("rb") as packed, unpacked.open("wb") as file:
            flaw = _unpack(path, packed, file)
        logs = _read_telemetry_named(path, unpacked, tell)
    return [
        replace(log, breaks_off=log.breaks_off or flaw is _Flaw.CUT, is_damaged=log.is_damaged or flaw is _Flaw.DAMAGED)
        for log in logs
    ]


class _Flaw(enum.Enum):
    """Why a packed file could not be unpacked to its end."""

    CUT = enum.auto()
    DAMAGED = enum.auto()


def _unpack(path: Path, packed: BinaryIO, file: BinaryIO) -> _Flaw | None:
    """Unpack an .xz file as far as it goes; None: to its end. Raises AutopilotLogError when there is nothing in it."""
    unpacker = lzma.LZMADecompressor()
    block = b""
    try:
        while True:
            if unpacker.eof:
                block = _next_stream(unpacker.unused_data, packed)
                if not block:
                    return None
                unpacker = lzma.LZMADecompressor()
            elif unpacker.needs_input and not (block := packed.read(_BLOCK_BYTES)):
                flaw, words = _Flaw.CUT, "it breaks off"
                break
            file.write(unpacker.decompress(block, _MAX_PIECE_BYTES))
            block = b""
            if file.tell() > _MAX_UNPACKED_BYTES:
                raise AutopilotLogError(f"{path} unpacks to more than 4 GiB; that is no telemetry log.")
    except lzma.LZMAError as error:
        flaw, words = _Flaw.DAMAGED, str(error)
    if not file.tell():
        raise AutopilotLogError(f"{path} cannot be unpacked ({words}); fetch it once more.")
    return flaw


def _next_stream(rest: bytes, packed: BinaryIO) -> bytes:
    """The beginning of the stream that follows one, after zeros that may stand between; empty: none does."""
    block = rest or packed.read(_BLOCK_BYTES)
    while block and not block.strip(b"\0"):
        block = packed.read(_BLOCK_BYTES)
    return block.lstrip(b"\0")


def _read_telemetry_named(path: Path, unpacked: Path, tell: Tell) -> list[AutopilotLog]:
    try:
        return _read_telemetry(unpacked, tell)
    except AutopilotLogError as error:
        raise AutopilotLogError(str(error).replace(str(unpacked), str(path))) from error
