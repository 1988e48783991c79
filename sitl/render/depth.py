"""How far each pixel sees: rays on a coarse grid, and finer where depths disagree or something may stand between."""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from sitl.render.relief import NOTHING, fold, height_at, march

COARSE_PX = 16
# What part of the inverse depth two neighbours may disagree by, beyond what a smooth surface explains, before rays
# are marched between them: the smallest for which a frame's rays suffice.
_TOLERANCES = (0.02, 0.04, 0.08, 0.16, 0.32, 0.64, 0.9)
_JUMP = 0.08
_AROUND = 0.06  # of the depth: how far before and behind a thing's edge the thing may go on
_BUSY_M, _BUSY_FROM_M = 0.3, 250.0
_MOST_FINE = 0.013  # of a frame's pixels: how many rays it may spend on each finer grid
_FINE_PX = 2.7  # smaller things may be rough


@njit(nogil=True, cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def _oddness(before: float, a: float, b: float, after: float) -> float:
    """How much the step from a to b is larger than its neighbours, as a part of the larger inverse depth."""
    step = b - a
    low, high = min(a - before, after - b), max(a - before, after - b)
    odd = max(0.0, step - high, low - step)
    return odd / max(abs(a), abs(b), 5e-4)


@njit(nogil=True, cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def _mark_odd(
    inverse: NDArray[np.float32],
    marched: NDArray[np.uint8],
    odd: NDArray[np.float32],
    is_edge: NDArray[np.uint8],
    step: int,
) -> float:
    """Write how odd the depths round each square of `step` px are; from which oddness on the frame can afford rays."""
    counts = np.zeros(len(_TOLERANCES), dtype=np.int64)
    n_rows, n_columns = inverse.shape[0] - 1, inverse.shape[1] - 1
    parents = ~(2 * step - 1)
    i = -1
    for v in range(0, n_rows, step):
        up, down = max(0, v - step), min(n_rows, v + 2 * step)
        v_parent = (v & parents) + step
        i += 1
        j = -1
        for u in range(0, n_columns, step):
            j += 1
            here = np.float32(0.0)
            # What was interpolated is smooth.
            if step == COARSE_PX or marched[v_parent, (u & parents) + step]:
                left, right = max(0, u - step), min(n_columns, u + 2 * step)
                for k in range(2):
                    x, y = u + k * step, v + k * step
                    a, b = inverse[y, u], inverse[y, u + step]
                    before = inverse[y, left] if left < u else 2 * a - b
                    after = inverse[y, right] if right > u + step else 2 * b - a
                    here = max(here, _oddness(before, a, b, after))
                    a, b = inverse[v, x], inverse[v + step, x]
                    before = inverse[up, x] if up < v else 2 * a - b
                    after = inverse[down, x] if down > v + step else 2 * b - a
                    here = max(here, _oddness(before, a, b, after))
                for k in range(len(_TOLERANCES)):
                    if here >= _TOLERANCES[k]:
                        counts[k] += 1
            odd[i, j] = here
            if step == 4:
                is_edge[i, j] = here >= _JUMP
    if step == COARSE_PX:
        return _TOLERANCES[0]
    for k in range(len(_TOLERANCES)):
        if 5.0 * counts[k] <= _MOST_FINE * n_rows * n_columns * (1.0 if step > 2 else 0.5):
            return _TOLERANCES[k] if counts[k] > 0 else np.inf
    return np.inf


@njit(nogil=True, cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def _mark_busy(
    inverse: NDArray[np.float32],
    odd: NDArray[np.float32],
    rays: NDArray[np.float32],
    highest_m: NDArray[np.float32],
    levels: NDArray[np.int64],
    leaf_m: NDArray[np.float64],
    place: NDArray[np.float64],
    centre: NDArray[np.float64],
    r: NDArray[np.float64],
) -> None:
    """Mark the coarse squares between whose rays something may stand that none of them met.

    That is where the surface round the rays' last tenth is higher than where they end.
    """
    top = levels.shape[0] - 1
    for i in range((inverse.shape[0] - 1) // COARSE_PX):
        for j in range((inverse.shape[1] - 1) // COARSE_PX):
            if odd[i, j] >= 1.0:
                continue
            low_a = low_b = 1e9
            high_a = high_b = -1e9
            up_m, n_sky = -1e9, 0
            for k in range(4):
                v, u = (i + (k >> 1)) * COARSE_PX, (j + (k & 1)) * COARSE_PX
                w = inverse[v, u]
                if w <= 1.0 / _BUSY_FROM_M:
                    n_sky += 1 if w <= 0.0 else 5
                    continue
                x, y = rays[0, v, u], rays[1, v, u]
                a = (r[0, 0] * x + r[0, 1] * y + r[0, 2]) / w / leaf_m[0]
                b = (r[1, 0] * x + r[1, 1] * y + r[1, 2]) / w / leaf_m[1]
                up_m = max(up_m, -centre[2] - (r[2, 0] * x + r[2, 1] * y + r[2, 2]) / w)
                low_a, high_a = min(low_a, a, 0.9 * a), max(high_a, a, 0.9 * a)
                low_b, high_b = min(low_b, b, 0.9 * b), max(high_b, b, 0.9 * b)
            if n_sky == 4:
                continue
            if n_sky > 0:
                odd[i, j] = 1.0
                continue
            a0, b0 = (centre[0] - place[0]) / leaf_m[0], (centre[1] - place[1]) / leaf_m[1]
            level, reach = 0, max(high_a - low_a, high_b - low_b)
            while level < top and reach > 2.0:
                reach *= 0.5
                level += 1
            n_rows, n_columns = levels[level, 1], levels[level, 2]
            for y_part in range(math.floor(a0 + low_a) >> level, (math.floor(a0 + high_a) >> level) + 1):
                for x_part in range(math.floor(b0 + low_b) >> level, (math.floor(b0 + high_b) >> level) + 1):
                    part = fold(y_part, n_rows) * n_columns + fold(x_part, n_columns)
                    if highest_m[levels[level, 0] + part] > up_m + _BUSY_M:
                        odd[i, j] = 1.0


@njit(nogil=True, cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def _halve(inverse: NDArray[np.float32], odd: NDArray[np.float32], step: int, is_flat: bool) -> None:
    """Fill the nodes half-way between those `step` px apart: by the mean, or where depths jump by one neighbour."""
    half = step // 2
    n_rows, n_columns = inverse.shape[0] - 1, inverse.shape[1] - 1
    part = np.float32(0.5)
    for v in range(0, n_rows + 1, step):
        for u in range(0, n_columns, step):
            inverse[v, u + half] = part * (inverse[v, u] + inverse[v, u + step])
    for v in range(0, n_rows, step):
        for u in range(0, n_columns + 1, half):
            inverse[v + half, u] = part * (inverse[v, u] + inverse[v + step, u])
    if is_flat or step == COARSE_PX:
        return
    for i in range(n_rows // step):
        for j in range(n_columns // step):
            if odd[i, j] >= _JUMP:
                v, u = i * step, j * step
                inverse[v, u + half] = inverse[v + half, u] = inverse[v + half, u + half] = inverse[v, u]


@njit(nogil=True, cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def find_inverse_depth(
    inverse: NDArray[np.float32],
    is_edge: NDArray[np.uint8],
    marched: NDArray[np.uint8],
    odd: NDArray[np.float32],
    rays: NDArray[np.float32],
    up_m: NDArray[np.float32],
    highest_m: NDArray[np.float32],
    levels: NDArray[np.int64],
    leaf_m: NDArray[np.float64],
    place: NDArray[np.float64],
    far_m: float,
    is_flat: bool,
    centre: NDArray[np.float64],
    ned_from_camera: NDArray[np.float64],
    f_px: float,
) -> None:
    """Fill `inverse` (rows, columns) float32 with 1 / depth [1/m]; 0 or less is sky.

    `inverse`, `marched` and `rays` (2, rows, columns) have a multiple of COARSE_PX rows and columns, and one more;
    `odd` has room for one entry for each square of 2 px; `is_edge`, one for each square of 4 px, becomes 1 where depths
    jump. The rest is Relief's and the camera's pose.
    """
    n_rows, n_columns = inverse.shape[0], inverse.shape[1]
    r = ned_from_camera
    north_m, east_m, height_m = centre[0], centre[1], -centre[2]
    fine = _FINE_PX / f_px
    is_edge[:, :] = 0
    if is_flat:
        per_height = 1.0 / max(0.01, height_m - place[3])
        for v in range(0, n_rows, COARSE_PX):
            for u in range(0, n_columns, COARSE_PX):
                inverse[v, u] = (r[2, 0] * rays[0, v, u] + r[2, 1] * rays[1, v, u] + r[2, 2]) * per_height
    else:
        marched[:, :] = 0
        for v in range(0, n_rows, COARSE_PX):
            for u in range(0, n_columns, COARSE_PX):
                x, y = rays[0, v, u], rays[1, v, u]
                inverse[v, u] = march(
                    up_m, highest_m, levels, leaf_m, place, far_m, north_m, east_m, height_m,
                    r[0, 0] * x + r[0, 1] * y + r[0, 2], r[1, 0] * x + r[1, 1] * y + r[1, 2],
                    -(r[2, 0] * x + r[2, 1] * y + r[2, 2]), 0.0, np.inf, fine,
                )  # fmt: skip
    step = COARSE_PX
    is_uneven = not is_flat
    while step > 1:
        half = step // 2
        threshold = np.inf
        if is_uneven:
            threshold = _mark_odd(inverse, marched, odd, is_edge, step)
            if step == COARSE_PX:
                _mark_busy(inverse, odd, rays, highest_m, levels, leaf_m, place, centre, r)
        _halve(inverse, odd, step, not is_uneven)
        is_uneven = threshold < np.inf
        if is_uneven:
            for i in range((n_rows - 1) // step):
                for j in range((n_columns - 1) // step):
                    if odd[i, j] < threshold:
                        continue
                    v, u = i * step, j * step
                    corners = inverse[v, u], inverse[v, u + step], inverse[v + step, u], inverse[v + step, u + step]
                    near, far, far_v, far_u = max(corners), corners[0], v, u
                    for k in range(1, 4):
                        if corners[k] < far:
                            far, far_v, far_u = corners[k], v + (k >> 1) * step, u + (k & 1) * step
                    fall = r[2, 0] * rays[0, far_v, far_u] + r[2, 1] * rays[1, far_v, far_u] + r[2, 2]
                    is_ground = far > 0.0 and fall > 1e-3
                    # Something near stands before something far: only what is near is looked for, and what it leaves
                    # free is as low as at the farthest corner.
                    from_m = (1.0 - _AROUND) / max(near, 1e-6)
                    to_m = (1.0 + _AROUND) / max(near, 1e-6)
                    if far * (1.0 + 2.0 * _AROUND) > near:
                        to_m = (1.0 + _AROUND) / far
                    if step == COARSE_PX:
                        from_m, to_m = 0.0, np.inf
                    for k in range(5):
                        vv = v + (half if k in (0, 1, 2) else (0 if k == 3 else step))
                        uu = u + (half if k in (0, 3, 4) else (0 if k == 1 else step))
                        if marched[vv, uu] == step:
                            continue
                        marched[vv, uu] = step
                        x, y = rays[0, vv, uu], rays[1, vv, uu]
                        found = march(
                            up_m, highest_m, levels, leaf_m, place, far_m, north_m, east_m, height_m,
                            r[0, 0] * x + r[0, 1] * y + r[0, 2], r[1, 0] * x + r[1, 1] * y + r[1, 2],
                            -(r[2, 0] * x + r[2, 1] * y + r[2, 2]), from_m, to_m, fine,
                        )  # fmt: skip
                        if found != NOTHING:
                            inverse[vv, uu] = found
                            continue
                        inverse[vv, uu] = far
                        level = far * (r[2, 0] * x + r[2, 1] * y + r[2, 2]) / fall
                        if is_ground and level > 1e-4:
                            place_n = north_m + (r[0, 0] * x + r[0, 1] * y + r[0, 2]) / level
                            place_e = east_m + (r[1, 0] * x + r[1, 1] * y + r[1, 2]) / level
                            if height_at(up_m, place, place_n, place_e) < height_m - fall / far + _BUSY_M:
                                inverse[vv, uu] = level
        step = half
