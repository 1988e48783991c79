"""Where a replay differs from what it is held against. Pure."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass

import numpy as np

from drivers.clock import NS_PER_S
from mission.autopilot import Setpoint
from mission.guidance import wrap_angle_rad
from vision.records import LineEstimate, wrap_line_angle_rad


@dataclass(frozen=True, slots=True)
class Spread:
    """How large differences are, and when the largest was [s since the start that was given]; None: nobody said."""

    median: float
    p95: float
    max: float
    max_s: float | None = None


@dataclass(frozen=True, slots=True)
class EstimateDifferences:
    """Estimates held against those of the same frames.

    `n_lacking` frames of before are not there now. Of `n` frames `n_same` gave the same to the bit, `n_only_now` show a
    line only now and `n_only_then` only then; spreads are over frames that showed one both times, None without any.
    """

    n: int
    n_lacking: int
    n_same: int
    n_only_now: int
    n_only_then: int
    angle_deg: Spread | None
    offset_px: Spread | None


@dataclass(frozen=True, slots=True)
class SetpointDifferences:
    """Setpoints held against those of the same control ticks: their distances [m], and their yaws' [deg].

    `n_lacking` ticks of before send none now.
    """

    n: int
    n_lacking: int
    n_same: int
    distance_m: Spread | None
    yaw_deg: Spread | None


@dataclass(frozen=True, slots=True)
class Differences:
    """A replay held against the flight itself, or against the reference that its log holds (`is_reference`).

    `is_by_order` says that each tick saw what it saw in flight; otherwise that was told by times, which may err by a
    tick.
    """

    is_reference: bool
    is_by_order: bool
    estimates: EstimateDifferences
    setpoints: SetpointDifferences

    def beyond(self, tolerance: "Tolerance") -> tuple[str, ...]:
        """What differs by more than is allowed, in sentences."""
        estimates, setpoints = self.estimates, self.setpoints
        if self.is_reference and not (estimates.n and setpoints.n):
            return ("nothing of the reference is left to compare: no frame was seen, or no setpoint sent",)
        n_flipped = estimates.n_only_now + estimates.n_only_then
        found = []
        if self.is_reference and estimates.n_lacking > tolerance.flipped_share * estimates.n:
            found.append(f"{estimates.n_lacking} frames of the reference are not seen now")
        if self.is_reference and setpoints.n_lacking > tolerance.flipped_share * setpoints.n:
            found.append(f"{setpoints.n_lacking} setpoints of the reference are not sent now")
        if n_flipped > tolerance.flipped_share * estimates.n:
            found.append(f"{n_flipped} of {estimates.n} frames show a line only now or only then")
        for spread, limit, words in (
            (estimates.angle_deg, tolerance.angle_deg, "angles differ by up to {:.4g} degrees (p95)"),
            (estimates.offset_px, tolerance.offset_px, "offsets differ by up to {:.4g} px (p95)"),
            (setpoints.distance_m, tolerance.setpoint_m, "setpoints differ by up to {:.4g} m (p95)"),
            (setpoints.yaw_deg, tolerance.yaw_deg, "setpoints' yaws differ by up to {:.4g} degrees (p95)"),
        ):
            if spread is not None and spread.p95 > limit:
                found.append(words.format(spread.p95))
        return tuple(found)

    def to_json(self) -> dict[str, object]:
        """As plain dicts, ready for json.dump."""
        return asdict(self)


@dataclass(frozen=True, slots=True)
class Tolerance:
    """How far a replay may be from its reference on another computer, whose arithmetic may round otherwise.

    On the same one there is no difference at all.
    """

    flipped_share: float = 0.01
    angle_deg: float = 0.05
    offset_px: float = 0.25
    setpoint_m: float = 0.005
    yaw_deg: float = 0.05


def estimate_differences(
    now: Mapping[int, LineEstimate | None], then: Mapping[int, LineEstimate | None], start_ns: int = 0
) -> EstimateDifferences:
    """Hold estimates, by their frames' times [ns], against those of before."""
    times_ns = [t_ns for t_ns in now if t_ns in then]
    both = [(now[t_ns], then[t_ns]) for t_ns in times_ns]
    timed = zip(times_ns, both, strict=True)
    shown = [(t_ns, a, b) for t_ns, (a, b) in timed if a is not None and b is not None]
    shown_s = [(t_ns - start_ns) / NS_PER_S for t_ns, _, _ in shown]
    pairs = [(a, b) for _, a, b in shown]
    return EstimateDifferences(
        n=len(both),
        n_lacking=len(then.keys() - now.keys()),
        n_same=sum(a == b for a, b in both),
        n_only_now=sum(a is not None and b is None for a, b in both),
        n_only_then=sum(a is None and b is not None for a, b in both),
        angle_deg=_spread([math.degrees(wrap_line_angle_rad(a.angle_rad - b.angle_rad)) for a, b in pairs], shown_s),
        offset_px=_spread([_offset_difference_px(a, b) for a, b in pairs], shown_s),
    )


def setpoint_differences(
    pairs: Sequence[tuple[Setpoint, Setpoint]], n_lacking: int = 0, times_s: Sequence[float] | None = None
) -> SetpointDifferences:
    """Hold setpoints, sent at `times_s`, against those of before."""
    return SetpointDifferences(
        n=len(pairs),
        n_lacking=n_lacking,
        n_same=sum(a == b for a, b in pairs),
        distance_m=_spread(
            [math.dist((a.north_m, a.east_m, a.down_m), (b.north_m, b.east_m, b.down_m)) for a, b in pairs],
            times_s,
        ),
        yaw_deg=_spread([math.degrees(wrap_angle_rad(a.yaw_rad - b.yaw_rad)) for a, b in pairs], times_s),
    )


def _offset_difference_px(a: LineEstimate, b: LineEstimate) -> float:
    """An angle beyond a quarter turn is the same line looked at the other way round: its offset changes sign."""
    is_turned = abs(a.angle_rad - b.angle_rad) > math.pi / 2
    return a.offset_px + b.offset_px if is_turned else a.offset_px - b.offset_px


def _spread(values: Sequence[float], times_s: Sequence[float] | None) -> Spread | None:
    if not values:
        return None
    sizes = np.abs(np.array(values))
    max_s = None if times_s is None else times_s[int(sizes.argmax())]
    return Spread(float(np.median(sizes)), float(np.percentile(sizes, 95)), float(sizes.max()), max_s)
