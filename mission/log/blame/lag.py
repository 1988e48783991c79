"""Whether the frames' times are wrong: how late what a camera shows comes behind how the vehicle moved. Pure."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.clock import NS_PER_S

Floats = NDArray[np.float64]
Times = NDArray[np.int64]

_LAGS_S = np.arange(-50, 51) / 50.0
_LEAST_LAG_S = 0.1
_LEAST_MOTION = 0.008  # what the slopes scatter by at no lag: less tells nothing
_EXPLAINS = 0.65  # of that scatter may be left at the best lag
_LEAST_FRAMES = 40
_DRIFT_S = 4.0


@dataclass(frozen=True, slots=True)
class ImageLag:
    """The frames show where the vehicle was `lag_s` [s] before the time that they bear; negative: after it.

    With that taken into account the line's scatter is `residual` of what it was.
    """

    lag_s: float
    residual: float


def line_slope(aside_m: Floats, roll_rad: Floats, depth_m: float) -> Floats:
    """Where a line has to be in the image, to the right of its centre [focal lengths], (n,).

    For a vehicle `aside_m` (n,) to the right of the line, `depth_m` above it and rolled by `roll_rad` (n,), which flies
    along it: rolled to the right it looks to the left, and the line moves to the right.
    """
    return np.tan(np.arctan(-aside_m / depth_m) + roll_rad)


def image_lag(frame_ns: Times, image_slope: Floats, state_ns: Times, expected: Floats) -> ImageLag | None:
    """Find by how much the frames of a straight leg are late; None where they are not, or where it cannot be told.

    `image_slope` (n,) is how far to the right of the image centre a frame at `frame_ns` [ns] shows the line [focal
    lengths], `expected` (m,) where it had to be at `state_ns`. A line that does not move has one place: at the right
    lag the frames agree on it best.
    """
    if len(frame_ns) < _LEAST_FRAMES or len(state_ns) < _LEAST_FRAMES:
        return None
    scatters = np.array([_scatter(frame_ns, image_slope, state_ns, expected, lag_s) for lag_s in _LAGS_S.tolist()])
    best = int(scatters.argmin())
    lag_s = float(_LAGS_S[best])
    now = float(scatters[len(_LAGS_S) // 2])
    if now < _LEAST_MOTION or abs(lag_s) < _LEAST_LAG_S or scatters[best] > _EXPLAINS * now:
        return None
    return ImageLag(lag_s, float(scatters[best] / now))


def _scatter(frame_ns: Times, image_slope: Floats, state_ns: Times, expected: Floats, lag_s: float) -> float:
    """The median distance of the differences from their mean within some seconds, over which the position drifts."""
    then_ns = frame_ns - round(lag_s * NS_PER_S)
    differences = image_slope - np.interp(then_ns, state_ns, expected)
    half_ns = round(0.5 * _DRIFT_S * NS_PER_S)
    first, last = np.searchsorted(frame_ns, frame_ns - half_ns), np.searchsorted(frame_ns, frame_ns + half_ns, "right")
    sums = np.concatenate([[0.0], np.cumsum(differences)])
    spread = float(np.median(np.abs(differences - (sums[last] - sums[first]) / (last - first))))
    return spread if math.isfinite(spread) else math.inf
