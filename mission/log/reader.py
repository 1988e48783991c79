"""Read a flight back from its log, also from one that was cut off when the power went."""

import io
import struct
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from mcap.exceptions import EndOfFile
from mcap.records import Channel, Message
from mcap.stream_reader import StreamReader

from mission.autopilot import VehicleState
from mission.log import channels
from mission.log.errors import LogError
from mission.log.records import LoggedMission, SentSetpoint, StatusText, VisionEntry
from mission.records import Event, MissionEnded, TaskEnded, TaskStarted, TrueLine, TruePose
from vision.records import VisionReport

_MAGIC = b"\x89MCAP0\r\n"
_RECORD_HEADER = struct.Struct("<BQ")  # opcode, length of what follows [bytes]
_FOOTER_OPCODE = 0x02
_IMAGE_DATA_FIELD = 2  # `data` of foxglove.CompressedImage
_VARINT, _BYTES = 0, 2  # protobuf's wire types
_FIXED_BYTES = {1: 8, 5: 4}


@dataclass(frozen=True, slots=True)
class Flight:
    """All that a log holds, each stream in the order of its times; flight time [ns] throughout.

    `is_truncated` says that the log was never closed: the program or the computer died. `reports` carry their JPEGs
    only when the flight was read with images.
    """

    path: Path
    mission: LoggedMission
    states: tuple[VehicleState, ...]
    setpoints: tuple[SentSetpoint, ...]
    reports: tuple[VisionReport, ...]
    tasks_started: tuple[TaskStarted, ...]
    tasks_ended: tuple[TaskEnded, ...]
    mission_ended: MissionEnded | None
    events: tuple[Event, ...]
    status_texts: tuple[StatusText, ...]
    truth: tuple[TruePose, ...]
    line: TrueLine | None
    end_ns: int
    is_truncated: bool


def read_flight(path: Path, *, with_images: bool = False) -> Flight:
    """Read a flight's log; `with_images` keeps the frames too, which may need much memory.

    Raises LogError when `path` is not the log of a flight, or is damaged.
    """
    if path.is_dir():
        raise LogError(f"{path} is a folder; name one of the .mcap files in it.")
    try:
        with path.open("rb") as file:
            return _read(path, file, with_images)
    except OSError as error:
        raise LogError(f"The log {path} cannot be read ({error.strerror}); check its name and its rights.") from error


def _read(path: Path, file: BinaryIO, with_images: bool) -> Flight:
    magic = file.read(len(_MAGIC))
    if not magic:
        raise LogError(f"The log {path} is empty; the flight ended before anything was written to it.")
    if magic != _MAGIC:
        raise LogError(f"{path} is not an MCAP file; name a log that lineflight wrote (.mcap).")
    whole_bytes, is_closed = _whole_records(file)
    file.seek(0)
    streams: dict[type, list[Any]] = defaultdict(list)
    jpegs: dict[int, bytes] = {}
    try:
        for topic, log_time_ns, body in _messages(io.BytesIO(file.read(whole_bytes))):
            if topic in channels.CHANNEL_AT:
                streams[channels.CHANNEL_AT[topic].record].append(channels.decode(topic, body))
            elif with_images and topic == channels.IMAGE.topic:
                jpegs[log_time_ns] = _bytes_field(body, _IMAGE_DATA_FIELD)
    except Exception as error:  # the decompressor, the decoder and the parser each have their own
        raise LogError(f"The log {path} is damaged ({type(error).__name__}: {error}); recover it with mcap.") from error
    if not streams[LoggedMission]:
        raise LogError(f"{path} holds no mission; it is not the log of a flight, or was cut off at its very start.")
    return _flight(path, streams, jpegs, is_truncated=not is_closed)


def _flight(path: Path, streams: dict[type, list[Any]], jpegs: dict[int, bytes], *, is_truncated: bool) -> Flight:
    for records in streams.values():
        records.sort(key=lambda record: getattr(record, "t_ns", 0))
    mission: LoggedMission = streams[LoggedMission][0]
    offset_ns = mission.unix_minus_flight_ns
    times_ns = [records[-1].t_ns for records in streams.values() if records and hasattr(records[-1], "t_ns")]
    ended, lines = streams[MissionEnded], streams[TrueLine]
    return Flight(
        path=path,
        mission=mission,
        states=tuple(streams[VehicleState]),
        setpoints=tuple(streams[SentSetpoint]),
        reports=tuple(_report(entry, jpegs.get(entry.t_ns + offset_ns)) for entry in streams[VisionEntry]),
        tasks_started=tuple(streams[TaskStarted]),
        tasks_ended=tuple(streams[TaskEnded]),
        mission_ended=ended[-1] if ended else None,
        events=tuple(streams[Event]),
        status_texts=tuple(streams[StatusText]),
        truth=tuple(streams[TruePose]),
        line=lines[-1] if lines else None,
        end_ns=max([mission.start_ns, *times_ns]),
        is_truncated=is_truncated,
    )


def _report(entry: VisionEntry, jpeg: bytes | None) -> VisionReport:
    power_lines = np.array(entry.power_lines_px, dtype=np.float64).reshape(-1, 4)
    power_lines.setflags(write=False)
    return VisionReport(
        seq=entry.seq,
        t_capture_ns=entry.t_ns,
        estimate=entry.estimate,
        track=entry.track,
        trouble=entry.trouble,
        power_lines=power_lines,
        latency_ns=entry.latency_ns,
        work_ns=entry.work_ns,
        n_dropped=entry.n_dropped,
        jpeg=jpeg,
    )


def _whole_records(file: BinaryIO) -> tuple[int, bool]:
    """How many bytes of the file hold whole records, and whether the last of them is the footer.

    A log that was cut off ends within a record; what stands before it is sound.
    """
    size = file.seek(0, io.SEEK_END)
    end = len(_MAGIC)
    while end + _RECORD_HEADER.size <= size:
        file.seek(end)
        opcode, length = _RECORD_HEADER.unpack(file.read(_RECORD_HEADER.size))
        if end + _RECORD_HEADER.size + length > size:
            break
        next_record = end + _RECORD_HEADER.size + length
        if opcode == _FOOTER_OPCODE:
            is_closed = size >= next_record + len(_MAGIC)
            return (size if is_closed else end), is_closed
        end = next_record
    return end, False


def _messages(stream: BinaryIO) -> Iterator[tuple[str, int, bytes]]:
    """Topic, log time [ns, Unix] and body of each message, in the order written."""
    topics: dict[int, str] = {}
    try:
        for record in StreamReader(stream, validate_crcs=True, record_size_limit=None).records:
            if isinstance(record, Channel):
                topics[record.id] = record.topic
            elif isinstance(record, Message):
                yield topics[record.channel_id], record.log_time, record.data
    except EndOfFile:
        # The stream holds whole records only: this is the end of a log that was never closed.
        return


def _bytes_field(message: bytes, number: int) -> bytes:
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
