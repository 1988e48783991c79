"""Whether the line as told moved: a line stands still, so what moves is another one, or a wrong place of it. Pure."""

import itertools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.clock import NS_PER_S
from mission.log.blame.leg import GROWTH_S, Leg

Floats = NDArray[np.float64]

_WITHIN_S = 1.0  # a move in several frames is one
_LEAST_M = 0.4
_SHARE = 0.5  # of the excursion
_TURN_RAD = math.radians(6.0)
_FLICKER_S = 0.5  # does not steer
_BACK_S = 6.0  # a span takes longer
_BEND_AWAY_M = 12.0  # at most so far from the vehicle the line may bend (mission/known_line.py)


@dataclass(frozen=True, slots=True)
class Jump:
    """The line as told moved by `moved_m` to the right, within `took_s` up to `end_ns`.

    The vehicle itself went `own_m` to the right meanwhile.
    """

    end_ns: int
    took_s: float
    moved_m: float
    own_m: float


def jump_before(leg: Leg, start_ns: int, peak: int, off_m: float) -> Jump | None:
    """The largest move of the line as told that explains why the vehicle was `off_m` off it at the sample `peak`.

    It came after the excursion's growth began, before `start_ns`. None where the line stood still, or bent.
    """
    lateral = leg.lateral
    t_ns = lateral.t_ns
    steps_m = _steps_m(leg)
    window = np.flatnonzero((t_ns >= start_ns - round(GROWTH_S * NS_PER_S)) & (t_ns <= t_ns[peak]))
    if window.size < 2:
        return None
    way_m = np.cumsum(steps_m)
    before = np.searchsorted(t_ns, t_ns[window] - round(_WITHIN_S * NS_PER_S))
    moves_m = way_m[window] - way_m[np.maximum(before, window[0])]
    moves_m[~np.isfinite(moves_m)] = 0.0
    end = int(window[np.abs(moves_m).argmax()])
    moved_m = float(moves_m[np.abs(moves_m).argmax()])
    if abs(moved_m) < max(_LEAST_M, _SHARE * off_m):
        return None
    # Most of it may have come between two frames: that much of the second tells more.
    first = max(int(np.searchsorted(t_ns, t_ns[end] - round(_WITHIN_S * NS_PER_S))), int(window[0])) + 1
    sudden = first + int(np.abs(steps_m[first : end + 1]).argmax())
    first, end = (sudden, sudden) if abs(steps_m[sudden]) > 0.8 * abs(moved_m) else (first, end)
    # Between the frames that told of it, not between the ticks at which they were known.
    told_ns = lateral.told[[first - 1, end], 3]
    own_m = float((leg.motion.position_m[end, :2] - leg.motion.position_m[first - 1, :2]) @ lateral.right[end])
    return Jump(int(t_ns[end]), float(told_ns[1] - told_ns[0]) / NS_PER_S, float(steps_m[first : end + 1].sum()), own_m)


def turned_away_and_back(leg: Leg, start_ns: int, peak: int) -> tuple[float, float] | None:
    """By how much the line as told turned [rad], and after how long it turned back [s]; None where it did not.

    No span is so short that a vehicle would be over the next but one that soon.
    """
    lateral = leg.lateral
    t_ns = lateral.t_ns
    near = (t_ns >= start_ns - round((GROWTH_S + _BACK_S) * NS_PER_S)) & (
        t_ns <= t_ns[peak] + round(_BACK_S * NS_PER_S)
    )
    near = np.flatnonzero(near & np.isfinite(lateral.told[:, 2]))
    headings_rad = np.unwrap(lateral.told[near, 2], period=np.pi)
    turns = np.flatnonzero(np.abs(np.diff(headings_rad)) > _TURN_RAD) + 1
    for first, then in itertools.pairwise(turns.tolist()):
        away_rad = headings_rad[first] - headings_rad[first - 1]
        left_rad = headings_rad[then] - headings_rad[first - 1]
        took_s = float(t_ns[near[then]] - t_ns[near[first]]) / NS_PER_S
        # At a real bend the frames may tell of either span for a moment, but of another one in the end than before.
        whole_rad = headings_rad[-1] - headings_rad[0]
        if max(abs(left_rad), abs(whole_rad)) < 0.3 * abs(away_rad) and _FLICKER_S < took_s < _BACK_S:
            return float(away_rad), took_s
    return None


def turn_words(away_rad: float, took_s: float) -> tuple[str, ...]:
    """Such a turn in a sentence."""
    side = "right" if away_rad > 0 else "left"
    return (
        f"The line that the camera told of turned by {math.degrees(abs(away_rad)):.0f} degrees to the {side} and back "
        f"within {took_s:.1f} s, as no power line does: something else was taken for it.",
    )


def jump_words(jump: Jump) -> tuple[str, str]:
    """A jump in two sentences: what happened, and its figures."""
    side = "right" if jump.moved_m > 0 else "left"
    how = "jumped" if jump.took_s < 0.8 * _WITHIN_S else "went"
    return (
        f"The line that the camera told of {how} {abs(jump.moved_m):.2f} m to the {side} within {jump.took_s:.2f} s, "
        "though a power line stands still: something else was taken for it.",
        f"place of the line as told, by two frames {jump.took_s:.2f} s apart: {jump.moved_m:+.2f} m; the vehicle's own "
        f"way meanwhile, taken out of that: {jump.own_m:+.2f} m",
    )


def _steps_m(leg: Leg) -> Floats:
    """How far the line as told moved to the right since the sample before (n,) [m]; 0 where it bends, or was not told.

    Each line is told by its place abreast of the vehicle: what that place moved by across the line before counts.
    """
    lateral = leg.lateral
    told = lateral.told
    steps_m = np.zeros(len(told))
    if len(told) < 2:
        return steps_m
    headings_rad = told[:-1, 2]
    normal = np.stack([-np.sin(headings_rad), np.cos(headings_rad)], axis=1)
    aside_m = ((told[1:, :2] - told[:-1, :2]) * normal).sum(axis=1)
    turn_rad = np.remainder(told[1:, 2] - headings_rad + np.pi / 2, np.pi) - np.pi / 2
    # Where the line bends, both spans meet near by; a line that jumped runs beside the old one.
    is_bend = (np.abs(turn_rad) > _TURN_RAD) & (np.abs(aside_m) < _BEND_AWAY_M * np.abs(np.sin(turn_rad)))
    sign = np.sign((normal * lateral.right[1:]).sum(axis=1))
    steps_m[1:] = np.where(is_bend, 0.0, np.nan_to_num(aside_m * sign))
    return steps_m
