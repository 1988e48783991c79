"""Read a flight back from its log, also from one that was cut off when the power went."""

import json
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from pydantic import ValidationError

from drivers.camera.camera import Intrinsics
from drivers.mcap_stream import IMAGE_DATA_FIELD, IMAGE_TOPIC, MAGIC, bytes_field, open_messages, whole_records
from mission.autopilot import VehicleState
from mission.log import channels
from mission.log.errors import LogError
from mission.log.imported import (
    Imported,
    ImportedActuators,
    ImportedLog,
    ImportedMode,
    ImportedPower,
    ImportedSetpoint,
    ImportedState,
    ImportedText,
)
from mission.log.records import LoggedMission, LogHealth, SentSetpoint, StatusText, VisionEntry
from mission.records import (
    AutopilotTarget,
    ClockSync,
    ControlTick,
    Event,
    FlightStart,
    LineFix,
    MissionEnded,
    Origin,
    PreflightCheck,
    TaskEnded,
    TaskStarted,
    TrueLine,
    TruePose,
)
from mission.replay.records import ReplayedEstimate, ReplayedSetpoint
from vision.records import VisionReport

_IMPORTED = (ImportedState, ImportedSetpoint, ImportedActuators, ImportedPower, ImportedText, ImportedMode)


@dataclass(frozen=True, slots=True)
class Flight:
    """All that a log holds, each stream in the order of its times; flight time [ns] throughout.

    `is_truncated` says that the log was never closed: the program or the computer died. `reports` carry their JPEGs
    only when the flight was read with images; `image_times_ns` tells of which frames the log has one. `imported` is the
    autopilot's own log, where `lineflight import` has laid it beside ours; `end_ns` does not count it. A reference log
    also holds what a replay made of it (mission/replay).
    """

    path: Path
    mission: LoggedMission
    checks: tuple[PreflightCheck, ...]
    states: tuple[VehicleState, ...]
    setpoints: tuple[SentSetpoint, ...]
    reports: tuple[VisionReport, ...]
    fixes: tuple[LineFix, ...]
    tasks_started: tuple[TaskStarted, ...]
    tasks_ended: tuple[TaskEnded, ...]
    mission_ended: MissionEnded | None
    events: tuple[Event, ...]
    status_texts: tuple[StatusText, ...]
    truth: tuple[TruePose, ...]
    line: TrueLine | None
    origin: Origin | None
    start: FlightStart | None
    targets: tuple[AutopilotTarget, ...]
    ticks: tuple[ControlTick, ...]
    syncs: tuple[ClockSync, ...]
    health: tuple[LogHealth, ...]
    attachments: dict[str, bytes]
    image_times_ns: frozenset[int]
    imported: Imported | None
    reference_estimates: tuple[ReplayedEstimate, ...]
    reference_setpoints: tuple[ReplayedSetpoint, ...]
    end_ns: int
    is_truncated: bool

    @property
    def camera(self) -> Intrinsics | None:
        """The camera that the log's frames are from; None where the log does not tell. Raises LogError."""
        text = self.attachments.get("camera.json") or self.mission.metadata.get("camera_intrinsics")
        if text is None:
            return None
        try:
            fields = json.loads(text)
            return Intrinsics(**fields | {"distortion": tuple(fields["distortion"])})
        except (KeyError, TypeError, ValueError) as error:
            raise LogError(f"The camera's intrinsics in {self.path} cannot be read ({error}).") from error


def read_flight(path: Path, *, with_images: bool = False) -> Flight:
    """Read a flight's log; `with_images` keeps the frames too, which may need much memory.

    Raises LogError when `path` is not the log of a flight, or is damaged.
    """
    streams: dict[type, list[Any]] = defaultdict(list)
    jpegs: dict[int, bytes] = {}
    attachments: dict[str, bytes] = {}
    with _opened(path) as file:
        _, is_closed = whole_records(file)
        for topic, log_time_ns, content in _contents(path, file, attachments):
            if topic in channels.CHANNEL_AT:
                streams[type(content)].append(content)
            elif with_images:
                jpegs[log_time_ns] = content
    return _flight(path, streams, jpegs, attachments, is_truncated=not is_closed)


def stream_log(path: Path) -> Iterator[tuple[str, int, Any]]:
    """Topic, log time [ns, Unix] and content of what a log holds, in the order written, without holding it.

    The content is a record where the topic is one of RECORD_CHANNELS, and a frame's JPEG where it is IMAGE_TOPIC;
    there are no others. Raises LogError as `read_flight` does.
    """
    with _opened(path) as file:
        yield from _contents(path, file, {})


@contextmanager
def _opened(path: Path) -> Iterator[BinaryIO]:
    """The file of a log. Raises LogError where it is none, or cannot be read any more."""
    try:
        if path.is_dir():
            raise LogError(f"{path} is a folder; name one of the .mcap files in it.")
        with path.open("rb") as file:
            magic = file.read(len(MAGIC))
            if not magic:
                raise LogError(f"The log {path} is empty; the flight ended before anything was written to it.")
            if magic != MAGIC:
                raise LogError(f"{path} is not an MCAP file; name a log that lineflight wrote (.mcap).")
            yield file
    except OSError as error:
        raise LogError(f"The log {path} cannot be read ({error.strerror}); check its name and its rights.") from error


def _contents(path: Path, file: BinaryIO, attachments: dict[str, bytes]) -> Iterator[tuple[str, int, Any]]:
    """What `stream_log` yields, of an open log; fills `attachments` by name."""
    has_mission = False
    file.seek(0)
    try:
        for topic, log_time_ns, body in open_messages(file, attachments):
            if topic in channels.CHANNEL_AT:
                record = channels.decode(topic, body)
                has_mission = has_mission or isinstance(record, LoggedMission)
                yield topic, log_time_ns, record
            elif topic == IMAGE_TOPIC:
                yield topic, log_time_ns, bytes_field(body, IMAGE_DATA_FIELD)
    except OSError:
        raise
    except ValidationError as error:
        first = error.errors()[0]
        raise LogError(
            f"The log {path} was written by another version of lineflight ({first['type']} at "
            f"{'.'.join(map(str, first['loc']))}); read it with that one."
        ) from error
    except Exception as error:  # the decompressor, the decoder and the parser each have their own
        raise LogError(f"The log {path} is damaged ({type(error).__name__}: {error}); recover it with mcap.") from error
    if not has_mission:
        raise LogError(f"{path} holds no mission; it is not the log of a flight, or was cut off at its very start.")


def read_images(flight: Flight) -> Iterator[tuple[int, bytes]]:
    """Capture time [ns, flight] and JPEG of each frame that a flight's log holds, one after the other.

    Raises LogError when the file cannot be read any more.
    """
    try:
        with flight.path.open("rb") as file:
            for topic, log_time_ns, body in open_messages(file):
                if topic == IMAGE_TOPIC:
                    jpeg = bytes_field(body, IMAGE_DATA_FIELD)
                    yield log_time_ns - flight.mission.unix_minus_flight_ns, jpeg
    except OSError as error:
        raise LogError(f"The log {flight.path} cannot be read ({error.strerror}); is its disk still there?") from error


def _flight(
    path: Path,
    streams: dict[type, list[Any]],
    jpegs: dict[int, bytes],
    attachments: dict[str, bytes],
    *,
    is_truncated: bool,
) -> Flight:
    for records in streams.values():
        records.sort(key=lambda record: getattr(record, "t_ns", 0))
    mission: LoggedMission = streams[LoggedMission][0]
    offset_ns = mission.unix_minus_flight_ns
    imported = _imported(streams)
    times_ns = [
        records[-1].t_ns
        for kind, records in streams.items()
        if records and hasattr(records[-1], "t_ns") and kind not in _IMPORTED
    ]
    ended, lines, origins = streams[MissionEnded], streams[TrueLine], streams[Origin]
    return Flight(
        path=path,
        mission=mission,
        checks=tuple(streams[PreflightCheck]),
        states=tuple(streams[VehicleState]),
        setpoints=tuple(streams[SentSetpoint]),
        reports=tuple(_report(entry, jpegs.get(entry.t_ns + offset_ns)) for entry in streams[VisionEntry]),
        fixes=tuple(streams[LineFix]),
        tasks_started=tuple(streams[TaskStarted]),
        tasks_ended=tuple(streams[TaskEnded]),
        mission_ended=ended[-1] if ended else None,
        events=tuple(streams[Event]),
        status_texts=tuple(streams[StatusText]),
        truth=tuple(streams[TruePose]),
        line=lines[-1] if lines else None,
        origin=origins[-1] if origins else None,
        start=streams[FlightStart][-1] if streams[FlightStart] else None,
        targets=tuple(streams[AutopilotTarget]),
        ticks=tuple(streams[ControlTick]),
        syncs=tuple(streams[ClockSync]),
        health=tuple(streams[LogHealth]),
        attachments=attachments,
        image_times_ns=frozenset(entry.t_ns for entry in streams[VisionEntry] if entry.has_image),
        imported=imported,
        reference_estimates=tuple(streams[ReplayedEstimate]),
        reference_setpoints=tuple(streams[ReplayedSetpoint]),
        end_ns=max([mission.start_ns, *times_ns]),
        is_truncated=is_truncated or (imported is not None and imported.log.was_cut_off),
    )


def _imported(streams: dict[type, list[Any]]) -> Imported | None:
    if not streams[ImportedLog]:
        return None
    return Imported(streams[ImportedLog][-1], *(tuple(streams[kind]) for kind in _IMPORTED))


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
