"""How a vehicle that follows its setpoint as it should would have flown. Pure."""

import numpy as np
from numpy.typing import NDArray

from drivers.clock import NS_PER_S
from mission.log.blame.signals import Motion, slope

Floats = NDArray[np.float64]

_DELAY_S = 1.05  # of a position loop whose gain is 0.95, PX4's MPC_XY_P
_LEAST_S, _MOST_S = 0.5, 1.5  # what it may be tuned to
_VELOCITY_PER_S, _VELOCITY_I_PER_S2, _VELOCITY_D = 1.8, 0.4, 0.2  # the loop within it: PX4's MPC_XY_VEL_*_ACC
_FAST_M_S = 1.0


def delay_s(motion: Motion) -> float:
    """How long the vehicle comes behind a setpoint that moves, in the median; at most what a sound one does [s]."""
    velocity_m_s = slope(motion.t_ns, motion.position_m)[:, :2]
    speed_m_s = np.linalg.norm(velocity_m_s, axis=1)
    ahead_m = ((motion.setpoint_m - motion.position_m)[:, :2] * velocity_m_s).sum(axis=1) / np.maximum(speed_m_s, 1e-6)
    is_told = (speed_m_s > _FAST_M_S) & np.isfinite(ahead_m)
    if not is_told.any():
        return _DELAY_S
    return float(np.clip(np.median(ahead_m[is_told] / speed_m_s[is_told]), _LEAST_S, _MOST_S))


def follow(motion: Motion, first: int, last: int, late_s: float) -> tuple[Floats, Floats]:
    """Where a sound vehicle would have been, and its acceleration: (k, 2) NE [m], [m/s2], samples `first` to `last`.

    It starts as the real one was. Its velocity goes after the way that is left, divided by `late_s` [s].
    """
    place_m = motion.position_m[first, :2].copy()
    velocity_m_s = slope(motion.t_ns, motion.position_m)[first, :2].copy()
    kept_m_s2 = np.zeros(2)
    places_m, accelerations = [place_m.copy()], [np.zeros(2)]
    for k in range(first + 1, last + 1):
        dt_s = float(motion.t_ns[k] - motion.t_ns[k - 1]) / NS_PER_S
        goal_m = motion.setpoint_m[k, :2]
        wanted_m_s = (goal_m - place_m) / late_s if np.isfinite(goal_m).all() else velocity_m_s
        before_m_s = velocity_m_s
        missing_m_s = wanted_m_s - velocity_m_s
        kept_m_s2 = kept_m_s2 + _VELOCITY_I_PER_S2 * missing_m_s * dt_s
        velocity_m_s = velocity_m_s + (_VELOCITY_PER_S * missing_m_s + kept_m_s2) / (1.0 + _VELOCITY_D) * dt_s
        place_m = place_m + velocity_m_s * dt_s
        places_m.append(place_m)
        accelerations.append((velocity_m_s - before_m_s) / max(dt_s, 1e-6))
    return np.array(places_m), np.array(accelerations)
