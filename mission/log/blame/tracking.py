"""Off the setpoint: pushed by the air, gone by its own thrust, or left behind by the setpoint."""

import math

import numpy as np
from numpy.typing import NDArray

from drivers.clock import NS_PER_S
from mission.log.blame.leg import GROWTH_S
from mission.log.blame.records import Culprit, Fault
from mission.log.blame.signals import Lateral, Motion, slope

Floats = NDArray[np.float64]

TILT_LIMIT_RAD = math.radians(38.0)
"""A vehicle that is tilted so far does what it can."""

_BEGUN = 0.25  # share of its peak where an excursion began
_BEFORE_S = 2.0
_SLOW = 0.1  # share of its greatest speed
_TURNED_RAD = math.radians(8.0)  # the line as told, at a bend


def of_tracking(motion: Motion, lateral: Lateral, peak: int, side: float) -> tuple[Culprit, Fault, tuple[str, ...]]:
    """Who took the vehicle off its setpoint, to the side where `side` is 1 (right) or -1, up to the sample `peak`.

    The setpoint itself, where it went away; else the air or the vehicle's own thrust, whichever gave it the larger
    impulse while it gathered way.
    """
    tracking_m = side * lateral.tracking_m
    first = _growth_start(motion.t_ns, tracking_m, peak)
    right = side * lateral.right
    pushed = (motion.push_m_s2 * right).sum(axis=1)
    thrust = (motion.thrust_m_s2 * right).sum(axis=1)
    during = slice(first, peak + 1)
    moved_m = float(
        -side * (motion.setpoint_m[during][-1, :2] - motion.setpoint_m[during][0, :2]) @ lateral.right[peak]
    )
    turned_rad = float(np.ptp(np.unwrap(np.arctan2(*lateral.right[during].T), period=np.pi)))
    if turned_rad > _TURNED_RAD or moved_m > 0.5 * abs(tracking_m[peak]):
        return Culprit.EXECUTIVE, Fault.SETPOINT, (_moved_words(moved_m, turned_rad),)
    # Up to the turning point whatever moved it is braked again: what counts is how it got its way on.
    speed_m_s = slope(motion.t_ns, np.nan_to_num(tracking_m)[:, None])[:, 0]
    fastest = first + int(speed_m_s[during].argmax())
    set_off = _set_off(motion.t_ns, speed_m_s, fastest)
    calm = pushed[int(np.searchsorted(motion.t_ns, motion.t_ns[set_off] - round(_BEFORE_S * NS_PER_S))) : set_off + 1]
    steady = float(np.median(calm))  # what the thrust was balancing when it began: a lull moves a vehicle, too
    gathering = slice(set_off, fastest + 1)
    t_s = motion.t_ns[gathering] / NS_PER_S
    push_m_s = float(np.trapezoid(pushed[gathering] - steady, t_s))
    thrust_m_s = float(np.trapezoid(thrust[gathering] + steady, t_s))
    tilt_rad = float(motion.tilt_rad[during].max())
    words = [
        f"it left its setpoint by {tracking_m[peak]:.2f} m, at up to {speed_m_s[fastest]:.1f} m/s: in "
        f"{t_s[-1] - t_s[0]:.1f} s {_went('the air pushed it', push_m_s)}, "
        f"{_went('its own thrust took it', thrust_m_s)}, compared with just before"
    ]
    if tilt_rad > TILT_LIMIT_RAD:
        words.append(f"it was tilted by {math.degrees(tilt_rad):.0f} degrees, which is about as far as it may")
    if push_m_s > max(0.0, thrust_m_s) or (tilt_rad > TILT_LIMIT_RAD and thrust_m_s <= 0.0):
        return Culprit.WIND, Fault.PUSHED, tuple(words)
    return Culprit.AUTOPILOT, Fault.TRACKING, tuple(words)


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


def _moved_words(moved_m: float, turned_rad: float) -> str:
    if turned_rad > _TURNED_RAD:
        return (
            f"the line as told turned by {math.degrees(turned_rad):.0f} degrees here, and the setpoint went over to "
            "the new span at once: the vehicle came behind it"
        )
    return f"the setpoint went {moved_m:.2f} m aside, and the vehicle came behind it"
