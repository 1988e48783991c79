"""What the executive tells the log about a flight. Times are flight time [ns] (drivers.clock)."""

import enum
from dataclasses import dataclass


class Result(enum.StrEnum):
    """How a task or a mission ended."""

    COMPLETED = "completed"
    TIMED_OUT = "timed_out"
    FAILED = "failed"
    INTERRUPTED = "interrupted"
    TAKEN_OVER = "taken_over"


class Severity(enum.StrEnum):
    """How much an event matters to the person who reads it."""

    INFO = "info"
    WARNING = "warning"
    ERROR = "error"


class CheckResult(enum.StrEnum):
    """How a pre-flight check ended: a warning does not keep the vehicle on the ground."""

    OK = "ok"
    WARNING = "warning"
    FAILED = "failed"


@dataclass(frozen=True, slots=True)
class PreflightCheck:
    """What a pre-flight check found; `reason` is a sentence that a person can act on."""

    t_ns: int
    name: str
    result: CheckResult
    reason: str


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened; `name` is one of the table in docs/safety.md, `reaction` what was done about it."""

    t_ns: int
    name: str
    severity: Severity
    message: str
    reaction: str = "continue"


@dataclass(frozen=True, slots=True)
class TaskStarted:
    """The executive entered the mission's task number `index` (from 0)."""

    t_ns: int
    index: int
    task: str


@dataclass(frozen=True, slots=True)
class TaskEnded:
    """The executive left a task; `reason` is a sentence."""

    t_ns: int
    index: int
    task: str
    result: Result
    reason: str


@dataclass(frozen=True, slots=True)
class MissionEnded:
    """The flight is over: the vehicle stands disarmed, or control was given up."""

    t_ns: int
    result: Result
    reason: str


@dataclass(frozen=True, slots=True)
class Attachment:
    """A file that the log keeps whole: the mission, the parameters, what the computer is. JSON or YAML as UTF-8."""

    name: str
    media_type: str
    data: bytes


@dataclass(frozen=True, slots=True)
class Origin:
    """Where on Earth the autopilot's local frame has its origin (GPS_GLOBAL_ORIGIN), WGS-84 [rad], [m above sea]."""

    t_ns: int
    latitude_rad: float
    longitude_rad: float
    altitude_m: float


@dataclass(frozen=True, slots=True)
class FlightStart:
    """Where the mission began, also that of a resumed flight: NED [m], yaw [rad], and what later tasks need of it.

    `theta_0_rad` is the heading that move_until flies along; `move_until_m` how far a move_until before has flown
    (None: none has).
    """

    t_ns: int
    north_m: float
    east_m: float
    down_m: float
    yaw_rad: float
    theta_0_rad: float
    move_until_m: float | None


@dataclass(frozen=True, slots=True)
class AutopilotTarget:
    """Where the autopilot said that it flies to (POSITION_TARGET_LOCAL_NED): NED [m], yaw [rad]."""

    t_ns: int
    north_m: float
    east_m: float
    down_m: float
    yaw_rad: float


@dataclass(frozen=True, slots=True)
class ControlTick:
    """One round of the control loop, which began at `t_ns`.

    The task was told that `dt_s` have passed; the tick began `late_s` [s, wall] after it was due, and its telemetry was
    `state_age_s` [s] old.
    """

    t_ns: int
    dt_s: float
    late_s: float
    state_age_s: float


@dataclass(frozen=True, slots=True)
class ClockSync:
    """How the autopilot's clock stands to ours (TIMESYNC): its time since boot minus flight time.

    The question took `round_trip_ns` to be answered, which is the link's latency there and back.
    """

    t_ns: int
    boot_minus_flight_ns: int
    round_trip_ns: int


@dataclass(frozen=True, slots=True)
class LineFix:
    """What a frame taken at `t_ns` told of the line that is looked for or followed (mission/known_line.py).

    The line runs along `heading_rad` past `north_m`, `east_m`, abreast of the vehicle; `is_placed` says whether the
    place counts, or the heading only. `n_conductors` are known of it, whether the frame showed them or not; `depth_m`
    is how far below the vehicle it is by the way flown, `height_m` by the spacing, None where they do not tell.
    """

    t_ns: int
    heading_rad: float
    north_m: float
    east_m: float
    is_placed: bool
    n_conductors: int
    depth_m: float | None
    height_m: float | None


@dataclass(frozen=True, slots=True)
class TruePose:
    """Where a simulated vehicle truly was: NED [m] from the world's origin, yaw [rad]."""

    t_ns: int
    north_m: float
    east_m: float
    down_m: float
    yaw_rad: float


@dataclass(frozen=True, slots=True)
class TrueLine:
    """The simulated world's power line: its centre line seen from above, and every conductor.

    `axis_ne_m` is a polyline of (north, east) [m]; `conductors_ned_m` holds a polyline of (north, east, down) [m] for
    each conductor; `supports_ned_m` the tops of the poles.
    """

    axis_ne_m: tuple[tuple[float, float], ...]
    conductors_ned_m: tuple[tuple[tuple[float, float, float], ...], ...]
    supports_ned_m: tuple[tuple[float, float, float], ...]
