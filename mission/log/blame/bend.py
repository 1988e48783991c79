"""Where the line as told turns onto another span, and whether that was told in time. Pure."""

import math
from dataclasses import dataclass

import numpy as np

from drivers.clock import NS_PER_S
from mission.log.blame.leg import GROWTH_S, Leg
from mission.log.blame.records import Culprit, Fault

_TURN_RAD = math.radians(8.0)
_LATE_M = 1.0  # the setpoint's way beyond a bend by which it has to be known
_N_SIGHTS = 2  # of the next span, before it counts (mission/tasks/span_choice.py)


@dataclass(frozen=True, slots=True)
class Bend:
    """The line turns by `turn_rad`, and when that was known the setpoint was `past_m` [m] beyond the bend."""

    turn_rad: float
    past_m: float


def bend_near(leg: Leg, start_ns: int, peak: int) -> Bend | None:
    """The bend at which the vehicle was before the sample `peak` of an excursion from `start_ns` on; None: no bend."""
    lateral = leg.lateral
    t_ns, told = lateral.t_ns, lateral.told
    near = np.flatnonzero(
        (t_ns >= start_ns - round(GROWTH_S * NS_PER_S)) & (t_ns <= t_ns[peak] + NS_PER_S) & np.isfinite(told[:, 2])
    )
    if near.size < 2:
        return None
    turned_rad = np.remainder(told[near, 2] - told[near[0], 2] + np.pi / 2, np.pi) - np.pi / 2
    whole_rad = float(turned_rad[-1])
    if abs(whole_rad) < _TURN_RAD:
        return None
    at = int(np.flatnonzero(turned_rad / whole_rad > 0.5)[0])
    old, new = told[near[at - 1]], told[near[at]]
    along = np.array([math.cos(old[2]), math.sin(old[2])])
    across = np.array([-math.sin(new[2]), math.cos(new[2])])
    to_bend_m = float((new[:2] - old[:2]) @ across) / float(along @ across)
    bend_ne_m = old[:2] + to_bend_m * along
    known_ns = _known_ns(leg, int(t_ns[near[at]]))
    then = min(int(np.searchsorted(t_ns, known_ns)), len(t_ns) - 1)
    goal_m = leg.motion.setpoint_m[then, :2]
    way = along if math.cos(old[2] - leg.motion.yaw_rad[near[at - 1]]) > 0.0 else -along
    return Bend(whole_rad, float(np.nan_to_num((goal_m - bend_ne_m) @ way)))


def of_bend(bend: Bend, off_m: float, late_s: float) -> tuple[Culprit, Fault, tuple[str, ...]]:
    """Whose doing it is that the vehicle, `late_s` behind its setpoint, was off the line at a bend."""
    degrees = f"The line turns by {math.degrees(abs(bend.turn_rad)):.0f} degrees here"
    if bend.past_m > _LATE_M:
        words = (
            f"{degrees}, and the camera told of it when the setpoint was {bend.past_m:.1f} m beyond the bend: too late."
        )
        return Culprit.PERCEPTION, Fault.BEND, (words,)
    words = (
        f"{degrees}, and the setpoint turned as sharply: the vehicle, which comes {late_s:.1f} s behind it, could not, "
        f"and was {off_m:.2f} m off the line."
    )
    return Culprit.EXECUTIVE, Fault.BEND, (words,)


def _known_ns(leg: Leg, told_ns: int) -> int:
    """When the new span was known, which was told as the one below at `told_ns`: sights of it as the next one count."""
    seen_ns = [
        report.t_capture_ns + report.latency_ns
        for report in leg.reports
        if report.estimate is not None
        and report.estimate.next_span is not None
        and told_ns - GROWTH_S * NS_PER_S <= report.t_capture_ns + report.latency_ns <= told_ns
    ]
    return seen_ns[_N_SIGHTS - 1] if len(seen_ns) >= _N_SIGHTS else told_ns
