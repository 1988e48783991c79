"""Round members and flat ribbons in space, brought into the image as strips and drawn into a layer."""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from sitl.render.coverage import add_strip, ramp

NEAR_M = 0.05
_PIECE_PX = 12.0  # a lens bends straight lines; pieces of this length follow it within a hundredth of a pixel


@njit(nogil=True, cache=True)  # type: ignore[untyped-decorator]
def project_point(x: float, y: float, z: float, lens: NDArray[np.float64]) -> tuple[float, float]:
    """Project a camera-frame point [m], z > 0, to pixels; `lens` is sitl.render.lens.lens_vector's."""
    a, b = x / z, y / z
    r2 = a * a + b * b
    if lens[9] != 0.0:
        r = math.sqrt(r2)
        angle = math.atan(r)
        t2 = angle * angle
        bent = angle * (1.0 + t2 * (lens[4] + t2 * (lens[5] + t2 * (lens[6] + t2 * lens[7]))))
        scale = bent / r if r > 1e-9 else 1.0
        return lens[0] * a * scale + lens[2], lens[1] * b * scale + lens[3]
    radial = 1.0 + r2 * (lens[4] + r2 * (lens[5] + r2 * lens[8]))
    da = a * radial + 2.0 * lens[6] * a * b + lens[7] * (r2 + 2.0 * a * a)
    db = b * radial + lens[6] * (r2 + 2.0 * b * b) + 2.0 * lens[7] * a * b
    return lens[0] * da + lens[2], lens[1] * db + lens[3]


@njit(nogil=True, cache=True)  # type: ignore[untyped-decorator]
def clip_to_view(p: NDArray[np.float64], q: NDArray[np.float64], reach: NDArray[np.float64]) -> tuple[float, float]:
    """What part of a camera-frame segment p to q [m] can be seen, as fractions (first, last) of it; first > last: none.

    `reach` is (4,): the smallest and largest x / z and y / z inside the view. What is nearer than NEAR_M, or behind,
    is cut off (Liang and Barsky's clipping against the five planes).
    """
    first, last = 0.0, 1.0
    for plane in range(5):
        if plane == 0:
            dp, dq = p[2] - NEAR_M, q[2] - NEAR_M
        else:
            axis, limit = (plane - 1) // 2, reach[plane - 1]
            sign = 1.0 if plane % 2 == 1 else -1.0
            dp, dq = sign * (p[axis] - limit * p[2]), sign * (q[axis] - limit * q[2])
        if dp < 0.0 and dq < 0.0:
            return 1.0, 0.0
        if dp < 0.0:
            first = max(first, dp / (dp - dq))
        elif dq < 0.0:
            last = min(last, dp / (dp - dq))
    return first, last


@njit(nogil=True, cache=True)  # type: ignore[untyped-decorator]
def _unit_cross(a: NDArray[np.float64], b: NDArray[np.float64], out: NDArray[np.float64]) -> bool:
    """Write the unit vector along a x b; False where they are parallel."""
    x, y, z = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
    norm = math.sqrt(x * x + y * y + z * z)
    if norm < 1e-9:
        return False
    out[0], out[1], out[2] = x / norm, y / norm, z / norm
    return True


@njit(nogil=True, cache=True)  # type: ignore[untyped-decorator]
def _to_camera(
    ned: NDArray[np.float64],
    centre: NDArray[np.float64],
    camera_from_ned: NDArray[np.float64],
    out: NDArray[np.float64],
) -> None:
    """Write a NED point [m] in the camera frame [m]; plain loops, because BLAS costs more than it saves on 3 x 3."""
    for i in range(3):
        out[i] = 0.0
        for j in range(3):
            out[i] += camera_from_ned[i, j] * (ned[j] - centre[j])


@njit(nogil=True, cache=True)  # type: ignore[untyped-decorator]
def _edge_px(
    point: NDArray[np.float64], lateral: NDArray[np.float64], half_m: float, lens: NDArray[np.float64]
) -> tuple[float, float]:
    """How far [px] it is in the image from one edge of a member to the other, at a camera-frame point of its axis."""
    # An edge that would pass behind the camera is beyond the image anyway.
    z0 = max(NEAR_M / 2.0, point[2] - lateral[2] * half_m)
    z1 = max(NEAR_M / 2.0, point[2] + lateral[2] * half_m)
    x0, y0 = project_point(point[0] - lateral[0] * half_m, point[1] - lateral[1] * half_m, z0, lens)
    x1, y1 = project_point(point[0] + lateral[0] * half_m, point[1] + lateral[1] * half_m, z1, lens)
    return x1 - x0, y1 - y0


@njit(nogil=True, cache=True)  # type: ignore[untyped-decorator]
def draw_members(
    coverage: NDArray[np.float32],
    shaded: NDArray[np.float32],
    strips: NDArray[np.float64],
    members: NDArray[np.float64],
    is_ribbon: bool,
    material: NDArray[np.float64],
    sun_ned: NDArray[np.float64],
    centre: NDArray[np.float64],
    camera_from_ned: NDArray[np.float64],
    lens: NDArray[np.float64],
    reach: NDArray[np.float64],
) -> int:
    """Draw straight members into a layer and return how many strips they became.

    `coverage`, `shaded`: see add_strip. `strips` (m, 8) is written: each strip as add_strip takes it, and the inverse
    depth [1/m] at its start and end; what would be more than m strips is not drawn.
    `members` is (n, 9): both ends NED [m], both diameters [m], and a
    brightness. Round ones are lit as cylinders by `material` = (ambient, direct, gloss) and a sun towards `sun_ned`
    (3,); ribbons lie flat on a horizontal plane and show their brightness alone. `centre` (3,) NED [m] and
    `camera_from_ned` (3, 3) are the camera's, `reach` is clip_to_view's.
    """
    down = camera_from_ned[:, 2].copy()
    sun, origin = np.empty(3), np.zeros(3)
    _to_camera(sun_ned, origin, camera_from_ned, sun)
    p, q, axis, lateral = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    point, sight = np.empty(3), np.empty(3)
    strip, shading, edges = np.empty(6), np.zeros(6), np.empty((2, 2))
    is_bent = lens[4] != 0.0 or lens[5] != 0.0 or lens[6] != 0.0 or lens[7] != 0.0 or lens[8] != 0.0 or lens[9] != 0.0

    n_strips = 0
    for k in range(members.shape[0]):
        _to_camera(members[k, 0:3], centre, camera_from_ned, p)
        _to_camera(members[k, 3:6], centre, camera_from_ned, q)
        first, last = clip_to_view(p, q, reach)
        if first >= last:
            continue
        length = math.sqrt((q[0] - p[0]) ** 2 + (q[1] - p[1]) ** 2 + (q[2] - p[2]) ** 2)
        for i in range(3):
            axis[i] = (q[i] - p[i]) / length
        z0, z1 = p[2] + first * (q[2] - p[2]), p[2] + last * (q[2] - p[2])
        n_pieces = _n_pieces(p, q, first, last, lens) if is_bent else 1
        for piece in range(n_pieces):
            for end in range(2):
                # Equal steps in the image, not in space: 1 / z is linear along the image of a straight line.
                step = (piece + end) / n_pieces
                along = first + (last - first) * step * z0 / (z1 + step * (z0 - z1))
                for i in range(3):
                    point[i] = p[i] + along * (q[i] - p[i])
                    sight[i] = -point[i]
                if not _unit_cross(axis, down if is_ribbon else sight, lateral):
                    lateral[0], lateral[1], lateral[2] = 1.0, 0.0, 0.0
                diameter = members[k, 6] + along * (members[k, 7] - members[k, 6])
                strip[3 * end], strip[3 * end + 1] = project_point(point[0], point[1], point[2], lens)
                edges[end, 0], edges[end, 1] = _edge_px(point, lateral, 0.5 * diameter, lens)
            dx, dy = strip[3] - strip[0], strip[4] - strip[1]
            norm = math.hypot(dx, dy)
            if norm < 1e-9:
                continue
            for end in range(2):
                strip[3 * end + 2] = abs(edges[end, 1] * dx - edges[end, 0] * dy) / norm
            shading[0] = members[k, 8]
            if not is_ribbon:
                if edges[1, 1] * dx - edges[1, 0] * dy < 0.0:  # let `lateral` point to the strip's right
                    for i in range(3):
                        lateral[i] = -lateral[i]
                _light_cylinder(shading, lateral, axis, sight, sun, material, members[k, 8])
            if n_strips == strips.shape[0]:
                return n_strips
            for i in range(6):
                strips[n_strips, i] = strip[i]
            strips[n_strips, 6] = (1.0 - piece / n_pieces) / z0 + piece / n_pieces / z1
            strips[n_strips, 7] = (1.0 - (piece + 1) / n_pieces) / z0 + (piece + 1) / n_pieces / z1
            n_strips += 1
            add_strip(coverage, shaded, strip, shading)
    return n_strips


@njit(nogil=True, cache=True)  # type: ignore[untyped-decorator]
def _n_pieces(
    p: NDArray[np.float64], q: NDArray[np.float64], first: float, last: float, lens: NDArray[np.float64]
) -> int:
    """Into how many straight pieces the image of a segment is cut so that it follows the lens."""
    a, b = p + first * (q - p), p + last * (q - p)
    x0, y0 = project_point(a[0], a[1], a[2], lens)
    x1, y1 = project_point(b[0], b[1], b[2], lens)
    return 1 + int(math.hypot(x1 - x0, y1 - y0) / _PIECE_PX)


@njit(nogil=True, cache=True)  # type: ignore[untyped-decorator]
def _light_cylinder(
    shading: NDArray[np.float64],
    lateral: NDArray[np.float64],
    axis: NDArray[np.float64],
    sight: NDArray[np.float64],
    sun: NDArray[np.float64],
    material: NDArray[np.float64],
    brightness: float,
) -> None:
    """Fill add_strip's shading for a cylinder: Lambert's cosine law, and Blinn's half vector for the gloss."""
    front = np.empty(3)
    if not _unit_cross(lateral, axis, front):
        front[0], front[1], front[2] = 0.0, 0.0, -1.0
    sign = 1.0 if front[0] * sight[0] + front[1] * sight[1] + front[2] * sight[2] >= 0.0 else -1.0
    distance = math.sqrt(sight[0] ** 2 + sight[1] ** 2 + sight[2] ** 2)
    side, ahead, half_side, half_ahead, half_square = 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(3):
        half = sun[i] + sight[i] / distance
        side += sun[i] * lateral[i]
        ahead += sign * sun[i] * front[i]
        half_side += half * lateral[i]
        half_ahead += sign * half * front[i]
        half_square += half * half
    half_norm = max(1e-9, math.sqrt(half_square))
    shading[0] = brightness * material[0]
    shading[1] = brightness * material[1] * side
    shading[2] = brightness * material[1] * ahead
    shading[3] = brightness * material[2]
    shading[4] = half_side / half_norm
    shading[5] = half_ahead / half_norm


@njit(nogil=True, cache=True)  # type: ignore[untyped-decorator]
def draw_discs(
    coverage: NDArray[np.float32],
    shaded: NDArray[np.float32],
    strips: NDArray[np.float64],
    discs: NDArray[np.float64],
    centre: NDArray[np.float64],
    camera_from_ned: NDArray[np.float64],
    lens: NDArray[np.float64],
) -> int:
    """Lay discs, the tops of round members, over a layer and return how many strips of `strips` tell where.

    `discs` is (n, 5): centre NED [m], diameter [m], brightness; the rest as for draw_members. A disc is a circle
    flattened along the image of the vertical, as a camera sees a horizontal one.
    """
    height_px, width_px = coverage.shape
    p, down = np.empty(3), camera_from_ned[:, 2]
    n_strips = 0
    for k in range(discs.shape[0]):
        _to_camera(discs[k, 0:3], centre, camera_from_ned, p)
        # Beyond 60 degrees off the axis it is out of any image, and the lens model may fold back into it.
        if p[2] < NEAR_M or math.hypot(p[0], p[1]) > 1.75 * p[2]:
            continue
        distance = math.sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2])
        flat = (p[0] * down[0] + p[1] * down[1] + p[2] * down[2]) / distance
        if flat <= 0.02 or n_strips == strips.shape[0]:  # from below, a top is not seen
            continue
        x, y = project_point(p[0], p[1], p[2], lens)
        radius = 0.5 * discs[k, 3] * lens[0] / p[2]
        left, right = max(0, math.floor(x - radius - 1.0)), min(width_px - 1, math.ceil(x + radius + 1.0))
        top, bottom = max(0, math.floor(y - radius - 1.0)), min(height_px - 1, math.ceil(y + radius + 1.0))
        if left > right or top > bottom:
            continue
        dx, dy = down[0] * p[2] - p[0] * down[2], down[1] * p[2] - p[1] * down[2]
        norm = max(1e-9, math.hypot(dx, dy))
        dx, dy = dx / norm, dy / norm
        for i in range(8):
            strips[n_strips, i] = 0.0
        strips[n_strips, 0], strips[n_strips, 1] = x - radius, y
        strips[n_strips, 3], strips[n_strips, 4] = x + radius, y
        strips[n_strips, 2] = strips[n_strips, 5] = 2.0 * radius
        strips[n_strips, 6] = strips[n_strips, 7] = 1.0 / p[2]
        n_strips += 1
        thinness = min(1.0, math.pi * radius * radius * flat)
        for v in range(top, bottom + 1):
            for u in range(left, right + 1):
                long = (u - x) * dx + (v - y) * dy
                wide = (v - y) * dx - (u - x) * dy
                part = ramp(radius - math.hypot(long / flat, wide)) * thinness
                coverage[v, u] += part * (1.0 - coverage[v, u])
                shaded[v, u] += part * (discs[k, 4] - shaded[v, u])
    return n_strips
