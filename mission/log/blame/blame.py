"""Find a flight's excursions, and trace each to perception, the executive, the autopilot or the wind.

While a line is followed, the way off it is a sum (mission/log/blame/signals.py): the line was elsewhere than told, the
setpoint was off the line as told, the vehicle was off its setpoint. What the vehicle does at its setpoint's expense is
the wind's work if the air pushed it away, and the autopilot's if it went there by its own thrust.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.camera.camera import Intrinsics
from drivers.clock import NS_PER_S
from mission.log.blame.lag import ImageLag, image_lag, line_slope
from mission.log.blame.records import Culprit, Excursion, Fault, Kind, Limits
from mission.log.blame.signals import Lateral, Motion, lateral_of, motion_of
from mission.log.blame.spans import spans
from mission.log.reader import Flight
from mission.log.summary import FOLLOW_TASK, TaskSpan, task_spans
from vision.records import VisionReport

Floats = NDArray[np.float64]
Times = NDArray[np.int64]

DEFAULT_LIMITS = Limits()

_GROWTH_S = 5.0  # at most so long before its peak an excursion has begun
_BEGUN = 0.25  # share of its peak where it began
_BEFORE_S = 2.0
_OLD_S = 0.3  # latency over which an estimate is late
_GONE_SHARE = 0.5  # of an excursion, without news of the line
_NEWS_S = 0.5
_STILL_RAD, _STILL_S = math.radians(2.0), 2.0  # a setpoint whose yaw moves by less within this time stands still
_TURNED_RAD = math.radians(8.0)  # the line as told, at a bend
_TILT_LIMIT_RAD = math.radians(38.0)
_VIEW_SHARE = 0.85  # of half the picture's width: further out a line is too short to be found
_OUT_OF_VIEW_SHARE = 0.3  # of the time unseen, in which the line was out of the picture


@dataclass(frozen=True, slots=True, eq=False)
class _Leg:
    """A span of following with all that belongs to it.

    `view` tells at each time of `lateral` how far from the middle of the picture the line must have been, 1 at its
    edge; None where the height over it or the camera is not known.
    """

    task: str
    start_ns: int
    end_ns: int
    motion: Motion
    lateral: Lateral
    reports: tuple[VisionReport, ...]
    lag: ImageLag | None
    depth_m: float | None
    view: Floats | None

    @property
    def has_estimates(self) -> bool:
        """Whether vision told of a line. A log that then lacks its place is older than that stream."""
        return any(report.estimate is not None for report in self.reports)


def find_excursions(flight: Flight, limits: Limits = DEFAULT_LIMITS) -> tuple[Excursion, ...]:
    """All excursions of a flight while it followed its line, in the order of their times."""
    if not flight.states:
        return ()
    whole = motion_of(flight)
    found: list[Excursion] = []
    for span in task_spans(flight):
        if span.task != FOLLOW_TASK:
            continue
        leg = _leg(flight, whole, span)
        if len(leg.motion.t_ns) >= 2:
            finders = (_off_line, _unseen, _misdated) if flight.fixes or not leg.has_estimates else ()
            for find in (*finders, _off_height, _off_heading):
                found.extend(find(leg, limits))
    return tuple(sorted(found, key=lambda excursion: (excursion.start_ns, excursion.kind)))


def _leg(flight: Flight, whole: Motion, span: TaskSpan) -> _Leg:
    end_ns = flight.end_ns if span.end_ns is None else span.end_ns
    motion = whole.slice(span.start_ns, end_ns)
    lateral = lateral_of(flight, motion)
    reports = tuple(report for report in flight.reports if span.start_ns <= report.t_capture_ns <= end_ns)
    depths_m = [fix.depth_m for fix in flight.fixes if span.start_ns <= fix.t_ns <= end_ns and fix.depth_m is not None]
    depth_m = float(np.median(depths_m)) if depths_m else None
    camera = flight.camera
    if depth_m is None or camera is None or not len(motion.t_ns):
        return _Leg(span.task, span.start_ns, end_ns, motion, lateral, reports, None, depth_m, None)
    slope = line_slope(lateral.aside_m, motion.roll_rad, depth_m)
    lag = _lag(camera, lateral.t_ns, slope, reports)
    view = np.nan_to_num(np.abs(slope)) * 2.0 * camera.fx_px / camera.width_px
    return _Leg(span.task, span.start_ns, end_ns, motion, lateral, reports, lag, depth_m, view)


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


# -- off the line ----------------------------------------------------------------------------------------------------


def _off_line(leg: _Leg, limits: Limits) -> Iterator[Excursion]:
    lateral = leg.lateral
    off_m = np.nan_to_num(lateral.off_m)
    for start_ns, end_ns in spans(lateral.t_ns, np.abs(off_m) > limits.off_line_m, limits.least_s):
        is_in = (lateral.t_ns >= start_ns) & (lateral.t_ns <= end_ns)
        inside = np.flatnonzero(is_in)
        peak = int(inside[np.abs(off_m[inside]).argmax()])
        side = math.copysign(1.0, off_m[peak])
        beyond = inside[side * off_m[inside] > limits.off_line_m]
        shares = {
            "perception": _mean(side * lateral.perception_m[beyond]),
            "executive": _mean(side * lateral.executive_m[beyond]),
            "tracking": _mean(side * lateral.tracking_m[beyond]),
        }
        largest = max(shares, key=lambda name: shares[name])
        if largest == "perception" or not math.isfinite(shares["tracking"]):
            culprit, fault, evidence = _of_perception(leg, start_ns, end_ns, beyond)
        elif largest == "executive":
            culprit, fault, evidence = _of_executive(leg, start_ns, end_ns, beyond, shares["executive"])
        else:
            culprit, fault, evidence = _of_tracking(leg.motion, lateral, peak, side)
        words = "right" if side > 0 else "left"
        known = "" if lateral.is_true else " as it was known"
        first = (
            f"{abs(off_m[peak]):.2f} m to the {words} of the line{known}; of the "
            f"mean beyond the limit the line as told was {shares['perception']:+.2f} m, the setpoint "
            f"{shares['executive']:+.2f} m, the vehicle's way off its setpoint {shares['tracking']:+.2f} m"
        )
        yield Excursion(
            Kind.OFF_LINE,
            leg.task,
            start_ns,
            end_ns,
            float(abs(off_m[peak])),
            "m",
            culprit,
            fault,
            {name: round(value, 3) for name, value in shares.items() if math.isfinite(value)},
            (first, *evidence),
        )


def _of_perception(
    leg: _Leg, start_ns: int, end_ns: int, beyond: NDArray[np.intp]
) -> tuple[Culprit, Fault, tuple[str, ...]]:
    lateral = leg.lateral
    age_s = lateral.age_s[beyond]
    latency_s = _latency_s(leg, start_ns, end_ns)
    if leg.lag is not None:
        return Culprit.PERCEPTION, Fault.LATE, (_lag_words(leg.lag),)
    if latency_s is not None and latency_s > _OLD_S:
        return Culprit.PERCEPTION, Fault.LATE, (_latency_words(latency_s),)
    if not np.isfinite(age_s).any() or float((~(age_s <= _NEWS_S)).mean()) > _GONE_SHARE:
        return Culprit.PERCEPTION, Fault.MISSING, _unseen_words(leg, start_ns, end_ns)
    error_m = lateral.perception_m[beyond]
    middle_m, spread_m = (
        float(np.nanmedian(error_m)),
        float(np.nanpercentile(np.abs(error_m - np.nanmedian(error_m)), 90)),
    )
    words = [
        f"the line was {abs(middle_m):.2f} m to the {_side(-middle_m)} of where it was told, within {spread_m:.2f} m"
    ]
    whole_m = lateral.perception_m[np.isfinite(lateral.perception_m)]
    bias_m = float(np.median(whole_m))
    if leg.depth_m is not None and abs(bias_m) > 0.5 * abs(middle_m):
        degrees = math.degrees(math.atan2(abs(bias_m), leg.depth_m))
        words.append(
            f"it is so over the whole leg ({abs(bias_m):.2f} m in the median), as if the camera were mounted or "
            f"calibrated {degrees:.1f} degrees askew"
        )
    return Culprit.PERCEPTION, Fault.WRONG, tuple(words)


def _of_executive(
    leg: _Leg, start_ns: int, end_ns: int, beyond: NDArray[np.intp], share_m: float
) -> tuple[Culprit, Fault, tuple[str, ...]]:
    """A setpoint off the line as told: the law's own doing, unless what it was told came late."""
    latency_s = _latency_s(leg, start_ns, end_ns)
    if leg.lag is not None:
        return Culprit.PERCEPTION, Fault.LATE, (_lag_words(leg.lag),)
    if latency_s is not None and latency_s > _OLD_S:
        return Culprit.PERCEPTION, Fault.LATE, (_latency_words(latency_s),)
    words = f"the setpoint ran {share_m:.2f} m beside the line as it was known then, which the vehicle followed"
    return Culprit.EXECUTIVE, Fault.SETPOINT, (words,)


def _of_tracking(motion: Motion, lateral: Lateral, peak: int, side: float) -> tuple[Culprit, Fault, tuple[str, ...]]:
    """Off the setpoint: pushed by the air, or gone by its own thrust, told by the impulses while it went there."""
    tracking_m = side * lateral.tracking_m
    first = _growth_start(motion.t_ns, tracking_m, peak)
    right = side * lateral.right
    pushed = (motion.push_m_s2 * right).sum(axis=1)
    thrust = (motion.thrust_m_s2 * right).sum(axis=1)
    before = pushed[int(np.searchsorted(motion.t_ns, motion.t_ns[first] - round(_BEFORE_S * NS_PER_S))) : first + 1]
    steady = float(np.median(before))  # what the thrust was balancing when it began: a lull moves a vehicle, too
    during = slice(first, peak + 1)
    moved_m = float(
        -side * (motion.setpoint_m[during][-1, :2] - motion.setpoint_m[during][0, :2]) @ lateral.right[peak]
    )
    turned_rad = float(np.ptp(np.unwrap(np.arctan2(*lateral.right[during].T))))
    if turned_rad > _TURNED_RAD or moved_m > 0.5 * abs(tracking_m[peak]):
        return Culprit.EXECUTIVE, Fault.SETPOINT, (_moved_words(moved_m, turned_rad),)
    t_s = motion.t_ns[during] / NS_PER_S
    push_m_s = float(np.trapezoid(pushed[during] - steady, t_s))
    thrust_m_s = float(np.trapezoid(thrust[during] + steady, t_s))
    took_s = float(t_s[-1] - t_s[0])
    tilt_rad = float(motion.tilt_rad[during].max())
    words = [
        f"in the {took_s:.1f} s in which it left its setpoint by {tracking_m[peak]:.2f} m the air pushed it by "
        f"{push_m_s:+.1f} m/s more than just before, its own thrust by {thrust_m_s:+.1f} m/s"
    ]
    if tilt_rad > _TILT_LIMIT_RAD:
        words.append(f"it was tilted by {math.degrees(tilt_rad):.0f} degrees, which is about as far as it may")
    if push_m_s > max(0.0, thrust_m_s) or tilt_rad > _TILT_LIMIT_RAD:
        return Culprit.WIND, Fault.PUSHED, tuple(words)
    return Culprit.AUTOPILOT, Fault.TRACKING, tuple(words)


def _growth_start(t_ns: NDArray[np.int64], values: Floats, peak: int) -> int:
    """Where a value that peaks at `peak` began to grow: where it was last a quarter of that."""
    earliest = int(np.searchsorted(t_ns, t_ns[peak] - round(_GROWTH_S * NS_PER_S)))
    small = np.flatnonzero(~(values[earliest:peak] > _BEGUN * values[peak]))
    start = earliest + (int(small[-1]) if small.size else 0)
    return min(start, peak - 1) if peak else 0


# -- the line unseen -------------------------------------------------------------------------------------------------


def _unseen(leg: _Leg, limits: Limits) -> Iterator[Excursion]:
    lateral = leg.lateral
    # What was told before the leg does not count as seen within it, and nothing at all is unseen.
    since_s = (lateral.t_ns - leg.start_ns) / NS_PER_S
    age_s = np.where(np.isfinite(lateral.age_s), np.minimum(lateral.age_s, since_s), since_s)
    for first_ns, end_ns in spans(lateral.t_ns, age_s > limits.unseen_s, 0.0):
        inside = (lateral.t_ns >= first_ns) & (lateral.t_ns <= end_ns)
        peak_s = float(age_s[inside].max())
        start_ns = max(leg.start_ns, first_ns - round(limits.unseen_s * NS_PER_S))
        culprit, fault, evidence = _of_unseen(leg, start_ns, end_ns)
        told = f"for {peak_s:.1f} s nothing told where the line was"
        yield Excursion(Kind.UNSEEN, leg.task, start_ns, end_ns, peak_s, "s", culprit, fault, {}, (told, *evidence))


def _of_unseen(leg: _Leg, start_ns: int, end_ns: int) -> tuple[Culprit, Fault, tuple[str, ...]]:
    """Late, out of the picture because of how the vehicle was tilted and where it was, or not found."""
    latency_s = _latency_s(leg, start_ns, end_ns)
    if latency_s is not None and latency_s > _OLD_S:
        return Culprit.PERCEPTION, Fault.LATE, (_latency_words(latency_s),)
    inside = np.flatnonzero((leg.lateral.t_ns >= start_ns) & (leg.lateral.t_ns <= end_ns))
    if leg.view is not None and float((leg.view[inside] > _VIEW_SHARE).mean()) > _OUT_OF_VIEW_SHARE:
        tracking_m = np.nan_to_num(leg.lateral.tracking_m[inside])
        peak = int(inside[np.abs(tracking_m).argmax()])
        side = math.copysign(1.0, leg.lateral.tracking_m[peak])
        culprit, fault, evidence = _of_tracking(leg.motion, leg.lateral, peak, side)
        return culprit, fault, ("the vehicle was so far aside and so tilted that the line left the picture", *evidence)
    return Culprit.PERCEPTION, Fault.MISSING, _unseen_words(leg, start_ns, end_ns)


def _unseen_words(leg: _Leg, start_ns: int, end_ns: int) -> tuple[str, ...]:
    """Why there was no line: no frames, frames that cannot be looked at, frames without it, or with another one."""
    reports = [report for report in leg.reports if start_ns <= report.t_capture_ns <= end_ns]
    if not reports:
        return ("no frame came through vision",)
    troubles = [str(report.trouble) for report in reports if report.trouble is not None]
    n_seen = sum(report.estimate is not None for report in reports)
    words = [f"{n_seen} of {len(reports)} frames showed a line"]
    if troubles:
        words.append(f"{len(troubles)} frames were {max(set(troubles), key=troubles.count)}")
    if n_seen > 0.5 * len(reports):
        words.append("what they showed could not be the line that was followed")
    return tuple(words)


def _misdated(leg: _Leg, limits: Limits) -> Iterator[Excursion]:
    if leg.lag is not None and leg.lag.lag_s > limits.misdated_s:
        yield Excursion(
            Kind.MISDATED,
            leg.task,
            leg.start_ns,
            leg.end_ns,
            leg.lag.lag_s,
            "s",
            Culprit.PERCEPTION,
            Fault.LATE,
            {},
            (_lag_words(leg.lag),),
        )


# -- height and heading ----------------------------------------------------------------------------------------------


def _off_height(leg: _Leg, limits: Limits) -> Iterator[Excursion]:
    motion = leg.motion
    below_m = np.nan_to_num(motion.position_m[:, 2] - motion.setpoint_m[:, 2])
    for start_ns, end_ns in spans(motion.t_ns, np.abs(below_m) > limits.off_height_m, limits.least_s):
        inside = np.flatnonzero((motion.t_ns >= start_ns) & (motion.t_ns <= end_ns))
        peak = int(inside[np.abs(below_m[inside]).argmax()])
        tilt_rad = float(motion.tilt_rad[inside].max())
        is_tilted = tilt_rad > _TILT_LIMIT_RAD
        words = [f"{abs(below_m[peak]):.2f} m {'below' if below_m[peak] > 0 else 'above'} its setpoint"]
        if is_tilted:
            words.append(
                f"it was tilted by {math.degrees(tilt_rad):.0f} degrees against the wind, and its thrust had to do both"
            )
        yield Excursion(
            Kind.OFF_HEIGHT,
            leg.task,
            start_ns,
            end_ns,
            float(abs(below_m[peak])),
            "m",
            Culprit.WIND if is_tilted else Culprit.AUTOPILOT,
            Fault.PUSHED if is_tilted else Fault.TRACKING,
            {},
            tuple(words),
        )


def _off_heading(leg: _Leg, limits: Limits) -> Iterator[Excursion]:
    motion = leg.motion
    off_rad = _wrapped(motion.yaw_rad - motion.setpoint_yaw_rad)
    is_still = _is_still(motion)
    is_beyond = (np.abs(np.nan_to_num(off_rad)) > limits.off_heading_rad) & is_still
    for start_ns, end_ns in spans(motion.t_ns, is_beyond, limits.least_s):
        inside = np.flatnonzero((motion.t_ns >= start_ns) & (motion.t_ns <= end_ns) & is_beyond)
        peak = int(inside[np.abs(off_rad[inside]).argmax()])
        nearby = (motion.t_ns >= start_ns - NS_PER_S) & (motion.t_ns <= end_ns)
        sunk_m = float(np.nan_to_num(motion.position_m[nearby, 2] - motion.setpoint_m[nearby, 2]).max())
        words = [
            f"the nose turned {math.degrees(abs(off_rad[peak])):.0f} degrees to the {_side(off_rad[peak])} while its "
            "setpoint stood still: air alone hardly turns a multirotor"
        ]
        if sunk_m > 0.15:
            words.append(
                f"it sank {sunk_m:.2f} m meanwhile, as one does whose rotors do not give what is asked of them"
            )
        yield Excursion(
            Kind.OFF_HEADING,
            leg.task,
            start_ns,
            end_ns,
            float(math.degrees(abs(off_rad[peak]))),
            "deg",
            Culprit.AUTOPILOT,
            Fault.TRACKING,
            {},
            tuple(words),
        )


def _is_still(motion: Motion) -> NDArray[np.bool_]:
    """Where the setpoint's yaw has hardly moved for a while; not at the leg's beginning, which may follow a turn."""
    then_ns = motion.t_ns - round(_STILL_S * NS_PER_S)
    before = np.searchsorted(motion.t_ns, then_ns)
    moved_rad = np.abs(_wrapped(motion.setpoint_yaw_rad - motion.setpoint_yaw_rad[before]))
    return np.asarray((np.nan_to_num(moved_rad, nan=np.inf) < _STILL_RAD) & (then_ns >= motion.t_ns[0]))


# -- words -----------------------------------------------------------------------------------------------------------


def _latency_s(leg: _Leg, start_ns: int, end_ns: int) -> float | None:
    values = [report.latency_ns for report in leg.reports if start_ns <= report.t_capture_ns <= end_ns]
    return float(np.median(values)) / NS_PER_S if values else None


def _latency_words(latency_s: float) -> str:
    return f"estimates came {latency_s * 1e3:.0f} ms after their frames were taken (median)"


def _lag_words(lag: ImageLag) -> str:
    return (
        f"frames show where the vehicle was {lag.lag_s * 1e3:.0f} ms before the time that they bear: with that the "
        f"line scatters by {100 * lag.residual:.0f} % of what it does without"
    )


def _moved_words(moved_m: float, turned_rad: float) -> str:
    if turned_rad > _TURNED_RAD:
        return (
            f"the line as told turned by {math.degrees(turned_rad):.0f} degrees here, and the setpoint went over to "
            "the new span at once: the vehicle came behind it"
        )
    return f"the setpoint went {moved_m:.2f} m aside, and the vehicle came behind it"


def _side(right: float) -> str:
    return "right" if right > 0 else "left"


def _mean(values: Floats) -> float:
    return float(np.mean(values)) if values.size else math.nan


def _wrapped(angles_rad: Floats) -> Floats:
    return np.asarray(np.remainder(angles_rad + np.pi, 2 * np.pi) - np.pi)
