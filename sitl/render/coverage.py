"""How much of each pixel a straight strip covers, exactly, so that lines far thinner than a pixel hold."""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray


@njit(nogil=True, cache=True)  # type: ignore[untyped-decorator]
def square_below(distance: float, cosine: float, sine: float) -> float:
    """The part of a unit square that lies on the negative side of a straight edge.

    `distance` [px] is the edge's signed distance from the square's centre, `cosine` and `sine` those of the edge's
    normal. The square's width along the normal is a trapezoid; this is its integral up to the edge.
    """
    a, b = abs(cosine), abs(sine)
    outer, inner = 0.5 * (a + b), 0.5 * abs(a - b)
    x = abs(distance)
    if x >= outer:
        half = 0.5
    elif x <= inner:
        half = x / max(a, b)
    else:
        half = 0.5 - (outer - x) ** 2 / (2.0 * a * b)
    return 0.5 + half if distance > 0.0 else 0.5 - half


@njit(nogil=True, cache=True)  # type: ignore[untyped-decorator]
def ramp(distance: float) -> float:
    """How much of a 1 px wide step lies behind it [px]: 0 to 1. Pieces laid end to end share each pixel by it."""
    return min(1.0, max(0.0, distance + 0.5))


@njit(nogil=True, cache=True)  # type: ignore[untyped-decorator]
def add_strip(
    coverage: NDArray[np.float32],
    shaded: NDArray[np.float32],
    strip: NDArray[np.float64],
    shading: NDArray[np.float64],
) -> None:
    """Add a straight strip to a layer.

    `coverage` and `shaded` are (height, width) float32: the part of each pixel covered, and that part times its
    brightness. `strip` is x0, y0, width0, x1, y1, width1 [px]; the width goes linearly from one end to the other.
    `shading` is ambient, side, front, gloss, gloss_side, gloss_front: across the strip, at u from -1 (left) to 1
    (right of its direction), the brightness is ambient + max(0, side u + front n) + gloss max(0, gloss_side u +
    gloss_front n)^8 with n = sqrt(1 - u^2), which is a cylinder's; a flat thing has ambient alone.
    """
    height_px, width_px = coverage.shape
    x0, y0, w0, x1, y1, w1 = strip[0], strip[1], strip[2], strip[3], strip[4], strip[5]
    length_px = math.hypot(x1 - x0, y1 - y0)
    if length_px < 1e-9:
        return
    dx, dy = (x1 - x0) / length_px, (y1 - y0) / length_px
    # Walk along the axis that the strip follows more, and for each step over the few pixels across it.
    is_flat = abs(dx) >= abs(dy)
    reach_px = 0.5 * max(w0, w1) + 1.5
    across_px = reach_px / max(abs(dx), abs(dy))
    if is_flat:
        first = max(0, math.floor(min(x0, x1) - reach_px * abs(dy) - 1.0))
        last = min(width_px - 1, math.ceil(max(x0, x1) + reach_px * abs(dy) + 1.0))
        n_across, slope = height_px, dy / dx
    else:
        first = max(0, math.floor(min(y0, y1) - reach_px * abs(dx) - 1.0))
        last = min(height_px - 1, math.ceil(max(y0, y1) + reach_px * abs(dx) + 1.0))
        n_across, slope = width_px, dx / dy

    for i in range(first, last + 1):
        centre = y0 + (i - x0) * slope if is_flat else x0 + (i - y0) * slope
        low = max(0, math.floor(centre - across_px))
        high = min(n_across - 1, math.ceil(centre + across_px))
        for j in range(low, high + 1):
            px, py = (i, j) if is_flat else (j, i)
            along = (px - x0) * dx + (py - y0) * dy
            share = ramp(along) - ramp(along - length_px)
            if share <= 0.0:
                continue
            half = 0.5 * (w0 + (w1 - w0) * min(1.0, max(0.0, along / length_px)))
            side = (py - y0) * dx - (px - x0) * dy  # right of the strip's direction, as y points down
            part = share * (square_below(half - side, dx, dy) - square_below(-half - side, dx, dy))
            if part <= 0.0:
                continue
            coverage[py, px] += part
            shaded[py, px] += part * _brightness(side, half, shading)


@njit(nogil=True, cache=True)  # type: ignore[untyped-decorator]
def _brightness(side: float, half: float, shading: NDArray[np.float64]) -> float:
    """The mean brightness over the part of the strip that one pixel sees; `side`, `half` [px] as in add_strip."""
    if shading[1] == 0.0 and shading[2] == 0.0 and shading[3] == 0.0:
        return float(shading[0])
    # What is less than two pixels wide gets its mean brightness, whichever pixels it falls on: it must not shimmer.
    low, high = -1.0, 1.0
    if half > 1.0:
        low, high = max(low, (side - 0.5) / half), min(high, (side + 0.5) / half)
    # Ten samples follow the gloss across a whole cylinder; a pixel that sees little of it needs two.
    n_samples = 2 + int(4.0 * max(0.0, high - low))
    total = 0.0
    for k in range(n_samples):
        u = min(1.0, max(-1.0, low + (high - low) * (k + 0.5) / n_samples))
        n = math.sqrt(1.0 - u * u)
        gloss = max(0.0, shading[4] * u + shading[5] * n)
        gloss *= gloss
        gloss *= gloss
        total += shading[0] + max(0.0, shading[1] * u + shading[2] * n) + shading[3] * gloss * gloss
    return total / n_samples
