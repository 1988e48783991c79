"""The records that only the log knows: what it keeps beside the flight's own records."""

from dataclasses import dataclass

from vision.records import LineEstimate, Track, Trouble


@dataclass(frozen=True, slots=True)
class LoggedMission:
    """What was flown, and how the log's two times belong together.

    `text` is the mission file as it was read and `sha256` the hex digest of its UTF-8 bytes. Records carry flight time
    `t_ns`; the log files them under Unix time, which is `t_ns + unix_minus_flight_ns`. The log began at `start_ns`.
    """

    name: str
    text: str
    sha256: str
    start_ns: int
    unix_minus_flight_ns: int
    metadata: dict[str, str]


@dataclass(frozen=True, slots=True)
class SentSetpoint:
    """A setpoint and when it was sent: flight time [ns], NED [m], yaw [rad]."""

    t_ns: int
    north_m: float
    east_m: float
    down_m: float
    yaw_rad: float


@dataclass(frozen=True, slots=True)
class StatusText:
    """The autopilot's own words (MAVLink STATUSTEXT)."""

    t_ns: int
    text: str


@dataclass(frozen=True, slots=True)
class LogHealth:
    """How the log itself does, told once a second by its writer, and a last time when all has been written.

    `n_bytes` are on the disk; `n_waiting` records wait for it. `n_dropped_images` and `n_dropped_records` were given up
    so far, because it was too slow. `work_s` is the processor time that writing has taken so far.
    """

    t_ns: int
    n_bytes: int
    n_waiting: int
    n_dropped_images: int
    n_dropped_records: int
    work_s: float


@dataclass(frozen=True, slots=True)
class VisionEntry:
    """A VisionReport without its image; `power_lines_px` holds x1, y1, x2, y2 of each. Filed under its capture time."""

    t_ns: int
    seq: int
    estimate: LineEstimate | None
    track: Track
    trouble: Trouble | None
    power_lines_px: tuple[tuple[float, float, float, float], ...]
    latency_ns: int
    work_ns: int
    n_dropped: int
    has_image: bool
