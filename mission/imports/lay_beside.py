"""Lay an autopilot's own log beside ours: align the clocks, check the motion, and write both to a new log."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

from mission.imports.align import ClockMap, Fit, check_motion, match_motion
from mission.imports.autopilot_log import AutopilotLog, motion_of
from mission.imports.boot_clock import BootClock, boot_clock
from mission.imports.errors import NoMatchError
from mission.imports.motion import Motion
from mission.log.imported import ImportedLog, ImportedRecord, ImportedSetpoint, ImportedState
from mission.log.reader import Flight

TIME_SYNC, BOOT_TIMES, MOTION = "time_sync", "boot_times", "motion"
_NO_SHIFT = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Alignment:
    """How an autopilot's log lies on our time line; `telemetry_lag_s` is known where the clocks were synced."""

    log: AutopilotLog
    clock: ClockMap
    fit: Fit
    aligned_by: str
    telemetry_lag_s: float | None

    @property
    def shift_ned_m(self) -> tuple[float, float, float]:
        """What is added to its positions [m]: only those of a log with an origin of its own are moved."""
        if not self.log.has_own_origin:
            return _NO_SHIFT
        north_m, east_m, down_m = self.fit.shift_m.tolist()
        return north_m, east_m, down_m

    @property
    def unexplained_shift_m(self) -> float:
        """How far its positions lie from ours on average [m], when they ought to have our origin."""
        return 0.0 if self.log.has_own_origin else math.hypot(*self.fit.shift_m.tolist())


def align_best(flight: Flight, logs: list[AutopilotLog]) -> Alignment:
    """Align that one of a file's logs which fits best to our flight.

    Raises NoMatchError, with the reason of the one with the most motion, when none of them is of this flight.
    """
    ours = motion_of(flight.states)
    if ours.t_s.size < 2:
        raise NoMatchError("our log holds no motion")
    known = boot_clock(flight.states, flight.syncs)
    found: list[Alignment] = []
    refused: list[tuple[int, NoMatchError]] = []
    for log in logs:
        try:
            found.append(_align(ours, log, known))
        except NoMatchError as error:
            refused.append((len(log.states), error))
    if not found:
        raise max(refused, key=lambda each: each[0])[1]
    return max(found, key=lambda each: each.fit.correlation)


def _align(ours: Motion, log: AutopilotLog, known: BootClock | None) -> Alignment:
    """By the boot clock where our log knows it: another flight of the same mission moves alike, but at other times."""
    theirs = motion_of(log.states)
    if known is None:
        clock, fit = match_motion(ours, theirs)
        return Alignment(log, clock, fit, MOTION, None)
    lag_s, fit = check_motion(ours, theirs, known.clock)
    if known.is_synced:
        return Alignment(log, known.clock, fit, TIME_SYNC, lag_s)
    return Alignment(log, known.clock, fit, BOOT_TIMES, None)


def imported_log(alignment: Alignment, file: str, sha256: str, *, was_cut_off: bool) -> ImportedLog:
    """What the new log tells of the import."""
    log, clock, fit = alignment.log, alignment.clock, alignment.fit
    return ImportedLog(
        file=file,
        kind=log.kind,
        version=log.version,
        vehicle=log.vehicle,
        sha256=sha256,
        offset_s=clock.offset_s,
        drift_ppm=clock.drift * 1e6,
        reference_s=clock.reference_s,
        aligned_by=alignment.aligned_by,
        telemetry_lag_s=alignment.telemetry_lag_s,
        correlation=fit.correlation,
        overlap_s=fit.overlap_s,
        velocity_rms_m_s=fit.velocity_rms_m_s,
        position_rms_m=fit.position_rms_m,
        shift_ned_m=alignment.shift_ned_m,
        was_cut_off=was_cut_off,
    )


def on_our_time_line(alignment: Alignment) -> Iterator[ImportedRecord]:
    """The autopilot's records in flight time and our local frame, in the order of their times."""
    north_m, east_m, down_m = alignment.shift_ned_m
    for record in alignment.log.records:
        t_ns = alignment.clock.ours_ns(record.t_ns)
        if isinstance(record, ImportedState):
            yield replace(
                record,
                t_ns=t_ns,
                north_m=record.north_m + north_m,
                east_m=record.east_m + east_m,
                down_m=record.down_m + down_m,
            )
        elif isinstance(record, ImportedSetpoint):
            yield replace(
                record,
                t_ns=t_ns,
                north_m=_moved(record.north_m, north_m),
                east_m=_moved(record.east_m, east_m),
                down_m=_moved(record.down_m, down_m),
            )
        else:
            yield replace(record, t_ns=t_ns)


def _moved(position_m: float | None, shift_m: float) -> float | None:
    return None if position_m is None else position_m + shift_m
