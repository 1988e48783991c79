"""Draws the linework over the ground: the farther first, none where something nearer hides it."""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from sitl.render.ground import LIGHT_PX
from sitl.render.projection import NEAR_M, draw_discs, draw_members

ROUND, DECAL, SHADOW = 0, 1, 2
"""What an object is: round bars with a shading of their own, flat paint in the ground's light, or a lack of sun."""
_THINNEST_PX = 0.02  # what is thinner everywhere is left out
_SEEN_PART = 0.05  # a member that covers less of a pixel does not tell the pixel's depth


@njit(nogil=True, cache=True)  # type: ignore[untyped-decorator]
def arrange(
    spans: NDArray[np.int64],
    looks: NDArray[np.float64],
    members: NDArray[np.float64],
    centre: NDArray[np.float64],
    camera_from_ned: NDArray[np.float64],
    reach: NDArray[np.float64],
    f_px: float,
) -> NDArray[np.int64]:
    """Which objects can be in view, in drawing order: shadows, what lies on the ground, then all else from afar.

    The arguments are Linework's, the camera's, and clip_to_view's.
    """
    found = np.empty(spans.shape[0], dtype=np.int64)
    keys = np.empty(spans.shape[0])
    edge = np.empty(4)
    for i in range(4):
        edge[i] = math.sqrt(1.0 + reach[i] * reach[i])
    n = 0
    for k in range(spans.shape[0]):
        dn, de, dd = looks[k, 7] - centre[0], looks[k, 8] - centre[1], looks[k, 9] - centre[2]
        x = camera_from_ned[0, 0] * dn + camera_from_ned[0, 1] * de + camera_from_ned[0, 2] * dd
        y = camera_from_ned[1, 0] * dn + camera_from_ned[1, 1] * de + camera_from_ned[1, 2] * dd
        z = camera_from_ned[2, 0] * dn + camera_from_ned[2, 1] * de + camera_from_ned[2, 2] * dd
        radius = looks[k, 10]
        away = math.sqrt(x * x + y * y + z * z) - radius
        if not looks[k, 13] <= away < looks[k, 14] or looks[k, 15] * f_px < _THINNEST_PX * away:
            continue
        if (
            z + radius < NEAR_M
            or reach[0] * z - x > radius * edge[0]
            or x - reach[1] * z > radius * edge[1]
            or reach[2] * z - y > radius * edge[2]
            or y - reach[3] * z > radius * edge[3]
        ):
            continue
        kind = int(looks[k, 6])
        if kind == SHADOW:
            key = -2e9
        elif kind == DECAL:
            key = -1e9 - z
        else:
            nearest, middle = 1e9, max(NEAR_M, z)
            for m in range(spans[k, 0], spans[k, 1]):
                for end in range(0, 6, 3):
                    dn = members[m, end] - centre[0]
                    de = members[m, end + 1] - centre[1]
                    dd = members[m, end + 2] - centre[2]
                    z = camera_from_ned[2, 0] * dn + camera_from_ned[2, 1] * de + camera_from_ned[2, 2] * dd
                    if z < NEAR_M or z > nearest:
                        continue
                    x = camera_from_ned[0, 0] * dn + camera_from_ned[0, 1] * de + camera_from_ned[0, 2] * dd
                    y = camera_from_ned[1, 0] * dn + camera_from_ned[1, 1] * de + camera_from_ned[1, 2] * dd
                    if reach[0] * z <= x <= reach[1] * z and reach[2] * z <= y <= reach[3] * z:
                        nearest = z
            # A member may cross the view with both its ends outside.
            key = -((nearest if nearest < 1e9 else middle) - looks[k, 12])
        found[n], keys[n] = k, key
        n += 1
    return found[:n][np.argsort(keys[:n], kind="mergesort")]


@njit(nogil=True, cache=True)  # type: ignore[untyped-decorator]
def draw_linework(
    light: NDArray[np.float32],
    inverse: NDArray[np.float32],
    nearest: NDArray[np.float32],
    coverage: NDArray[np.float32],
    shaded: NDArray[np.float32],
    strips: NDArray[np.float64],
    members: NDArray[np.float64],
    discs: NDArray[np.float64],
    spans: NDArray[np.int64],
    looks: NDArray[np.float64],
    sun_ned: NDArray[np.float64],
    centre: NDArray[np.float64],
    camera_from_ned: NDArray[np.float64],
    lens: NDArray[np.float64],
    reach: NDArray[np.float64],
    shine: NDArray[np.float32],
    air_bgr: NDArray[np.float64],
    extinction: float,
) -> None:
    """Draw a world's Linework into `light` (height, width, 3) float32, over a ground whose `inverse` depth is known.

    `nearest` (height, width) float32 becomes the larger of itself and the linework's inverse depth [1/m]; of no size,
    it is left alone. `coverage` and `shaded` (height, width) float32 are 0 before and after; `strips` (m, 8) is room to
    work in. `shine` is GroundView's; `air_bgr` and `extinction` [1/m] are the haze.
    """
    material, bgr = np.empty(3), np.empty(3)
    for k in arrange(spans, looks, members, centre, camera_from_ned, reach, lens[0]):
        kind = int(looks[k, 6])
        for c in range(3):
            material[c], bgr[c] = looks[k, c], looks[k, 3 + c]
        n = draw_members(
            coverage, shaded, strips, members[spans[k, 0] : spans[k, 1]], kind != ROUND, material, sun_ned, centre,
            camera_from_ned, lens, reach,
        )  # fmt: skip
        n += draw_discs(coverage, shaded, strips[n:], discs[spans[k, 2] : spans[k, 3]], centre, camera_from_ned, lens)
        merge_strips(
            light, inverse, nearest, coverage, shaded, strips[:n], bgr, kind, looks[k, 11], shine, air_bgr, extinction
        )


@njit(nogil=True, cache=True)  # type: ignore[untyped-decorator]
def merge_strips(
    light: NDArray[np.float32],
    inverse: NDArray[np.float32],
    nearest: NDArray[np.float32],
    coverage: NDArray[np.float32],
    shaded: NDArray[np.float32],
    strips: NDArray[np.float64],
    bgr: NDArray[np.float64],
    kind: int,
    slack_m: float,
    shine: NDArray[np.float32],
    air_bgr: NDArray[np.float64],
    extinction: float,
) -> None:
    """Blend what `strips` left in `coverage` and `shaded` into `light`, in linear light, and empty it.

    Where pieces overlap, the coverage adds up to more than 1 and counts as 1. What the ground hides by more than
    `slack_m` [m] is not shown. A shadow's `bgr` is the light that is left where it is full; the rest as for
    draw_linework.
    """
    height_px, width_px = coverage.shape
    for s in range(strips.shape[0]):
        x0, y0, x1, y1 = strips[s, 0], strips[s, 1], strips[s, 3], strips[s, 4]
        length_px = math.hypot(x1 - x0, y1 - y0)
        if length_px < 1e-9:
            continue
        clear = math.exp(-2.0 * extinction / (strips[s, 6] + strips[s, 7]))
        dx, dy = (x1 - x0) / length_px, (y1 - y0) / length_px
        is_flat = abs(dx) >= abs(dy)
        reach_px = 0.5 * max(strips[s, 2], strips[s, 5]) + 1.5
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
                u, v = (i, j) if is_flat else (j, i)
                part = coverage[v, u]
                if part == 0.0:
                    continue
                bright = shaded[v, u]
                if part > 1.0:
                    bright /= part
                    part = np.float32(1.0)
                coverage[v, u] = shaded[v, u] = 0.0
                along = min(1.0, max(0.0, ((u - x0) * dx + (v - y0) * dy) / length_px))
                w = strips[s, 6] + along * (strips[s, 7] - strips[s, 6])
                if inverse[v, u] * (1.0 - slack_m * w) > w:
                    continue
                if nearest.size and kind == ROUND and part >= _SEEN_PART:
                    nearest[v, u] = max(nearest[v, u], np.float32(w))
                for c in range(3):
                    if kind == SHADOW:
                        light[v, u, c] *= np.float32(1.0 - min(1.0, bright) * clear * (1.0 - bgr[c]))
                    elif kind == DECAL:
                        y, x = v // LIGHT_PX, u // LIGHT_PX
                        paint = bright * bgr[c] * shine[c, y, x] + part * shine[3 + c, y, x]
                        light[v, u, c] = np.float32(light[v, u, c] * (1.0 - part) + paint)
                    else:
                        paint = bright * bgr[c] * clear + part * air_bgr[c] * (1.0 - clear)
                        light[v, u, c] = np.float32(light[v, u, c] * (1.0 - part) + paint)
