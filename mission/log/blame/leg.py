"""A leg along the line with all that blame looks at."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.camera.camera import Intrinsics
from drivers.clock import NS_PER_S
from mission.log.blame.lag import ImageLag, image_lag, line_slope
from mission.log.blame.signals import Knowledge, Lateral, Motion, lateral_of
from mission.log.imported import ImportedActuators
from mission.log.reader import Flight
from mission.log.task_spans import TaskSpan
from vision.records import VisionReport

Floats = NDArray[np.float64]
Times = NDArray[np.int64]

GROWTH_S = 5.0
"""At most so long before its peak an excursion has begun: that much before a leg is looked at, too."""


@dataclass(frozen=True, slots=True, eq=False)
class Leg:
    """A span of following with all that belongs to it.

    `motion` and `lateral` begin GROWTH_S earlier; `is_flown` (n,) tells which of their samples lie within the leg.
    `lag` is how late the frames' times are, where they are, `depth_m` how far below the line was in the median. `view`
    tells at each sample how far from the middle of the picture the line must have been, 1 at its edge; None where the
    height over it or the camera is not known. `motors` are what they were told, where the autopilot's own log is there.
    `placed_ns` are the times of the frames that told the line's place.
    """

    task: str
    start_ns: int
    end_ns: int
    motion: Motion
    lateral: Lateral
    is_flown: NDArray[np.bool_]
    reports: tuple[VisionReport, ...]
    lag: ImageLag | None
    depth_m: float | None
    view: Floats | None
    motors: tuple[ImportedActuators, ...]
    placed_ns: frozenset[int]

    @property
    def has_estimates(self) -> bool:
        """Whether vision told of a line. A log that then lacks its place is older than that stream."""
        return any(report.estimate is not None for report in self.reports)


def leg_of(flight: Flight, whole: Motion, known: Knowledge, span: TaskSpan) -> Leg:
    """Cut a span out of a flight, whose motion is `whole`, and in which was `known` what is."""
    end_ns = flight.end_ns if span.end_ns is None else span.end_ns
    motion = whole.slice(span.start_ns - round(GROWTH_S * NS_PER_S), end_ns)
    lateral = lateral_of(known, motion)
    is_flown = motion.t_ns >= span.start_ns
    reports = tuple(report for report in flight.reports if span.start_ns <= report.t_capture_ns <= end_ns)
    depths_m = [fix.depth_m for fix in flight.fixes if span.start_ns <= fix.t_ns <= end_ns and fix.depth_m is not None]
    depth_m = float(np.median(depths_m)) if depths_m else None
    camera = flight.camera
    lag, view = None, None
    if depth_m is not None and camera is not None:
        slope = line_slope(lateral.aside_m, motion.roll_rad, depth_m)
        lag = _lag(camera, lateral.t_ns[is_flown], slope[is_flown], reports)
        view = np.nan_to_num(np.abs(slope)) * 2.0 * camera.fx_px / camera.width_px
    own = () if flight.imported is None else flight.imported.actuators
    motors = tuple(told for told in own if span.start_ns <= told.t_ns <= end_ns)
    placed_ns = frozenset(fix.t_ns for fix in flight.fixes if fix.is_placed and span.start_ns <= fix.t_ns <= end_ns)
    return Leg(
        span.task, span.start_ns, end_ns, motion, lateral, is_flown, reports, lag, depth_m, view, motors, placed_ns
    )


def _lag(camera: Intrinsics, t_ns: Times, slope: Floats, reports: tuple[VisionReport, ...]) -> ImageLag | None:
    """How late the frames are, by those that show as many conductors as most do: parts have other middles."""
    shown = [(report.t_capture_ns, report.estimate) for report in reports if report.estimate is not None]
    if not shown:
        return None
    counts = [estimate.n_lines for _, estimate in shown]
    n_lines = max(set(counts), key=counts.count)
    frames = [(t, e) for t, e in shown if e.n_lines == n_lines and abs(e.angle_rad) < math.pi / 4]
    is_known = np.isfinite(slope)
    return image_lag(
        np.array([t for t, _ in frames], dtype=np.int64),
        np.array([estimate.offset_px / camera.fx_px for _, estimate in frames]),
        t_ns[is_known],
        slope[is_known],
    )
