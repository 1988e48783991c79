"""The profile of a conductor: the grey levels of the columns parallel to it.

A conductor looks the same all along, and the ground beside it does not: each column's mean and deviation tell both.
"""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

_STEP_PX = 4.0  # along the conductor
_GROUND_PX = 6  # columns on each side that stand for the ground beside
_MIN_GAP_PX = 3  # this many columns like the ground beside make a gap between two conductors
_GROUND_LIKE = 0.25  # a column this share of the body's contrast from the ground's mean may be ground
_AS_UNEVEN = 0.6  # and it is when its deviation is this share of the ground's
_MIN_EVENNESS = 2.0  # the ground shows where a body ends when it is this many times as uneven
_MIN_TEXTURE = 5.0  # and that many grey levels more


@dataclass(frozen=True, slots=True)
class Profile:
    """What the columns say about one body.

    `contrast` [grey levels] is how far it stands out from both sides, 0 where it is between them: a step. `has_gap`
    says that columns inside look like the ground: these are two bodies. `grows_left_px` and `grows_right_px` say how
    far beyond its edges [px] the columns are still as even as the body.
    """

    contrast: float
    has_gap: bool
    grows_left_px: float
    grows_right_px: float


def measure_profile(
    axis: tuple[float, float, float, float], width_px: float, max_width_px: float, grey: NDArray[np.uint8]
) -> Profile:
    """Measure the body of `width_px` [px] around `axis`, x1, y1, x2, y2 [px], in the (h, w) uint8 image `grey`."""
    half = width_px / 2
    reach = math.ceil(max(max_width_px, width_px) / 2) + 1 + _GROUND_PX
    mean, deviation = measure_columns(grey, *axis, reach)
    aside = np.arange(-reach, reach + 1)
    body = np.flatnonzero(np.abs(aside) <= max(0.5, half - 1))
    first, last = reach - math.floor(half + 1) - 1, reach + math.floor(half + 1) + 1
    beside_left, beside_right = slice(max(0, first - _GROUND_PX), first + 1), slice(last, last + _GROUND_PX + 1)
    left, right = float(mean[beside_left].mean()), float(mean[beside_right].mean())
    ground_deviation = 0.5 * float(deviation[beside_left].mean() + deviation[beside_right].mean())
    stands_out = np.abs(mean[body] - 0.5 * (left + right))
    is_ground = (stands_out < _GROUND_LIKE * stands_out.max()) & (deviation[body] > _AS_UNEVEN * ground_deviation)
    core = mean[np.abs(aside) <= max(0.5, half / 2)]
    middle = float(core.mean())
    is_step = (middle - left) * (middle - right) < 0
    far_deviation = 0.5 * float(np.median(deviation[:_GROUND_PX]) + np.median(deviation[-_GROUND_PX:]))
    body_deviation = float(np.median(deviation[body]))
    grows_left_px, grows_right_px = 0.0, 0.0
    if far_deviation > _MIN_EVENNESS * body_deviation + _MIN_TEXTURE:
        is_even = deviation < 0.5 * (body_deviation + far_deviation)
        grows_left_px = _run_px(is_even[aside < -half][::-1])
        grows_right_px = _run_px(is_even[aside > half])
    return Profile(
        contrast=0.0 if is_step else min(abs(middle - left), abs(middle - right)),
        has_gap=int(is_ground.sum()) >= _MIN_GAP_PX,
        grows_left_px=grows_left_px,
        grows_right_px=grows_right_px,
    )


def _run_px(is_even: NDArray[np.bool_]) -> float:
    """How many columns are even before the first one that is not.

    0 when all are, for then the body has no end; and 0 for a single one, which is the edge's own blur.
    """
    uneven = np.flatnonzero(~is_even)
    return float(uneven[0]) if len(uneven) and uneven[0] > 1 else 0.0


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def measure_columns(
    grey: NDArray[np.uint8], x1: float, y1: float, x2: float, y2: float, reach: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Mean and standard deviation [grey levels] of the columns from `reach` px left of the line to as far right of it.

    Both are (2 reach + 1,) float64. A column is sampled every few pixels, bilinearly; beyond the frame the outermost
    pixel goes on.
    """
    height, width = grey.shape
    length = math.hypot(x2 - x1, y2 - y1)
    dx, dy = (x2 - x1) / length, (y2 - y1) / length
    n_rows = int(length / _STEP_PX) + 1
    mean, deviation = np.zeros(2 * reach + 1), np.zeros(2 * reach + 1)
    for row in range(n_rows):
        along = row * _STEP_PX
        for k in range(2 * reach + 1):
            x = min(max(x1 + along * dx - (k - reach) * dy, 0.0), width - 1.001)
            y = min(max(y1 + along * dy + (k - reach) * dx, 0.0), height - 1.001)
            left, top = int(x), int(y)
            share_x, share_y = x - left, y - top
            above = (1.0 - share_x) * grey[top, left] + share_x * grey[top, left + 1]
            below = (1.0 - share_x) * grey[top + 1, left] + share_x * grey[top + 1, left + 1]
            level = (1.0 - share_y) * above + share_y * below
            mean[k] += level
            deviation[k] += level * level
    for k in range(2 * reach + 1):
        mean[k] /= n_rows
        deviation[k] = math.sqrt(max(0.0, deviation[k] / n_rows - mean[k] * mean[k]))
    return mean, deviation
