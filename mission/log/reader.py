"""Read a flight back from its log, also from one that was cut off when the power went, or damaged since."""

import json
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from drivers.camera.camera import Intrinsics
from drivers.mcap_stream import IMAGE_DATA_FIELD, IMAGE_TOPIC, Damage, McapFile, bytes_field, open_messages
from mission.autopilot import VehicleState
from mission.log import channels
from mission.log.damage import Flaws, damage_of
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
_IMPORTED_LOG_TOPIC = channels.CHANNEL_OF[ImportedLog].topic
_NOT_FLOWN = (*_IMPORTED, *channels.CAPTURE_TIMED)  # whose times do not tell when the flight ended


@dataclass(frozen=True, slots=True)
class Flight:
    """All that a log holds, each stream in the order of its times; flight time [ns] throughout.

    `is_truncated` says that the log was never closed: the program or the computer died. `reports` carry their JPEGs
    only when the flight was read with images; `image_times_ns` tells of which frames the log has one. `imported` is the
    autopilot's own log, where `lineflight import` has laid it beside ours; `end_ns` does not count it. A reference log
    also holds what a replay made of it (mission/replay). `damage` tells what of the log could
    not be read.
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
    damage: Damage | None = None

    @property
    def flaws(self) -> Flaws:
        """What the log lacks."""
        return Flaws(self.damage, self.is_truncated)

    @property
    def holes_ns(self) -> tuple[tuple[int, int], ...]:
        """From when to when [ns, flight] damaged parts of the log lie, in order, as far as known."""
        if self.damage is None:
            return ()
        offset_ns = self.mission.unix_minus_flight_ns
        return tuple(sorted((begin - offset_ns, end - offset_ns) for begin, end in self.damage.holes_ns))

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

    Damaged parts are passed over. Raises LogError when `path` is not the log of a flight, or nothing of it can be read.
    """
    streams: dict[type, list[Any]] = defaultdict(list)
    jpegs: dict[int, bytes] = {}
    offset_ns = 0
    with _opened(path) as log:
        for topic, log_time_ns, content in _contents(path, log):
            if topic in channels.CHANNEL_AT:
                streams[type(content)].append(content)
                offset_ns = log_time_ns - getattr(content, "t_ns", log_time_ns - offset_ns)
            elif with_images:
                jpegs[log_time_ns] = content
        if not streams[LoggedMission]:
            streams[LoggedMission].append(_lost_mission(path, log, streams, offset_ns))
        return _flight(path, streams, jpegs, log)


def stream_log(path: Path) -> Iterator[tuple[str, int, Any]]:
    """Topic, log time [ns, Unix] and content of what a log holds, in the order written, without holding it.

    The content is a record where the topic is one of RECORD_CHANNELS, and a frame's JPEG where it is IMAGE_TOPIC;
    there are no others. Raises LogError as `read_flight` does.
    """
    with _opened(path) as log:
        yield from _contents(path, log)


def find_flaws(path: Path) -> Flaws:
    """Read a whole log only to see what it lacks. Raises LogError where it cannot be read at all."""
    was_cut_off = False  # before the autopilot's log was laid beside it, in a copy
    with _opened(path) as log:
        for topic, _, body in log.messages():
            if topic == _IMPORTED_LOG_TOPIC:
                was_cut_off = channels.decode(topic, body).was_cut_off
        return Flaws(damage_of(log), not log.is_closed or was_cut_off)


@contextmanager
def _opened(path: Path) -> Iterator[McapFile]:
    """The file of a log. Raises LogError where it is none, or cannot be read any more."""
    try:
        if path.is_dir():
            raise LogError(f"{path} is a folder; name one of the .mcap files in it.")
        with path.open("rb") as file:
            if not file.read(1):
                raise LogError(f"The log {path} is empty; the flight ended before anything was written to it.")
            try:
                log = McapFile(file)
            except ValueError:
                raise LogError(f"{path} is not an MCAP file; name a log that lineflight wrote (.mcap).") from None
            yield log
    except OSError as error:
        raise LogError(f"The log {path} cannot be read ({error.strerror}); check its name and its rights.") from error


def _contents(path: Path, log: McapFile) -> Iterator[tuple[str, int, Any]]:
    """What `stream_log` yields, of an open log."""
    has_mission = has_records = False
    try:
        for topic, log_time_ns, body in log.messages():
            if topic in channels.CHANNEL_AT:
                record = channels.decode(topic, body)
                has_mission = has_mission or isinstance(record, LoggedMission)
                has_records = has_records or hasattr(record, "t_ns")
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
    except Exception as error:  # the library and the parser each have their own
        raise LogError(f"The log {path} is damaged, and cannot be read; take a copy of it, if there is one.") from error
    if has_mission:
        return
    if damage_of(log) is None:
        raise LogError(f"{path} holds no mission; it is not the log of a flight, or was cut off at its very start.")
    if not has_records:
        raise LogError(f"The log {path} is damaged, and nothing of a flight is left in it; is there a copy of it?")


def _lost_mission(path: Path, log: McapFile, streams: dict[type, list[Any]], offset_ns: int) -> LoggedMission:
    """What was flown, where the log's record of it is damaged: from what the log says of it besides."""
    metadata = dict(log.metadata.get(channels.PROFILE, {}))
    metadata.pop("unix_minus_flight_ns", None)
    return LoggedMission(
        name=metadata.pop("mission", path.stem),
        text=log.attachments.get("mission.yaml", b"").decode(),
        sha256=metadata.pop("mission_sha256", ""),
        start_ns=min(record.t_ns for records in streams.values() for record in records if hasattr(record, "t_ns")),
        unix_minus_flight_ns=offset_ns,
        metadata=metadata,
    )


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


def _flight(path: Path, streams: dict[type, list[Any]], jpegs: dict[int, bytes], log: McapFile) -> Flight:
    for records in streams.values():
        records.sort(key=lambda record: getattr(record, "t_ns", 0))
    mission: LoggedMission = streams[LoggedMission][0]
    offset_ns = mission.unix_minus_flight_ns
    imported = _imported(streams)
    times_ns = [
        records[-1].t_ns
        for kind, records in streams.items()
        if records and hasattr(records[-1], "t_ns") and kind not in _NOT_FLOWN
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
        attachments=log.attachments,
        image_times_ns=frozenset(entry.t_ns for entry in streams[VisionEntry] if entry.has_image),
        imported=imported,
        reference_estimates=tuple(streams[ReplayedEstimate]),
        reference_setpoints=tuple(streams[ReplayedSetpoint]),
        end_ns=max([mission.start_ns, *times_ns]),
        is_truncated=not log.is_closed or (imported is not None and imported.log.was_cut_off),
        damage=damage_of(log),
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
