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
_MIN_SYMMETRY = 1.0  # how far a body has to stand out, as a multiple of the difference of the grounds beside it
_MIN_EVENNESS = 2.0  # the ground shows where a body ends when it is this many times as uneven
_MIN_TEXTURE = 5.0  # and that many grey levels more


@dataclass(frozen=True, slots=True)
class Profile:
    """What the columns say about one body.

    `contrast` [grey levels] is how far it stands out from both sides; 0 where it is between them, a step, or where they
    differ more than it stands out, the border of two grounds. `has_gap` says that columns inside look like the ground:
    these are two bodies. `grows_left_px` and `grows_right_px` [px] say how far beyond its edges the columns are still
    as even as the body.
    """

    contrast: float
    has_gap: bool
    grows_left_px: float
    grows_right_px: float


def measure_profile(
    axis: tuple[float, float, float, float], width_px: float, max_width_px: float, grey: NDArray[np.uint8]
) -> Profile:
    """Measure the body of `width_px` [px] around `axis`, x1, y1, x2, y2 [px], in the (h, w) uint8 image `grey`."""
    reach = math.ceil(max(max_width_px, width_px) / 2) + 1 + _GROUND_PX
    mean, deviation = measure_columns(grey, *axis, reach)
    contrast, has_gap, grows_left_px, grows_right_px = judge_columns(mean, deviation, width_px / 2)
    return Profile(contrast, has_gap, float(grows_left_px), float(grows_right_px))


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def judge_columns(
    mean: NDArray[np.float64], deviation: NDArray[np.float64], half: float
) -> tuple[float, bool, int, int]:
    """Profile's fields from the columns' mean and deviation, (2 reach + 1,) each, around a body `half` px to a side."""
    reach = mean.shape[0] // 2
    aside = np.abs(np.arange(-reach, reach + 1))
    is_body = aside <= max(0.5, half - 1)
    inner = math.floor(half + 1) + 1
    first, last = reach - inner, reach + inner
    left = mean[max(0, first - _GROUND_PX) : first + 1].mean()
    right = mean[last : last + _GROUND_PX + 1].mean()
    ground_deviation = 0.5 * (
        deviation[max(0, first - _GROUND_PX) : first + 1].mean() + deviation[last : last + _GROUND_PX + 1].mean()
    )
    stands_out = np.abs(mean[is_body] - 0.5 * (left + right))
    is_ground = (stands_out < _GROUND_LIKE * stands_out.max()) & (deviation[is_body] > _AS_UNEVEN * ground_deviation)
    middle = mean[aside <= max(0.5, half / 2)].mean()
    contrast = min(abs(middle - left), abs(middle - right))
    if (middle - left) * (middle - right) < 0 or contrast < _MIN_SYMMETRY * abs(left - right):
        contrast = 0.0
    far_deviation = 0.5 * (np.median(deviation[:_GROUND_PX]) + np.median(deviation[-_GROUND_PX:]))
    body_deviation = np.median(deviation[is_body])
    grows_left, grows_right = 0, 0
    if far_deviation > _MIN_EVENNESS * body_deviation + _MIN_TEXTURE:
        is_even = deviation < 0.5 * (body_deviation + far_deviation)
        beside = math.floor(half) + 1  # the first column beyond an edge
        grows_left = _run(is_even[: reach - beside + 1][::-1])
        grows_right = _run(is_even[reach + beside :])
    return contrast, is_ground.sum() >= _MIN_GAP_PX, grows_left, grows_right


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _run(is_even: NDArray[np.bool_]) -> int:
    """How many columns are even before the first one that is not.

    0 when all are, for then the body has no end; and 0 for a single one, which is the edge's own blur.
    """
    for i in range(is_even.shape[0]):
        if not is_even[i]:
            return i if i > 1 else 0
    return 0


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
