"""A flight's report as named figures, and two flights' tasks side by side. Pure."""

import difflib
from collections.abc import Sequence
from dataclasses import dataclass

from mission.log.flight_report import FlightReport, TaskSummary

Figures = dict[str, float | None]


def figures_of(report: FlightReport) -> Figures:
    """Every figure of a report by its name, the unit at its end; None where that flight has none."""
    lateral, yaw, latency = report.lateral, report.yaw_error, report.vision.latency_ms
    vision, setpoints, landing = report.vision, report.setpoints, report.landing
    figures: Figures = {
        "duration_s": report.duration_s,
        "lateral_mean_m": None if lateral is None else lateral.mean_m,
        "lateral_p95_m": None if lateral is None else lateral.p95_m,
        "lateral_max_m": None if lateral is None else lateral.max_m,
        "yaw_error_median_deg": None if yaw is None else yaw.median_deg,
        "yaw_error_p95_deg": None if yaw is None else yaw.p95_deg,
        "frames": float(vision.frames),
        "estimates_percent": 100.0 * vision.estimates / vision.frames if vision.frames else None,
        "doubtful_frames": float(vision.doubtful),
        "latency_p50_ms": None if latency is None else latency.p50,
        "latency_p95_ms": None if latency is None else latency.p95,
        "latency_p99_ms": None if latency is None else latency.p99,
        "setpoint_rate_hz": setpoints.rate_hz,
        "setpoint_gap_max_ms": setpoints.max_gap_ms,
        "landing_distance_m": None if landing is None else landing.distance_m,
        "events": float(len(report.events)),
        "excursions": float(len(report.excursions)),
    }
    for number, leg in enumerate(report.legs, start=1):
        figures[f"leg_{number}_straightness_mean_m"] = leg.avg_error_m
        figures[f"leg_{number}_straightness_p95_m"] = leg.p95_error_m
    return figures


@dataclass(frozen=True, slots=True)
class TaskPair:
    """A task of the first flight and the one of another flight that it is held against; None: it has none."""

    first: TaskSummary | None
    other: TaskSummary | None


def pair_tasks(first: Sequence[TaskSummary], other: Sequence[TaskSummary]) -> list[TaskPair]:
    """Match tasks by their names in the order flown; one that the other flight did not fly stands alone."""
    matcher = difflib.SequenceMatcher(
        None, [task.task for task in first], [task.task for task in other], autojunk=False
    )
    pairs: list[TaskPair] = []
    for tag, i1, i2, j1, j2 in matcher.get_opcodes():
        if tag == "equal":
            pairs += [TaskPair(a, b) for a, b in zip(first[i1:i2], other[j1:j2], strict=True)]
        else:
            pairs += [TaskPair(task, None) for task in first[i1:i2]]
            pairs += [TaskPair(None, task) for task in other[j1:j2]]
    return pairs
