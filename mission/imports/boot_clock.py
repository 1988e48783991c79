"""How the autopilot's clock stood to ours, as our own log noted it: no motion is needed for that."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.clock import NS_PER_S
from mission.autopilot import VehicleState
from mission.imports.align import MIN_DRIFT_OVERLAP_S, ClockMap
from mission.records import ClockSync

_MIN_SYNCS = 3
_MIN_STATES = 100
_SLACK_NS = 1_000_000
_MAX_RESIDUAL_S = 0.25  # more is no clock's drift: the autopilot restarted


@dataclass(frozen=True, slots=True)
class BootClock:
    """Autopilot time in flight time; `is_synced` by time syncs, else the telemetry's delay is still in it."""

    clock: ClockMap
    is_synced: bool


def boot_clock(states: Sequence[VehicleState], syncs: Sequence[ClockSync]) -> BootClock | None:
    """Work out how autopilot time reads in flight time, from the time syncs, or else from the states' boot times.

    None where the log holds neither, or where the autopilot restarted while it ran. The states tell the clock only to
    some tens of milliseconds: their two times are those of different messages.
    """
    if len(syncs) >= _MIN_SYNCS:
        # An answer that came quickly pins the time down best; half of a slow one's way may be anything.
        longest_ns = 2 * min(sync.round_trip_ns for sync in syncs) + _SLACK_NS
        quick = [sync for sync in syncs if sync.round_trip_ns <= longest_ns]
        clock = _line(np.array([sync.t_ns for sync in quick]), np.array([sync.boot_minus_flight_ns for sync in quick]))
        return None if clock is None else BootClock(clock, is_synced=True)
    timed = [(state.t_ns, state.boot_ns) for state in states if state.boot_ns is not None]
    if len(timed) < _MIN_STATES:
        return None
    flight_ns, boot_ns = np.array(timed, dtype=np.int64).T
    clock = _line(flight_ns, boot_ns - flight_ns)
    return None if clock is None else BootClock(clock, is_synced=False)


def _line(flight_ns: NDArray[np.int64], boot_minus_flight_ns: NDArray[np.int64]) -> ClockMap | None:
    """A straight line through the differences, as a map from boot time to flight time."""
    middle_ns = int(np.median(flight_ns))
    level_ns = int(np.median(boot_minus_flight_ns))
    since_s = (flight_ns - middle_ns) / NS_PER_S
    ahead_s = (boot_minus_flight_ns - level_ns) / NS_PER_S
    slope, start_s = 0.0, 0.0
    if np.ptp(since_s) >= MIN_DRIFT_OVERLAP_S:
        slope, start_s = (float(value) for value in np.polyfit(since_s, ahead_s, 1))
    if np.percentile(np.abs(ahead_s - start_s - slope * since_s), 90) > _MAX_RESIDUAL_S:
        return None
    offset_s = -(level_ns / NS_PER_S + start_s)
    return ClockMap(offset_s, 1 / (1 + slope) - 1, middle_ns / NS_PER_S - offset_s)
