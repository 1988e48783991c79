"""What perception told of the line: wrong, late, or not at all."""

import itertools
import math

import numpy as np
from numpy.typing import NDArray

from drivers.clock import NS_PER_S
from mission.log.blame.lag import ImageLag
from mission.log.blame.leg import GROWTH_S, Leg
from mission.log.blame.records import Culprit, Fault
from mission.log.blame.tracking import NO_SETPOINT_WORDS, of_tracking

_OLD_S = 0.3  # latency over which an estimate is late
_GONE_SHARE = 0.5  # of an excursion, without news of the line
_NEWS_S = 0.5
_GAP_S = 0.7  # between frames: the slowest camera that may fly gives more
_VIEW_SHARE = 0.85  # of half the picture's width: further out a line is too short to be found
_OUT_OF_VIEW_SHARE = 0.3  # of the time unseen, in which the line was out of the picture


def lateness(leg: Leg, start_ns: int, end_ns: int) -> tuple[str, ...] | None:
    """How what was told between two times was late, in sentences; None where it was not."""
    return _latency(leg, start_ns, end_ns) if leg.lag is None else lag_words(leg.lag)


def lag_words(lag: ImageLag) -> tuple[str, str]:
    """What wrong times show in: a sentence, and its figures."""
    when, how = ("before", "old") if lag.lag_s > 0 else ("after", "ahead of it")
    return (
        f"The camera's frames bear wrong times: what they show is {abs(lag.lag_s):.2f} s {how} by the vehicle's clock, "
        "so the line was placed wrongly whenever the vehicle tilted or moved aside.",
        f"frames show where the vehicle was {abs(lag.lag_s) * 1e3:.0f} ms {when} the time that they bear: with that "
        f"the line scatters by {100 * lag.residual:.0f} % of what it does without",
    )


def of_perception(
    leg: Leg, start_ns: int, end_ns: int, beyond: NDArray[np.intp]
) -> tuple[Culprit, Fault, tuple[str, ...]]:
    """The line was elsewhere than told, at the samples `beyond` the limit: late, missing, or wrong."""
    lateral = leg.lateral
    age_s = lateral.age_s[beyond]
    late = lateness(leg, start_ns, end_ns)
    if late is not None:
        return Culprit.PERCEPTION, Fault.LATE, late
    if not np.isfinite(age_s).any() or float((~(age_s <= _NEWS_S)).mean()) > _GONE_SHARE:
        return Culprit.PERCEPTION, *_missing(leg, start_ns, end_ns)
    error_m = lateral.perception_m[beyond]
    middle_m = float(np.nanmedian(error_m))
    spread_m = float(np.nanpercentile(np.abs(error_m - middle_m), 90))
    side = "left" if middle_m > 0 else "right"
    words = [
        f"The camera told of the line {abs(middle_m):.2f} m beside where it is, and the vehicle flew there.",
        f"the line was {abs(middle_m):.2f} m to the {side} of where it was told, within {spread_m:.2f} m",
    ]
    whole_m = lateral.perception_m[leg.is_flown & np.isfinite(lateral.perception_m)]
    bias_m = float(np.median(whole_m))
    if leg.depth_m is not None and abs(bias_m) > 0.5 * abs(middle_m):
        degrees = math.degrees(math.atan2(abs(bias_m), leg.depth_m))
        words.append(
            f"it is so over the whole leg ({abs(bias_m):.2f} m in the median), as if the camera were mounted or "
            f"calibrated {degrees:.1f} degrees askew"
        )
    return Culprit.PERCEPTION, Fault.WRONG, tuple(words)


def of_unseen(leg: Leg, start_ns: int, end_ns: int) -> tuple[Culprit, Fault, tuple[str, ...]]:
    """Late, out of the picture because of how the vehicle was tilted and where it was, or not found."""
    late = _latency(leg, start_ns, end_ns)
    if late is not None:
        return Culprit.PERCEPTION, Fault.LATE, late
    inside = np.flatnonzero((leg.lateral.t_ns >= start_ns) & (leg.lateral.t_ns <= end_ns))
    if leg.view is not None and float((leg.view[inside] > _VIEW_SHARE).mean()) > _OUT_OF_VIEW_SHARE:
        out_of_view = "The vehicle was so far aside and so tilted that the line left the picture."
        tracking_m = leg.lateral.tracking_m
        first = int(np.searchsorted(leg.lateral.t_ns, start_ns - round(GROWTH_S * NS_PER_S)))
        known = first + np.flatnonzero(np.isfinite(tracking_m[first : inside[-1] + 1]))
        if known.size:
            # Where setpoints ended before, the last of them is what it was off.
            within = known[known >= inside[0]]
            peak = int(within[np.abs(tracking_m[within]).argmax()] if within.size else known[-1])
            side = math.copysign(1.0, tracking_m[peak])
            culprit, fault, evidence = of_tracking(leg.motion, leg.lateral, peak, side)
            return culprit, fault, (out_of_view, *evidence)
        if not np.isfinite(leg.motion.setpoint_m[first : inside[-1] + 1]).any():
            return Culprit.EXECUTIVE, Fault.SETPOINT, (out_of_view, *NO_SETPOINT_WORDS)
    return Culprit.PERCEPTION, *_missing(leg, start_ns, end_ns)


def _missing(leg: Leg, start_ns: int, end_ns: int) -> tuple[Fault, tuple[str, ...]]:
    """Why there was no line: no frames, frames that cannot be looked at, frames without it, or with another one."""
    reports = [report for report in leg.reports if start_ns < report.t_capture_ns <= end_ns]
    reports = [report for report in reports if report.t_capture_ns not in leg.placed_ns]  # those showed it
    times_ns = [start_ns, *(report.t_capture_ns for report in reports), end_ns]
    gap_s = max(after - before for before, after in itertools.pairwise(times_ns)) / NS_PER_S
    if gap_s > _GAP_S:
        return Fault.MISSING, (f"The camera gave nothing: no frame came through vision for {gap_s:.1f} s.",)
    troubles = [str(report.trouble) for report in reports if report.trouble is not None]
    n_seen = sum(report.estimate is not None for report in reports)
    words = [f"Vision did not find the line: {n_seen} of {len(reports)} frames showed a line."]
    if troubles:
        words.append(f"{len(troubles)} frames were {max(set(troubles), key=troubles.count)}")
    if n_seen > 0.5 * len(reports):
        words[0] = (
            f"{n_seen} of {len(reports)} frames showed a line, but it could not be the one that was followed: a "
            "road, a fence, another line."
        )
        return Fault.WRONG, tuple(words)
    return Fault.MISSING, tuple(words)


def _latency(leg: Leg, start_ns: int, end_ns: int) -> tuple[str, ...] | None:
    """How old estimates were when they came, in sentences; None where they were fresh."""
    values_ns = [report.latency_ns for report in leg.reports if start_ns <= report.t_capture_ns <= end_ns]
    latency_s = float(np.median(values_ns)) / NS_PER_S if values_ns else 0.0
    if latency_s <= _OLD_S:
        return None
    return (
        f"The camera's line was {latency_s:.2f} s old when it came, too old to steer by.",
        f"estimates came {latency_s * 1e3:.0f} ms after their frames were taken (median)",
    )
