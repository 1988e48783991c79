"""A surface made ready for rays: how far one goes until it meets terrain, a crown or a roof."""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np
from numba import njit
from numpy.typing import NDArray

from sitl.world.height_grid import HeightGrid

_LEAF_M = 1.0
_MOST_LEVELS = 7
_FARTHEST_M = 1200.0  # beyond, the world is a plane
NOTHING = -1e30
_NEAREST_M = 0.05


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
def fold(i: int, n: int) -> int:
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
    between `from_m` and `to_m` [m] are looked at; NOTHING where the ray meets nothing there. What is smaller than the
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
        tallest = highest_m[levels[level, 0] + fold(i, n_rows) * n_columns + fold(j, n_columns)]
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
        return NOTHING
    if end < farthest and du < 0.0:
        return 1.0 / max(_NEAREST_M, end)
    return min(level_ground, 1.0 / farthest)
