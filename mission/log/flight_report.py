"""A flight in figures, as it is printed, put on a page, and given to programs."""

from dataclasses import asdict, dataclass
from typing import Any

from mission.log.wording import times_since, words_of


@dataclass(frozen=True, slots=True)
class TaskSummary:
    """A task as flown; times [s] from the flight's start."""

    task: str
    start_s: float
    end_s: float | None
    result: str
    reason: str


@dataclass(frozen=True, slots=True)
class StageSummary:
    """A stretch outside the tasks, as going down after one that failed; times [s] from the flight's start."""

    name: str
    start_s: float
    end_s: float


@dataclass(frozen=True, slots=True)
class LegSummary:
    """How straight the line was followed: distances [m] of the positions to the straight line that fits them best."""

    task: str
    n_points: int
    avg_error_m: float
    p95_error_m: float


@dataclass(frozen=True, slots=True)
class LateralSummary:
    """The true horizontal distance [m] from the line's axis while following it."""

    mean_m: float
    p95_m: float
    max_m: float


@dataclass(frozen=True, slots=True)
class YawSummary:
    """The true angle [deg] between heading and line while following it, without sign."""

    median_deg: float
    p95_deg: float


@dataclass(frozen=True, slots=True)
class Percentiles:
    """The median and two upper percentiles."""

    p50: float
    p95: float
    p99: float


@dataclass(frozen=True, slots=True)
class VisionSummary:
    """How many frames vision worked on, in how many it saw a line, and how old its news was [ms].

    `doubtful` counts the frames of a tracked line that showed none, or one elsewhere; `troubles` those that were dark,
    frozen and so on, by the name of the trouble.
    """

    frames: int
    estimates: int
    doubtful: int
    troubles: dict[str, int]
    latency_ms: Percentiles | None


@dataclass(frozen=True, slots=True)
class SetpointSummary:
    """How steadily setpoints were sent while offboard ran; None when fewer than two were."""

    rate_hz: float | None
    max_gap_ms: float | None


@dataclass(frozen=True, slots=True)
class LandingSummary:
    """Where the flight ended: horizontal distance [m] from its start, and whether the motors were off."""

    distance_m: float
    is_disarmed: bool


@dataclass(frozen=True, slots=True)
class PreflightSummary:
    """How many checks there were before arming, and what those said that were not fine."""

    n_checks: int
    warnings: tuple[str, ...]
    failures: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class EventSummary:
    """An event; `t_s` [s] from the flight's start."""

    t_s: float
    name: str
    severity: str
    message: str
    reaction: str


@dataclass(frozen=True, slots=True)
class ExcursionSummary:
    """Something that went beyond its limit, and whose fault it was (mission/log/blame/records.py); `t` [s]."""

    kind: str
    task: str
    start_s: float
    end_s: float
    peak: float
    unit: str
    culprit: str
    fault: str
    shares: dict[str, float]
    evidence: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class FlightReport:
    """A flight in figures. Times [s] are since the flight's start (`flight_start_ns`).

    `lateral` and `yaw_error` need ground truth, which only a simulated flight has. `excursions` are empty where nobody
    looked for them (mission/log/inspection.py does). `damage` says in a sentence what of the log could not be read,
    `ended_in` names the task in which a mission ended that was not completed; `stages` are what was flown outside the
    tasks.
    """

    mission: str
    result: str
    reason: str
    is_truncated: bool
    duration_s: float
    preflight: PreflightSummary
    tasks: tuple[TaskSummary, ...]
    legs: tuple[LegSummary, ...]
    lateral: LateralSummary | None
    yaw_error: YawSummary | None
    vision: VisionSummary
    setpoints: SetpointSummary
    landing: LandingSummary | None
    events: tuple[EventSummary, ...]
    excursions: tuple[ExcursionSummary, ...] = ()
    damage: str | None = None
    ended_in: str | None = None
    stages: tuple[StageSummary, ...] = ()

    @property
    def headline(self) -> str:
        """How the flight ended, and in which task where it was not completed: `timed out in align`."""
        return words_of(self.result) + ("" if self.ended_in is None else f" in {words_of(self.ended_in)}")

    @property
    def times_since(self) -> str:
        """What all times are counted from."""
        if not self.tasks:
            return "the log's start"
        return times_since(self.tasks[0].task)


def to_json(report: FlightReport) -> dict[str, Any]:
    """Turn a report into plain dicts and lists, ready for json.dump; keys are the records' fields."""
    return {key: list(value) if isinstance(value, tuple) else value for key, value in asdict(report).items()}
