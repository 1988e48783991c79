"""Off the setpoint: pushed by the air, gone by its own thrust, or left behind by the setpoint."""

import math

import numpy as np
from numpy.typing import NDArray

from drivers.clock import NS_PER_S
from mission.log.blame.following import delay_s, follow
from mission.log.blame.leg import GROWTH_S
from mission.log.blame.records import Culprit, Fault
from mission.log.blame.signals import Lateral, Motion, slope

Floats = NDArray[np.float64]

TILT_LIMIT_RAD = math.radians(38.0)
"""A vehicle that is tilted so far does what it can."""

NO_SETPOINT_WORDS = ("No setpoint was sent meanwhile: the autopilot had nothing to fly to.",)

_BEGUN = 0.25  # share of its peak where an excursion began
_BEFORE_S = 2.0
_SLOW = 0.1  # share of its greatest speed
_OUT_M, _BACK_SHARE = 0.5, 0.5  # a setpoint that was off the line by that much, and now by less than that share
_OWN_SHARE, _OWN_M = 0.5, 0.5  # of the way off the line, which a sound vehicle would not have been


def of_tracking(motion: Motion, lateral: Lateral, peak: int, side: float) -> tuple[Culprit, Fault, tuple[str, ...]]:
    """Who took the vehicle off its setpoint, to the side where `side` is 1 (right) or -1, up to the sample `peak`.

    At `peak` the setpoint has to be known. The setpoint itself did, where it went away; else the air or the vehicle's
    own thrust, whichever gave it the larger impulse while it gathered way.
    """
    t_ns = motion.t_ns
    right = side * lateral.right[peak]
    tracking_m = (motion.position_m - motion.setpoint_m)[:, :2] @ right
    first = _growth_start(t_ns, tracking_m, peak)
    during = slice(first, peak + 1)
    # What a sound vehicle would have done, that comes behind its setpoint as any does, is the setpoint's doing.
    earliest = int(np.searchsorted(t_ns, t_ns[peak] - round(GROWTH_S * NS_PER_S)))
    late_s = delay_s(motion)
    sound_m, sound_m_s2 = follow(motion, earliest, peak, late_s)
    excess_m, wanted_m_s2 = np.zeros(len(t_ns)), np.zeros(len(t_ns))
    excess_m[earliest : peak + 1] = (motion.position_m[earliest : peak + 1, :2] - sound_m) @ right
    wanted_m_s2[earliest : peak + 1] = sound_m_s2 @ right
    off_m = float(np.nan_to_num(side * lateral.off_m[peak]))
    if excess_m[peak] < max(_OWN_M, _OWN_SHARE * min(off_m if off_m > 0.0 else math.inf, float(tracking_m[peak]))):
        sent_m = motion.setpoint_m[during, :2]
        sent_m = sent_m[np.isfinite(sent_m).all(axis=1)]
        moved_m = float((sent_m[0] - sent_m[-1]) @ right)
        out_m = float(np.nan_to_num(side * lateral.executive_m[earliest : peak + 1]).max())
        is_back = out_m > _OUT_M and side * lateral.executive_m[peak] < _BACK_SHARE * out_m
        words = _back_words(out_m, side) if is_back else _moved_words(moved_m)
        return Culprit.EXECUTIVE, Fault.SETPOINT, (words, _sound_words(off_m - float(excess_m[peak]), late_s))
    pushed = motion.push_m_s2 @ right
    thrust = motion.thrust_m_s2 @ right
    # Up to the turning point whatever moved it is braked again: what counts is how it got its way on.
    speed_m_s = slope(t_ns[: peak + 1], excess_m[: peak + 1, None])[:, 0]
    fastest = first + int(speed_m_s[during].argmax())
    set_off = _set_off(t_ns, speed_m_s, fastest)
    calm = pushed[int(np.searchsorted(t_ns, t_ns[set_off] - round(_BEFORE_S * NS_PER_S))) : set_off + 1]
    steady = float(np.median(calm))  # what the thrust was balancing when it began: a lull moves a vehicle, too
    gathering = slice(set_off, fastest + 1)
    t_s = t_ns[gathering] / NS_PER_S
    push_m_s = float(np.trapezoid(pushed[gathering] - steady, t_s))
    thrust_m_s = float(np.trapezoid(thrust[gathering] + steady - wanted_m_s2[gathering], t_s))
    tilt_rad = float(motion.tilt_rad[during].max())
    figures = [
        f"it left its setpoint by {tracking_m[peak]:.2f} m, at up to {speed_m_s[fastest]:.1f} m/s: in "
        f"{t_s[-1] - t_s[0]:.1f} s {_went('the air pushed it', push_m_s)}, "
        f"{_went('its own thrust took it', thrust_m_s)}, compared with a sound vehicle and with just before"
    ]
    if tilt_rad > TILT_LIMIT_RAD:
        figures.append(f"it was tilted by {math.degrees(tilt_rad):.0f} degrees, which is about as far as it may")
    if push_m_s > max(0.0, thrust_m_s) or (tilt_rad > TILT_LIMIT_RAD and thrust_m_s <= 0.0):
        words = f"The wind pushed the vehicle {tracking_m[peak]:.2f} m off where it was told to fly."
        return Culprit.WIND, Fault.PUSHED, (words, *figures)
    words = (
        f"The autopilot flew {tracking_m[peak]:.2f} m beside where it was told to fly, by its own thrust: a loop that "
        "is badly tuned, or a motor that is weak."
    )
    return Culprit.AUTOPILOT, Fault.TRACKING, (words, *figures)


def _growth_start(t_ns: NDArray[np.int64], values: Floats, peak: int) -> int:
    """Where a value that peaks at `peak` began to grow: where it was last a quarter of that."""
    earliest = int(np.searchsorted(t_ns, t_ns[peak] - round(GROWTH_S * NS_PER_S)))
    small = np.flatnonzero(~(values[earliest:peak] > _BEGUN * values[peak]))
    start = earliest + (int(small[-1]) if small.size else 0)
    return min(start, peak - 1) if peak else 0


def _set_off(t_ns: NDArray[np.int64], speed_m_s: Floats, fastest: int) -> int:
    """Where a vehicle that went away fastest at the sample `fastest` set off."""
    earliest = int(np.searchsorted(t_ns, t_ns[fastest] - round(GROWTH_S * NS_PER_S)))
    slow = np.flatnonzero(speed_m_s[earliest:fastest] <= _SLOW * speed_m_s[fastest])
    start = earliest + (int(slow[-1]) if slow.size else 0)
    return min(start, max(fastest - 1, 0))


def _went(who: str, away_m_s: float) -> str:
    return f"{who} {'away' if away_m_s > 0.0 else 'back'} by {abs(away_m_s):.1f} m/s"


def _moved_words(moved_m: float) -> str:
    return f"The setpoint went {abs(moved_m):.2f} m aside, and the vehicle came behind it as it should."


def _back_words(out_m: float, side: float) -> str:
    """Why the setpoint is to blame, though at the peak it is nearer the line than the vehicle."""
    words = "right" if side > 0 else "left"
    return (
        f"The setpoint had gone {out_m:.2f} m to the {words} of the line as told and came back faster than any vehicle "
        "follows: this one came behind it as it should, and that is why it was so far off its setpoint."
    )


def _sound_words(sound_m: float, late_s: float) -> str:
    return f"a sound vehicle, {late_s:.2f} s behind its setpoint, would have been {sound_m:.2f} m off the line, too"
