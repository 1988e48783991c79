"""An autopilot's own log as records in its own time, whatever file it came from."""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields, replace

import numpy as np

from drivers.clock import NS_PER_S
from mission.autopilot import VehicleState
from mission.imports.motion import Motion
from mission.log.channels import CHANNEL_OF, RateLimit
from mission.log.imported import (
    ImportedActuators,
    ImportedMode,
    ImportedPower,
    ImportedRecord,
    ImportedSetpoint,
    ImportedState,
    ImportedText,
)

_MAX_UPTIME_NS = 4 * 86_400 * NS_PER_S  # a time beyond this is a damaged one, and would outrun all that follow
_MAX_DISTANCE_M, _MAX_SPEED_M_S = 1e6, 1e3

Tell = Callable[[float], None]
"""Hears how much of a file has been read, 0 to 1."""


@dataclass(frozen=True, slots=True)
class AutopilotLog:
    """What an autopilot logged between two starts of its own; `t_ns` in `records` is its time since it started.

    `records` are in the order of their times. `has_own_origin` says that its positions may be told from another origin
    than those of its telemetry. `is_damaged` says that parts could not be read, `breaks_off` that the file shows
    that it ends before its time.
    """

    kind: str
    version: str
    vehicle: str
    has_own_origin: bool
    is_damaged: bool
    breaks_off: bool
    records: tuple[ImportedRecord, ...]

    @property
    def states(self) -> tuple[ImportedState, ...]:
        """The estimates alone."""
        return tuple(record for record in self.records if isinstance(record, ImportedState))


class Collector:
    """Gathers what a log's messages tell, thinned to what a flight log keeps of each stream (mission.log.channels)."""

    def __init__(self) -> None:
        self._records: list[ImportedRecord] = []
        self._limits: dict[type, RateLimit] = {}
        self._newest_state_ns = -1
        self._mode = ""

    @property
    def n_states(self) -> int:
        """How many estimates there are."""
        return sum(isinstance(record, ImportedState) for record in self._records)

    def add(self, record: ImportedRecord) -> None:
        """Keep a record, unless it says nothing, or comes too soon after the one before."""
        if not 0 <= record.t_ns < _MAX_UPTIME_NS or not _says_something(record):
            return
        if isinstance(record, ImportedMode):
            if record.mode == self._mode:
                return
            self._mode = record.mode
        if isinstance(record, ImportedState) and record.t_ns <= self._newest_state_ns:
            return  # told twice, or a damaged time
        rate_hz = CHANNEL_OF[type(record)].max_rate_hz
        if rate_hz is not None and not self._limits.setdefault(type(record), RateLimit(rate_hz)).admits(record.t_ns):
            return
        if isinstance(record, ImportedState):
            self._newest_state_ns = record.t_ns
        self._records.append(record)

    def extend_text(self, more: str) -> None:
        """Go on with the last message: telemetry sends long ones in pieces."""
        for index in range(len(self._records) - 1, -1, -1):
            record = self._records[index]
            if isinstance(record, ImportedText):
                self._records[index] = replace(record, text=record.text + more)
                return

    def log(
        self,
        kind: str,
        version: str,
        vehicle: str,
        *,
        has_own_origin: bool = False,
        is_damaged: bool = False,
        breaks_off: bool = False,
    ) -> AutopilotLog:
        """All of it, in the order of times. Outputs after the last that ever turned are no motors."""
        told = [record.motors for record in self._records if isinstance(record, ImportedActuators)]
        n_motors = max((n for motors in told for n, motor in enumerate(motors, 1) if motor > 0), default=None)
        records = (
            replace(record, motors=record.motors[:n_motors]) if isinstance(record, ImportedActuators) else record
            for record in self._records
        )
        in_order = tuple(sorted(records, key=lambda record: record.t_ns))
        return AutopilotLog(kind, version, vehicle, has_own_origin, is_damaged, breaks_off, in_order)


def measured(value: float, *, least: float = -math.inf) -> float | None:
    """A figure as it was measured; None for NaN, infinity and what stands for unknown (less than `least`)."""
    value = float(value)
    return value if math.isfinite(value) and value >= least else None


def share(pulse_us: float, low_us: float = 1000.0, high_us: float = 2000.0) -> float:
    """A motor's pulse length [us] as 0 to 1."""
    return min(max((float(pulse_us) - low_us) / (high_us - low_us), 0.0), 1.0)


def motion_of(states: Iterable[ImportedState | VehicleState]) -> Motion:
    """The motion that states show, in their own time; what repeats a moment is left out."""
    rows = []
    newest_ns = None
    for state in states:
        if newest_ns is None or state.t_ns > newest_ns:
            newest_ns = state.t_ns
            rows.append(
                (
                    state.t_ns / NS_PER_S,
                    *(state.north_m, state.east_m, state.down_m),
                    *(state.v_north_m_s, state.v_east_m_s, state.v_down_m_s),
                    state.yaw_rad,
                )
            )
    table = np.array(rows, dtype=np.float64).reshape(-1, 8)
    table = table[np.isfinite(table).all(axis=1)]
    return Motion(table[:, 0], table[:, 1:4], table[:, 4:7], table[:, 7])


def _says_something(record: ImportedRecord) -> bool:
    match record:
        case ImportedState():
            # Also refuses NaN; more is no vehicle's flight but damage.
            return (
                all(abs(value) < _MAX_DISTANCE_M for value in (record.north_m, record.east_m, record.down_m))
                and all(
                    abs(value) < _MAX_SPEED_M_S for value in (record.v_north_m_s, record.v_east_m_s, record.v_down_m_s)
                )
                and all(abs(value) < math.tau for value in (record.roll_rad, record.pitch_rad, record.yaw_rad))
            )
        case ImportedSetpoint() | ImportedPower():
            return any(getattr(record, field.name) is not None for field in fields(record)[1:])
        case ImportedActuators():
            return bool(record.motors)
        case ImportedText():
            return bool(record.text)
        case ImportedMode():
            return bool(record.mode)
