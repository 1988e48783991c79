"""How far each pixel sees: rays marched against the surface on a coarse grid, finer where depths disagree."""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np
from numba import njit
from numpy.typing import NDArray

from sitl.world.height_grid import HeightGrid

COARSE_PX = 16
_LEAF_M = 1.0
_MOST_LEVELS = 7
_FARTHEST_M = 1200.0  # beyond, the world is a plane
# What part of the inverse depth two neighbours may disagree by, beyond what a smooth surface explains, before rays
# are marched between them: the smallest for which a frame's rays suffice.
_TOLERANCES = (0.02, 0.04, 0.08, 0.16, 0.32, 0.64, 0.9)
_JUMP = 0.08
_AROUND = 0.06  # of the depth: how far before and behind a thing's edge the thing may go on
_NOTHING = -1e30
_BUSY_M, _BUSY_FROM_M = 0.3, 250.0
_MOST_FINE = 0.013  # of a frame's pixels: how many rays it may spend on each finer grid
_NEAREST_M = 0.05
_FINE_PX = 2.7  # smaller things may be rough


@dataclass(frozen=True, slots=True, eq=False)
class Relief:
    """A surface with the largest heights of its parts, so that a ray can leap over what lies below it.

    `up_m` (rows, columns) float32 [m] are the surface's nodes. `highest_m` (n,) float32 holds the levels of a pyramid
    one after the other; `levels` (k, 3) int64 says where each starts and how many rows and columns it has. Its finest
    parts measure `leaf_m` (north, east). `place` (5,) float64: south, west and cell of the nodes, lowest and highest.
    `far_m` is the height of the plane that stands for everything far away.
    """

    up_m: NDArray[np.float32]
    highest_m: NDArray[np.float32]
    levels: NDArray[np.int64]
    leaf_m: NDArray[np.float64]
    place: NDArray[np.float64]
    far_m: float
    is_flat: bool

    @classmethod
    def of(cls, surface: HeightGrid) -> Self:
        """Build the pyramid over a surface."""
        up_m = surface.up_m
        extent_m = [(n - 1) * surface.cell_m for n in up_m.shape]
        n_levels = max(1, min(_MOST_LEVELS, int(math.log2(max(2.0, min(extent_m) / _LEAF_M / 2.0)))))
        unit = 1 << (n_levels - 1)
        leaves = [max(1, round(e / _LEAF_M / unit)) * unit for e in extent_m]
        leaf_m = np.array([e / n for e, n in zip(extent_m, leaves, strict=True)])
        level = highest_leaves(up_m, surface.cell_m, leaf_m, leaves[0], leaves[1])
        parts, rows, start = [], [], 0
        for k in range(n_levels):
            if k > 0:
                level = level.reshape(level.shape[0] // 2, 2, level.shape[1] // 2, 2).max(axis=(1, 3))
            rows.append((start, *level.shape))
            parts.append(level.ravel())
            start += level.size
        lowest, highest = float(up_m.min()), float(up_m.max())
        return cls(
            up_m,
            np.concatenate(parts),
            np.array(rows, dtype=np.int64),
            leaf_m,
            np.array([surface.south_m, surface.west_m, surface.cell_m, lowest, highest]),
            float(np.median(up_m)),
            lowest == highest,
        )


@njit(nogil=True, cache=True)  # type: ignore[untyped-decorator]
def highest_leaves(
    up_m: NDArray[np.float32], cell_m: float, leaf_m: NDArray[np.float64], n_rows: int, n_columns: int
) -> NDArray[np.float32]:
    """The largest height on or in each of `n_rows` x `n_columns` parts of the grid, (n_rows, n_columns) float32."""
    highest = np.full((n_rows, n_columns), -np.inf, dtype=np.float32)
    for i in range(n_rows):
        r0 = max(0, math.floor(i * leaf_m[0] / cell_m - 1e-6))
        r1 = min(up_m.shape[0] - 1, math.ceil((i + 1) * leaf_m[0] / cell_m + 1e-6))
        for j in range(n_columns):
            c0 = max(0, math.floor(j * leaf_m[1] / cell_m - 1e-6))
            c1 = min(up_m.shape[1] - 1, math.ceil((j + 1) * leaf_m[1] / cell_m + 1e-6))
            top = np.float32(-np.inf)
            for r in range(r0, r1 + 1):
                for c in range(c0, c1 + 1):
                    top = max(top, up_m[r, c])
            highest[i, j] = top
    return highest


@njit(nogil=True, cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def height_at(up_m: NDArray[np.float32], place: NDArray[np.float64], north_m: float, east_m: float) -> float:
    """The surface's height [m] at a place; beyond its bounds it is mirrored."""
    y, x = (north_m - place[0]) / place[2], (east_m - place[1]) / place[2]
    last_row, last_column = up_m.shape[0] - 1, up_m.shape[1] - 1
    if y < 0.0 or y >= last_row:
        y = abs(y) % (2.0 * last_row)
        y = min(y, 2.0 * last_row - y)
    if x < 0.0 or x >= last_column:
        x = abs(x) % (2.0 * last_column)
        x = min(x, 2.0 * last_column - x)
    i, j = min(int(y), last_row - 1), min(int(x), last_column - 1)
    v, u = y - i, x - j
    south = up_m[i, j] + u * (up_m[i, j + 1] - up_m[i, j])
    north = up_m[i + 1, j] + u * (up_m[i + 1, j + 1] - up_m[i + 1, j])
    return float(south + v * (north - south))


@njit(nogil=True, cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def _fold(i: int, n: int) -> int:
    """Mirror a part's index into 0 to n - 1."""
    if 0 <= i < n:
        return i
    i %= 2 * n
    return i if i < n else 2 * n - 1 - i


@njit(nogil=True, cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def march(
    up_m: NDArray[np.float32],
    highest_m: NDArray[np.float32],
    levels: NDArray[np.int64],
    leaf_m: NDArray[np.float64],
    place: NDArray[np.float64],
    far_m: float,
    north_m: float,
    east_m: float,
    height_m: float,
    dn: float,
    de: float,
    du: float,
    from_m: float,
    to_m: float,
    fine: float,
) -> float:
    """The inverse depth [1/m] at which a ray meets the surface; 0 or less where it meets the sky.

    The first arguments are Relief's. The ray starts at (`north_m`, `east_m`, `height_m`) and goes (`dn`, `de`, `du`)
    for each metre of depth. Where it meets nothing within a kilometre, it meets the plane at `far_m`. Only depths
    between `from_m` and `to_m` [m] are looked at; _NOTHING where the ray meets nothing there. What is smaller than the
    part `fine` of its depth may be taken for a box.
    """
    level_ground = -du / max(0.05, height_m - far_m)
    farthest = _FARTHEST_M / math.sqrt(dn * dn + de * de + du * du)
    z, end = max(_NEAREST_M, from_m), farthest
    if du < 0.0:
        z = max(z, (place[4] - height_m) / du)
        farthest += z
        end = min(farthest, (place[3] - 0.01 - height_m) / du)
    elif height_m > place[4] and du >= 0.0:
        return level_ground
    elif du > 0.0:
        end = min(end, (place[4] - height_m) / du)
    is_part = to_m < end
    end = min(end, to_m)
    a0, b0 = (north_m - place[0]) / leaf_m[0], (east_m - place[1]) / leaf_m[1]
    da, db = dn / leaf_m[0], de / leaf_m[1]
    per_a = 1.0 / da if abs(da) > 1e-9 else 1e9
    per_b = 1.0 / db if abs(db) > 1e-9 else 1e9
    ahead_a, ahead_b = (1 if da > 0.0 else 0), (1 if db > 0.0 else 0)
    horizontal = math.sqrt(dn * dn + de * de)
    top = levels.shape[0] - 1
    reach = horizontal * max(0.0, end - z)
    level = 0
    while level < top and reach > 2.0:
        reach *= 0.5
        level += 1
    nudge = 1e-4 / max(1e-3, abs(da) + abs(db))
    while z < end:
        i, j = math.floor(a0 + z * da) >> level, math.floor(b0 + z * db) >> level
        z_a, z_b = (((i + ahead_a) << level) - a0) * per_a, (((j + ahead_b) << level) - b0) * per_b
        out = min(end, max(min(z_a, z_b), z) + nudge)
        n_rows, n_columns = levels[level, 1], levels[level, 2]
        tallest = highest_m[levels[level, 0] + _fold(i, n_rows) * n_columns + _fold(j, n_columns)]
        if height_m + (out if du < 0.0 else z) * du > tallest:
            z = out
            level = min(level + 1, top)
            continue
        fine_m = fine * z
        if level > 0:
            if fine_m > leaf_m[0] * (1 << level):  # so far away, a part is a box
                return 1.0 / max(z, (tallest - height_m) / du if du < 0.0 else z)
            level -= 1
            continue
        if height_m + z * du > tallest:  # the ray comes down into this part only further on
            z = (tallest - height_m) / du
        n = 1 + int((out - z) * horizontal / max(fine_m, place[2]))
        step = (out - z) / n
        above = 1e-3
        for k in range(1, n + 1):
            high = z + k * step
            over = height_m + high * du - height_at(up_m, place, north_m + high * dn, east_m + high * de)
            if over <= 0.0:
                low = high - step
                if k == 1:
                    above = height_m + low * du - height_at(up_m, place, north_m + low * dn, east_m + low * de)
                for _ in range(3):  # regula falsi, with Illinois' halving
                    z = low + (high - low) * max(0.0, above) / max(1e-9, above - over)
                    rest = height_m + z * du - height_at(up_m, place, north_m + z * dn, east_m + z * de)
                    if abs(rest) < 2e-3:
                        break
                    if rest > 0.0:
                        low, above = z, rest
                        over *= 0.5
                    else:
                        high, over = z, rest
                        above *= 0.5
                return 1.0 / max(_NEAREST_M, z)
            above = over
        z = out
        level = min(1, top)
    if is_part:
        return _NOTHING
    if end < farthest and du < 0.0:
        return 1.0 / max(_NEAREST_M, end)
    return min(level_ground, 1.0 / farthest)


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
                    part = _fold(y_part, n_rows) * n_columns + _fold(x_part, n_columns)
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
                        if found != _NOTHING:
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
