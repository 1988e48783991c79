"""Work out from a flight's records what happened and how well it was flown."""

from collections import Counter
from dataclasses import asdict, dataclass
from itertools import zip_longest
from typing import Any

import numpy as np

from drivers.clock import NS_PER_S
from mission.log.damage import words_of_damage
from mission.log.measures import Floats, line_fit_distances_m, nearest_on_axis, offboard_gaps_s
from mission.log.reader import Flight
from mission.log.wording import times_since, words_of
from mission.records import CheckResult, Result, TaskEnded, TrueLine
from vision.records import Track, wrap_line_angle_rad

FOLLOW_TASK = "follow_lines"
UNFINISHED = "unfinished"
REJOINING_EVENT = "rejoining"

_LEAST_STAGE_NS = NS_PER_S // 2  # who takes the vehicle over ends the flight at once: nothing comes after that


@dataclass(frozen=True, slots=True)
class TaskSpan:
    """A task as flown, flight time [ns]; one that the log does not see end has no `end_ns`."""

    task: str
    start_ns: int
    end_ns: int | None
    result: str
    reason: str


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


def summarise(flight: Flight) -> FlightReport:
    """Work out a flight's report."""
    spans = task_spans(flight)
    ended = flight.mission_ended
    end_ns = flight.end_ns if ended is None else ended.t_ns

    def since_start_s(t_ns: int) -> float:
        return (t_ns - flight_start_ns(flight)) / NS_PER_S

    following = [_span_window(span, flight.end_ns) for span in spans if span.task == FOLLOW_TASK]
    lateral_m, yaw_error_rad = _true_errors(flight, following)
    return FlightReport(
        mission=flight.mission.name,
        result=UNFINISHED if ended is None else str(ended.result),
        reason="The log breaks off before the mission ended." if ended is None else ended.reason,
        is_truncated=flight.is_truncated,
        duration_s=since_start_s(end_ns),
        preflight=_preflight(flight),
        tasks=tuple(
            TaskSummary(
                span.task,
                since_start_s(span.start_ns),
                None if span.end_ns is None else since_start_s(span.end_ns),
                span.result,
                span.reason,
            )
            for span in spans
        ),
        legs=_legs(flight, following),
        lateral=None
        if not lateral_m.size
        else LateralSummary(float(lateral_m.mean()), _percentile(lateral_m, 95), float(lateral_m.max())),
        yaw_error=None
        if not yaw_error_rad.size
        else YawSummary(*(float(np.degrees(_percentile(yaw_error_rad, share))) for share in (50, 95))),
        vision=_vision(flight),
        setpoints=_setpoints(flight, spans),
        landing=_landing(flight),
        events=tuple(
            EventSummary(since_start_s(event.t_ns), event.name, str(event.severity), event.message, event.reaction)
            for event in flight.events
        ),
        damage=None if flight.damage is None else words_of_damage(flight.damage),
        ended_in=spans[-1].task if spans and spans[-1].result != Result.COMPLETED else None,
        stages=tuple(
            StageSummary(name, since_start_s(start_ns), since_start_s(stage_end_ns))
            for name, start_ns, stage_end_ns in _stages(flight, spans, end_ns)
        ),
    )


def flight_start_ns(flight: Flight) -> int:
    """When the first task began; the log's start where none did. Getting ready before it is not flight."""
    return flight.tasks_started[0].t_ns if flight.tasks_started else flight.mission.start_ns


def to_json(report: FlightReport) -> dict[str, Any]:
    """Turn a report into plain dicts and lists, ready for json.dump; keys are the records' fields."""
    return {key: list(value) if isinstance(value, tuple) else value for key, value in asdict(report).items()}


def task_spans(flight: Flight) -> tuple[TaskSpan, ...]:
    """Pair each task's start with its end, in the order flown.

    One whose end the log lacks ended by when the next one began, if one did: that part of the log is damaged.
    """
    unpaired: list[TaskEnded] = list(flight.tasks_ended)
    spans = []
    for started, following in zip_longest(flight.tasks_started, flight.tasks_started[1:]):
        ended = next((end for end in unpaired if end.index == started.index and end.t_ns >= started.t_ns), None)
        if ended is None and following is not None:
            why = "Its end stood in a part of the log that is damaged."
            spans.append(TaskSpan(started.task, started.t_ns, following.t_ns, UNFINISHED, why))
        elif ended is None:
            spans.append(TaskSpan(started.task, started.t_ns, None, UNFINISHED, "The log breaks off before its end."))
        else:
            unpaired.remove(ended)
            spans.append(TaskSpan(started.task, started.t_ns, ended.t_ns, str(ended.result), ended.reason))
    return tuple(spans)


def _stages(flight: Flight, spans: tuple[TaskSpan, ...], end_ns: int) -> list[tuple[str, int, int]]:
    """What was flown before the first task, and from the end of one that was not completed to the flight's end."""
    if not spans:
        return []
    stages = []
    rejoining = next((event for event in flight.events if event.name == REJOINING_EVENT), None)
    if rejoining is not None:  # a mission that is resumed flies to where it was interrupted first
        later_ns = [span.start_ns for span in spans if span.start_ns > rejoining.t_ns]
        stages.append(("rejoining", rejoining.t_ns, min(later_ns, default=end_ns)))
    last = spans[-1]
    if last.end_ns is not None and last.result != Result.COMPLETED and end_ns - last.end_ns >= _LEAST_STAGE_NS:
        stages.append(("going down", last.end_ns, end_ns))
    return stages


def true_axis(line: TrueLine) -> Floats:
    """Return the line's axis as an array (m, 2) of north, east [m]."""
    return np.array(line.axis_ne_m, dtype=np.float64).reshape(-1, 2)


def _preflight(flight: Flight) -> PreflightSummary:
    def said(result: CheckResult) -> tuple[str, ...]:
        return tuple(f"{words_of(check.name)}: {check.reason}" for check in flight.checks if check.result is result)

    return PreflightSummary(len(flight.checks), said(CheckResult.WARNING), said(CheckResult.FAILED))


def _legs(flight: Flight, following: list[tuple[int, int]]) -> tuple[LegSummary, ...]:
    # Telemetry that the control loop saw twice is one position.
    positions = {state.t_ns: (state.north_m, state.east_m, state.down_m) for state in flight.states}
    t_ns, positions_m = np.array(list(positions), dtype=np.int64), np.array(list(positions.values()))
    legs = []
    for start_ns, end_ns in following:
        leg = positions_m[(t_ns >= start_ns) & (t_ns <= end_ns)]
        if len(leg) >= 2:
            distances_m = line_fit_distances_m(leg)
            # Equation 6.5 as printed lacks its 1/N; the figures of table 6.2 are means.
            legs.append(LegSummary(FOLLOW_TASK, len(leg), float(distances_m.mean()), _percentile(distances_m, 95)))
    return tuple(legs)


def _true_errors(flight: Flight, following: list[tuple[int, int]]) -> tuple[Floats, Floats]:
    """Distance [m] and angle [rad] to the true line, both without sign, at each true pose of the following tasks."""
    poses = [pose for pose in flight.truth if any(start <= pose.t_ns <= end for start, end in following)]
    if flight.line is None or len(flight.line.axis_ne_m) < 2 or not poses:
        return np.empty(0), np.empty(0)
    points = np.array([(pose.north_m, pose.east_m) for pose in poses])
    distance_m, direction_rad = nearest_on_axis(points, true_axis(flight.line))
    yaw_error_rad = [
        abs(wrap_line_angle_rad(pose.yaw_rad - direction))
        for pose, direction in zip(poses, direction_rad.tolist(), strict=True)
    ]
    return np.abs(distance_m), np.array(yaw_error_rad)


def _vision(flight: Flight) -> VisionSummary:
    latency_ms = np.array([report.latency_ns for report in flight.reports]) / 1e6
    return VisionSummary(
        frames=len(flight.reports),
        estimates=sum(report.estimate is not None for report in flight.reports),
        doubtful=sum(report.track is Track.DOUBTFUL for report in flight.reports),
        troubles=dict(Counter(str(report.trouble) for report in flight.reports if report.trouble is not None)),
        latency_ms=None if not latency_ms.size else Percentiles(*(_percentile(latency_ms, p) for p in (50, 95, 99))),
    )


def _setpoints(flight: Flight, spans: tuple[TaskSpan, ...]) -> SetpointSummary:
    """Up to the start of the next task each: a resumed mission flies to where it was interrupted in between."""
    windows = [_span_window(span, flight.end_ns) for span in spans]
    ends_ns = [start_ns for start_ns, _ in windows[1:]] + [end_ns for _, end_ns in windows[-1:]]
    windows = [(start_ns, end_ns) for (start_ns, _), end_ns in zip(windows, ends_ns, strict=True)]
    gaps_s = offboard_gaps_s(np.array([setpoint.t_ns for setpoint in flight.setpoints], dtype=np.int64), windows)
    if not gaps_s.size:
        return SetpointSummary(None, None)
    return SetpointSummary(rate_hz=float(gaps_s.size / gaps_s.sum()), max_gap_ms=float(gaps_s.max() * 1e3))


def _landing(flight: Flight) -> LandingSummary | None:
    track = flight.truth or flight.states
    if not track or not flight.states:
        return None
    first, last = track[0], track[-1]
    distance_m = float(np.hypot(last.north_m - first.north_m, last.east_m - first.east_m))
    return LandingSummary(distance_m, not flight.states[-1].is_armed)


def _span_window(span: TaskSpan, log_end_ns: int) -> tuple[int, int]:
    return span.start_ns, log_end_ns if span.end_ns is None else span.end_ns


def _percentile(values: Floats, share: float) -> float:
    return float(np.percentile(values, share))
