"""What `lineflight import` adds to a log: an autopilot's own log, on our time line.

`t_ns` is flight time [ns] (drivers.clock) in all of them, whatever clock the autopilot had.
"""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ImportedLog:
    """Which file was imported, and how its clock was aligned with ours.

    `kind` is ulog, dataflash or telemetry; `version` and `vehicle` are the autopilot's own words, empty where it has
    none; `sha256` is the file's hex digest. Flight time is
    `autopilot time + offset_s + drift_ppm / 1e6 * (autopilot time - reference_s)`, autopilot time counted from its
    start. `aligned_by` is time_sync, boot_times (those of our telemetry) or motion; with the last two, what came by
    telemetry counts as true when it arrived. With the first, `telemetry_lag_s` is how late it arrived on average.
    `correlation` (up to 1) over `overlap_s` of common flight, `velocity_rms_m_s` and `position_rms_m` say how well the
    motion agrees; `shift_ned_m` was added to the autopilot's positions. `was_cut_off` says that our own log had never
    been closed when it was copied.
    """

    file: str
    kind: str
    version: str
    vehicle: str
    sha256: str
    offset_s: float
    drift_ppm: float
    reference_s: float
    aligned_by: str
    telemetry_lag_s: float | None
    correlation: float
    overlap_s: float
    velocity_rms_m_s: float
    position_rms_m: float
    shift_ned_m: tuple[float, float, float]
    was_cut_off: bool


@dataclass(frozen=True, slots=True)
class ImportedState:
    """The autopilot's own estimate: NED [m], [m/s], attitude [rad] (FRD body to NED)."""

    t_ns: int
    north_m: float
    east_m: float
    down_m: float
    v_north_m_s: float
    v_east_m_s: float
    v_down_m_s: float
    roll_rad: float
    pitch_rad: float
    yaw_rad: float


@dataclass(frozen=True, slots=True)
class ImportedSetpoint:
    """What the autopilot's position control flew to: NED [m], [m/s], yaw [rad]; None where it controlled nothing."""

    t_ns: int
    north_m: float | None
    east_m: float | None
    down_m: float | None
    v_north_m_s: float | None
    v_east_m_s: float | None
    v_down_m_s: float | None
    yaw_rad: float | None


@dataclass(frozen=True, slots=True)
class ImportedActuators:
    """What the motors were told, 0 (off) to 1 (full), in the autopilot's order."""

    t_ns: int
    motors: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class ImportedPower:
    """The battery: voltage [V], current [A], remaining charge 0 to 1; None where it was not measured."""

    t_ns: int
    voltage_v: float | None
    current_a: float | None
    remaining: float | None


@dataclass(frozen=True, slots=True)
class ImportedText:
    """A message that the autopilot logged or said."""

    t_ns: int
    text: str


@dataclass(frozen=True, slots=True)
class ImportedMode:
    """The flight mode from `t_ns` on, by the autopilot's own name."""

    t_ns: int
    mode: str


ImportedRecord = ImportedState | ImportedSetpoint | ImportedActuators | ImportedPower | ImportedText | ImportedMode


@dataclass(frozen=True, slots=True)
class Imported:
    """All that was imported, each stream in the order of its times."""

    log: ImportedLog
    states: tuple[ImportedState, ...]
    setpoints: tuple[ImportedSetpoint, ...]
    actuators: tuple[ImportedActuators, ...]
    power: tuple[ImportedPower, ...]
    texts: tuple[ImportedText, ...]
    modes: tuple[ImportedMode, ...]
