"""A vehicle's motion as a log has it, and two of them brought to the same moments. Pure arithmetic on arrays."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

GRID_S = 0.05
"""Both motions are compared at this period."""
MAX_GAP_S = 0.5
"""Across a longer gap between samples nothing is interpolated."""

_MOVING_M_S = 0.3
_YAW_LEVER_M = 1.0  # how much a turn counts beside a movement [m/s for each rad/s]
_MAX_YAW_RATE_RAD_S = 3.0  # more is the estimator's heading being reset


@dataclass(frozen=True, slots=True)
class Motion:
    """A vehicle's motion as one log has it, in that log's clock.

    `t_s` (n,) float64 [s], rising; `position_m` and `velocity_m_s` (n, 3) float64 NED; `yaw_rad` (n,) float64.
    """

    t_s: Floats
    position_m: Floats
    velocity_m_s: Floats
    yaw_rad: Floats


@dataclass(frozen=True, slots=True)
class Pair:
    """Both motions at the same moments `t_s` (n,) of our clock, where both are known."""

    t_s: Floats
    ours_position_m: Floats
    theirs_position_m: Floats
    ours_velocity_m_s: Floats
    theirs_velocity_m_s: Floats
    ours_signal: Floats
    theirs_signal: Floats

    @staticmethod
    def of(ours: Motion, mapped: Motion) -> "Pair":
        """Bring our motion and theirs, `mapped` to our clock, to the same moments."""
        start_s, end_s = max(ours.t_s[0], mapped.t_s[0]), min(ours.t_s[-1], mapped.t_s[-1])
        t_s = np.arange(start_s, end_s, GRID_S) if end_s > start_s else np.empty(0)
        is_known = _is_known(ours.t_s, t_s) & _is_known(mapped.t_s, t_s)
        return Pair(
            t_s[is_known],
            *(_at(motion.t_s, motion.position_m, t_s)[is_known] for motion in (ours, mapped)),
            *(_at(motion.t_s, motion.velocity_m_s, t_s)[is_known] for motion in (ours, mapped)),
            *(_signal(motion, t_s)[is_known] for motion in (ours, mapped)),
        )


@dataclass(frozen=True, slots=True)
class Grid:
    """A motion on an even grid from `start_s` on; `signal` (n, 4) is 0 where it is not known."""

    start_s: float
    signal: Floats
    is_known: Flags
    is_moving: Flags

    @staticmethod
    def of(motion: Motion) -> "Grid":
        """Bring a motion to the grid."""
        t_s = np.arange(motion.t_s[0], motion.t_s[-1], GRID_S)
        is_known = _is_known(motion.t_s, t_s)
        signal = np.where(is_known[:, None], _signal(motion, t_s), 0.0)
        is_moving = is_known & (np.linalg.norm(signal[:, :3], axis=1) > _MOVING_M_S)
        return Grid(float(motion.t_s[0]), signal, is_known, is_moving)


def moving_s(velocity_m_s: Floats) -> float:
    """For how long [s] a velocity (n, 3) on the grid shows movement."""
    return float((np.linalg.norm(velocity_m_s, axis=1) > _MOVING_M_S).sum() * GRID_S)


def _signal(motion: Motion, t_s: Floats) -> Floats:
    """What is compared, (n, 4): the velocity [m/s] and the yaw rate on a lever [m/s]."""
    velocity_m_s = _at(motion.t_s, motion.velocity_m_s, t_s)
    if t_s.size < 2:
        return np.hstack([velocity_m_s, np.zeros((t_s.size, 1))])
    yaw_rate_rad_s = np.gradient(np.interp(t_s, motion.t_s, np.unwrap(motion.yaw_rad)), GRID_S)
    turn_m_s = np.clip(yaw_rate_rad_s, -_MAX_YAW_RATE_RAD_S, _MAX_YAW_RATE_RAD_S) * _YAW_LEVER_M
    return np.hstack([velocity_m_s, turn_m_s[:, None]])


def _at(source_s: Floats, values: Floats, t_s: Floats) -> Floats:
    """`values` (n, 3) at `source_s` (n,), interpolated at `t_s` (m,)."""
    return np.stack([np.interp(t_s, source_s, column) for column in values.T], axis=1)


def _is_known(source_s: Floats, t_s: Floats) -> Flags:
    """Whether each of `t_s` lies between two samples that are near each other."""
    after = np.clip(np.searchsorted(source_s, t_s, side="right"), 1, len(source_s) - 1)
    inside = (t_s >= source_s[0]) & (t_s <= source_s[-1])
    return np.asarray(inside & (source_s[after] - source_s[after - 1] <= MAX_GAP_S))
