"""Work out from a flight's records what happened and how well it was flown."""

from collections import Counter

import numpy as np

from drivers.clock import NS_PER_S
from mission.log.damage import words_of_damage
from mission.log.flight_report import (
    EventSummary,
    FlightReport,
    LandingSummary,
    LateralSummary,
    LegSummary,
    Percentiles,
    PreflightSummary,
    SetpointSummary,
    StageSummary,
    TaskSummary,
    VisionSummary,
    YawSummary,
)
from mission.log.measures import Floats, line_fit_distances_m, nearest_on_axis, offboard_gaps_s, true_axis
from mission.log.reader import Flight
from mission.log.task_spans import FOLLOW_TASK, UNFINISHED, TaskSpan, flight_start_ns, stages, task_spans
from mission.log.wording import words_of
from mission.records import CheckResult, Result
from vision.records import Track, wrap_line_angle_rad


def summarise(flight: Flight) -> FlightReport:
    """Work out a flight's report."""
    spans = task_spans(flight)
    ended = flight.mission_ended
    end_ns = flight.end_ns if ended is None else ended.t_ns
    is_completed = ended is not None and ended.result == Result.COMPLETED

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
        ended_in=None if not spans or is_completed or spans[-1].result == Result.COMPLETED else spans[-1].task,
        stages=tuple(
            StageSummary(name, since_start_s(start_ns), since_start_s(stage_end_ns))
            for name, start_ns, stage_end_ns in stages(flight, spans, end_ns)
        ),
    )


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
    sent_ns = np.array([setpoint.t_ns for setpoint in flight.setpoints], dtype=np.int64)
    gaps_s = offboard_gaps_s(sent_ns, windows, flight.holes_ns)
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
