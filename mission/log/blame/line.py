"""Excursions of a leg in what concerns the line: off it, without it, with frames of wrong times."""

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from drivers.clock import NS_PER_S
from mission.log.blame.bend import bend_near, of_bend
from mission.log.blame.following import delay_s
from mission.log.blame.jump import jump_before, jump_words, turn_words, turned_away_and_back
from mission.log.blame.leg import Leg
from mission.log.blame.perception import lag_words, lateness, of_perception, of_unseen
from mission.log.blame.position_jump import of_position, position_jump_before, position_jump_unseen
from mission.log.blame.records import Culprit, Excursion, Fault, Kind, Limits
from mission.log.blame.spans import spans
from mission.log.blame.tracking import NO_SETPOINT_WORDS, of_tracking

Floats = NDArray[np.float64]


def off_line(leg: Leg, limits: Limits) -> Iterator[Excursion]:
    """Where the vehicle flew beside the line."""
    lateral = leg.lateral
    off_m = np.where(leg.is_flown, np.nan_to_num(lateral.off_m), 0.0)
    # A swing to one side and then to the other are two.
    found = [
        (side, *span)
        for side in (1.0, -1.0)
        for span in spans(lateral.t_ns, side * off_m > limits.off_line_m, limits.least_s)
    ]
    for side, start_ns, end_ns in sorted(found, key=lambda one: one[1]):
        inside = np.flatnonzero((lateral.t_ns >= start_ns) & (lateral.t_ns <= end_ns))
        peak = int(inside[(side * off_m[inside]).argmax()])
        beyond = inside[side * off_m[inside] > limits.off_line_m]
        known = beyond[np.isfinite(lateral.tracking_m[beyond]) & np.isfinite(lateral.executive_m[beyond])]
        shares = {
            "perception": _mean(side * lateral.perception_m[known]),
            "executive": _mean(side * lateral.executive_m[known]),
            "tracking": _mean(side * lateral.tracking_m[known]),
        }
        largest = max(shares, key=lambda name: shares[name])
        if not known.size:
            culprit, fault, evidence = _of_nothing(leg, start_ns, end_ns, beyond)
        elif largest == "perception":
            culprit, fault, evidence = of_perception(leg, start_ns, end_ns, known)
        elif largest == "executive":
            culprit, fault, evidence = _of_executive(leg, start_ns, end_ns, shares["executive"])
        else:
            worst = int(known[(side * off_m[known]).argmax()])  # nobody is off a setpoint that was not sent
            culprit, fault, evidence = of_tracking(leg.motion, lateral, worst, side)
        own = position_jump_before(leg, start_ns, peak, float(abs(off_m[peak])))
        if own is not None:
            # The line as told lies by the vehicle's position, and jumps with it: that comes before all else.
            culprit, fault, evidence = of_position(own)
        elif culprit is not Culprit.PERCEPTION:
            jump = jump_before(leg, start_ns, peak, float(abs(off_m[peak])))
            turned = turned_away_and_back(leg, start_ns, peak)
            bend = bend_near(leg, start_ns, peak)
            if jump is not None:
                culprit, fault, evidence = Culprit.PERCEPTION, Fault.WRONG, jump_words(jump)
            elif turned is not None:
                culprit, fault, evidence = Culprit.PERCEPTION, Fault.WRONG, turn_words(*turned)
            elif bend is not None and culprit is Culprit.EXECUTIVE:
                culprit, fault, evidence = of_bend(bend, float(abs(off_m[peak])), delay_s(leg.motion))
        words = "right" if side > 0 else "left"
        as_known = "" if lateral.is_true else " as it was known"
        parts = {
            "the line elsewhere than told": shares["perception"],
            "the setpoint off the line as told": shares["executive"],
            "the vehicle off its setpoint": shares["tracking"],
        }
        made_of = ", ".join(f"{name} {part:+.2f} m" for name, part in parts.items() if math.isfinite(part))
        first = f"{abs(off_m[peak]):.2f} m to the {words} of the line{as_known}"
        if made_of:
            first += f"; what that is made of, counted to the {words}, in the mean while beyond the limit: {made_of}"
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
            (*evidence[:1], first, *evidence[1:]),
        )


def _of_nothing(
    leg: Leg, start_ns: int, end_ns: int, beyond: NDArray[np.intp]
) -> tuple[Culprit, Fault, tuple[str, ...]]:
    """Nothing can be divided: the line was not told, or nothing was sent."""
    if np.isfinite(leg.lateral.age_s[beyond]).any():
        return Culprit.EXECUTIVE, Fault.SETPOINT, NO_SETPOINT_WORDS
    return of_perception(leg, start_ns, end_ns, beyond)


def _of_executive(leg: Leg, start_ns: int, end_ns: int, share_m: float) -> tuple[Culprit, Fault, tuple[str, ...]]:
    """A setpoint off the line as told: the law's own doing, unless what it was told came late."""
    late = lateness(leg, start_ns, end_ns)
    if late is not None:
        return Culprit.PERCEPTION, Fault.LATE, late
    words = (
        f"The mission steered {share_m:.2f} m beside the line, though it was told where that is: the vehicle followed."
    )
    return Culprit.EXECUTIVE, Fault.SETPOINT, (words,)


def unseen(leg: Leg, limits: Limits) -> Iterator[Excursion]:
    """Where nothing told of the line for too long."""
    lateral = leg.lateral
    # What was told before the leg does not count as seen within it, and nothing at all is unseen.
    since_s = (lateral.t_ns - leg.start_ns) / NS_PER_S
    age_s = np.where(np.isfinite(lateral.age_s), np.minimum(lateral.age_s, since_s), since_s)
    for first_ns, end_ns in spans(lateral.t_ns, age_s > limits.unseen_s, 0.0):
        inside = (lateral.t_ns >= first_ns) & (lateral.t_ns <= end_ns)
        peak_s = float(age_s[inside].max())
        start_ns = max(leg.start_ns, first_ns - round(limits.unseen_s * NS_PER_S))
        culprit, fault, evidence = of_unseen(leg, start_ns, end_ns)
        own = position_jump_unseen(leg, start_ns, end_ns)
        if own is not None and fault not in (Fault.LATE, Fault.MISSING):
            culprit, fault, evidence = of_position(own)
        told = f"for {peak_s:.1f} s nothing told where the line was"
        yield Excursion(
            Kind.UNSEEN,
            leg.task,
            start_ns,
            end_ns,
            peak_s,
            "s",
            culprit,
            fault,
            {},
            (*evidence[:1], told, *evidence[1:]),
        )


def misdated(leg: Leg, limits: Limits) -> Iterator[Excursion]:
    """A leg whose frames bear other times than those at which they were taken."""
    if leg.lag is not None and abs(leg.lag.lag_s) > limits.misdated_s:
        yield Excursion(
            Kind.MISDATED,
            leg.task,
            leg.start_ns,
            leg.end_ns,
            abs(leg.lag.lag_s),
            "s",
            Culprit.PERCEPTION,
            Fault.LATE,
            {},
            lag_words(leg.lag),
        )


def _mean(values: Floats) -> float:
    return float(np.mean(values)) if values.size else math.nan
