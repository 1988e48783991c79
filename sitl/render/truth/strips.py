"""Members brought into the image as straight strips with a width and a depth, and marked there pixel by pixel."""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from sitl.render.projection import NEAR_M, clip_to_view, project_point

_PIECE_PX = 12.0  # as long as a straight piece may be where the lens bends
_AT_LEAST_PX = 0.5  # half the width of what is marked of a member: the pixels nearest to its axis at least
_SEEN_PX = 0.05  # what is thinner leaves no trace in a picture
_LEEWAY = 0.01
_LEEWAY_M = 0.15


@njit(nogil=True, cache=True)  # type: ignore[untyped-decorator]
def find_strips(
    members: NDArray[np.float64],
    centre: NDArray[np.float64],
    camera_from_ned: NDArray[np.float64],
    lens: NDArray[np.float64],
    view: NDArray[np.float64],
) -> NDArray[np.float64]:
    """The visible parts of straight members, seen from `centre` (3,) NED [m]: (n, 9) float64.

    Each is x, y, width [px] and depth [m] of its start, the same of its end, and the member's number. `members` is
    (m, 8): both ends NED [m] and both diameters [m]; `lens` is lens.lens_vector's, `view` clip_to_view's.
    """
    found = np.empty((64, 9))
    n_found = 0
    is_bent = np.any(lens[4:] != 0.0)
    p, q = np.empty(3), np.empty(3)
    for k in range(len(members)):
        for i in range(3):
            p[i], q[i] = 0.0, 0.0
            for j in range(3):
                p[i] += camera_from_ned[i, j] * (members[k, j] - centre[j])
                q[i] += camera_from_ned[i, j] * (members[k, 3 + j] - centre[j])
        first, last = clip_to_view(p, q, view)
        if first >= last:
            continue
        a, b = p + first * (q - p), p + last * (q - p)
        n_pieces = 1
        if is_bent:
            ax, ay = project_point(a[0], a[1], a[2], lens)
            bx, by = project_point(b[0], b[1], b[2], lens)
            n_pieces = 1 + int(math.hypot(bx - ax, by - ay) / _PIECE_PX)
        while n_found + n_pieces > len(found):
            found = np.concatenate((found, np.empty_like(found)))
        for piece in range(n_pieces):
            for end in range(2):
                # Equal steps in the image: 1 / z is linear along the image of a straight line.
                step = (piece + end) / n_pieces
                along = first + (last - first) * step * a[2] / (b[2] + step * (a[2] - b[2]))
                diameter_m = members[k, 6] + along * (members[k, 7] - members[k, 6])
                _write_end(p, q, along, diameter_m, lens, found[n_found, 4 * end : 4 * end + 4])
            found[n_found, 8] = k
            n_found += 1
    return found[:n_found].copy()


@njit(nogil=True, cache=True)  # type: ignore[untyped-decorator]
def _write_end(
    p: NDArray[np.float64],
    q: NDArray[np.float64],
    along: float,
    diameter_m: float,
    lens: NDArray[np.float64],
    out: NDArray[np.float64],
) -> None:
    """Write x, y, width [px] and depth [m] of the point at `along`, 0 to 1, of a camera-frame member p to q [m]."""
    point, axis = p + along * (q - p), q - p
    lateral = np.cross(axis, -point)
    norm = math.sqrt((lateral**2).sum())
    x, y = project_point(point[0], point[1], point[2], lens)
    width_px = lens[0] * diameter_m / point[2]
    if norm > 1e-9:  # else it is seen along its axis: as round as it is
        half = lateral * (0.5 * diameter_m / norm)
        x0, y0 = project_point(point[0] - half[0], point[1] - half[1], max(0.5 * NEAR_M, point[2] - half[2]), lens)
        x1, y1 = project_point(point[0] + half[0], point[1] + half[1], max(0.5 * NEAR_M, point[2] + half[2]), lens)
        width_px = math.hypot(x1 - x0, y1 - y0)
    out[0], out[1], out[2], out[3] = x, y, width_px, point[2]


@njit(nogil=True, cache=True)  # type: ignore[untyped-decorator]
def mark_strips(
    numbers: NDArray[np.int32], depth_m: NDArray[np.float32], strips: NDArray[np.float64], thing: NDArray[np.int32]
) -> None:
    """Write which thing each pixel shows, and how far it is, over what lies farther away.

    `numbers` (height, width) int32 and `depth_m` (height, width) float32 are written to; `strips` is find_strips()'s,
    `thing` (members,) int32 the number of the thing that a member belongs to. A pixel belongs to a member when its
    centre lies on it, or when no other in its row (or column) is nearer to the member's axis: what is thinner than a
    pixel is marked all along, but not what is thinner than a twentieth of it.
    """
    height_px, width_px = numbers.shape
    for k in range(len(strips)):
        x0, y0, w0, z0, x1, y1, w1, z1, member = strips[k]
        if max(w0, w1) < _SEEN_PX:
            continue
        length_px = math.hypot(x1 - x0, y1 - y0)
        dx, dy = (1.0, 0.0) if length_px < 1e-9 else ((x1 - x0) / length_px, (y1 - y0) / length_px)
        is_flat = abs(dx) >= abs(dy)
        steep = max(abs(dx), abs(dy))
        start, end = (x0, x1) if is_flat else (y0, y1)
        low, high = math.ceil(min(start, end) - 0.5), math.floor(max(start, end) + 0.5)
        for i in range(max(0, low), min((width_px if is_flat else height_px) - 1, high) + 1):
            part = 0.0 if start == end else min(1.0, max(0.0, (i - start) / (end - start)))
            middle = (y0 + part * (y1 - y0)) if is_flat else (x0 + part * (x1 - x0))
            half = max(_AT_LEAST_PX, 0.5 * (w0 + part * (w1 - w0)) / steep)
            z = 1.0 / (1.0 / z0 + part * (1.0 / z1 - 1.0 / z0))
            for j in range(
                max(0, math.ceil(middle - half)),
                min((height_px if is_flat else width_px) - 1, math.floor(middle + half)) + 1,
            ):
                u, v = (i, j) if is_flat else (j, i)
                # Some leeway, for a depth in which the member itself is drawn already.
                if z <= depth_m[v, u] * (1.0 + _LEEWAY) + _LEEWAY_M:
                    numbers[v, u] = thing[int(member)]
                    depth_m[v, u] = min(depth_m[v, u], z)
