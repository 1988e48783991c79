"""The height of whatever one would touch first from above: terrain, trees, hedges, roofs."""

import functools
import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from sitl.world.height_grid import HeightGrid
from sitl.world.records import Building, Strip, Tree, TreeKind, World

CELL_M = 0.25
HEDGE_HEIGHT_M = 1.7
EAVES_SLOPE_M = 0.25
"""A wall is this wide in the grid, outside the house: a grid of heights cannot stand upright."""
_MOST_NODES = 16_000_000
_KINDS: dict[TreeKind, int] = {"broadleaf": 0, "conifer": 1, "poplar": 2, "bush": 3}


def surface_of(world: World) -> HeightGrid:
    """Heights [m] of terrain, crowns, hedges and roofs over the world's bounds, on a grid of `CELL_M` or coarser.

    The same world gives the same surface; where nothing stands on level ground it is the terrain's own grid.
    """
    if not world.trees and not world.buildings and not any(s.kind == "hedge" for s in world.strips):
        return world.terrain
    return _build(world.terrain, world.trees, world.buildings, world.strips)


@functools.lru_cache(maxsize=4)
def _build(
    terrain: HeightGrid, trees: tuple[Tree, ...], buildings: tuple[Building, ...], strips: tuple[Strip, ...]
) -> HeightGrid:
    rows, columns = terrain.up_m.shape
    finest = math.sqrt((rows - 1) * (columns - 1) * terrain.cell_m**2 / _MOST_NODES)
    n_parts = max(1, int(terrain.cell_m / max(CELL_M, finest)))
    cell_m = terrain.cell_m / n_parts
    up_m = refine(terrain.up_m, n_parts)
    place = np.array([terrain.south_m, terrain.west_m, cell_m])
    raise_hedges(up_m, up_m.copy(), place, hedge_rows(strips))
    for building in buildings:
        north_m, east_m = building.centre_ne_m
        raise_roof(up_m, place, building_row(building), terrain.at(north_m, east_m))
    feet = np.array([terrain.at(tree.north_m, tree.east_m) for tree in trees])
    raise_crowns(up_m, place, tree_rows(trees), feet)
    return HeightGrid(terrain.south_m, terrain.west_m, cell_m, up_m)


def refine(up_m: NDArray[np.float32], n_parts: int) -> NDArray[np.float32]:
    """The same heights on a grid with `n_parts` cells for each one, by linear interpolation."""
    if n_parts == 1:
        return up_m.copy()
    rows, columns = ((n - 1) * n_parts + 1 for n in up_m.shape)
    y, x = (np.arange(n, dtype=np.float32) / n_parts for n in (rows, columns))
    along = np.stack([np.interp(x, np.arange(up_m.shape[1]), line) for line in up_m])
    i = np.minimum(y.astype(int), up_m.shape[0] - 2)
    part = (y - i)[:, None]
    return np.asarray(along[i] * (1 - part) + along[i + 1] * part, dtype=np.float32)


def tree_rows(trees: tuple[Tree, ...]) -> NDArray[np.float64]:
    """Trees as the kernels take them: (n, 5) of north, east, height, crown radius [m] and kind, the lowest first."""
    rows = [(t.north_m, t.east_m, t.height_m, t.crown_radius_m, _KINDS[t.kind]) for t in trees]
    return np.array(rows, dtype=np.float64).reshape(-1, 5)


def building_row(building: Building) -> NDArray[np.float64]:
    """A building as the kernels take it, (8,).

    Centre north and east [m], cosine and sine of its heading, half length, half width, eaves and ridge [m].
    """
    return np.array(
        [
            *building.centre_ne_m,
            math.cos(building.heading_rad),
            math.sin(building.heading_rad),
            building.length_m / 2.0,
            building.width_m / 2.0,
            building.eaves_m,
            building.ridge_m,
        ]
    )


def hedge_rows(strips: tuple[Strip, ...]) -> NDArray[np.float64]:
    """The straight pieces of all hedges: (n, 5) of both ends' north and east and the width [m]."""
    rows = [
        (*start, *end, strip.width_m)
        for strip in strips
        if strip.kind == "hedge"
        for start, end in zip(strip.points_ne_m[:-1], strip.points_ne_m[1:], strict=True)
    ]
    return np.array(rows, dtype=np.float64).reshape(-1, 5)


@njit(nogil=True, cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def lattice(i: int, j: int) -> float:
    """A number 0 to 1 that belongs to a lattice point and looks random (an integer hash)."""
    h = (i * 374761393 + j * 668265263 + 1442695) & 0xFFFFFFFF
    h = ((h ^ (h >> 13)) * 1274126177) & 0xFFFFFFFF
    h = ((h ^ (h >> 16)) * 2246822519) & 0xFFFFFFFF
    return ((h ^ (h >> 15)) & 0xFFFFFF) / 16777215.0


@njit(nogil=True, cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def bumps(x: float, y: float) -> float:
    """Smooth noise of one octave over the plane, 0 to 1, with a lattice of unit cells."""
    i, j = math.floor(x), math.floor(y)
    u, v = x - i, y - j
    u, v = u * u * (3.0 - 2.0 * u), v * v * (3.0 - 2.0 * v)
    low = lattice(i, j) * (1.0 - v) + lattice(i, j + 1) * v
    high = lattice(i + 1, j) * (1.0 - v) + lattice(i + 1, j + 1) * v
    return float(low * (1.0 - u) + high * u)


@njit(nogil=True, cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def crown_up_m(dn: float, de: float, height_m: float, radius_m: float, kind: int, salt: float) -> float:
    """How high a crown stands [m] over the foot of its tree at (`dn`, `de`) [m] from the trunk; 0 outside.

    `salt` is any number that belongs to the tree, so that no two are alike.
    """
    r = math.sqrt(dn * dn + de * de) / radius_m
    if r >= 1.15:
        return 0.0
    if kind == 1:  # a conifer's boughs radiate
        turn = math.atan2(de, dn)
        boughs = bumps(turn * 4.0 + salt * 7.0 + 40.0, 3.0 * r + salt)
        r /= 0.8 + 0.35 * boughs
        if r >= 1.0:
            return 0.0
        return float(height_m * (1.0 - 0.88 * r) * (0.93 + 0.14 * bumps(dn * 2.5 + salt, de * 2.5)))
    ragged = bumps(dn * 1.1 + salt * 3.0, de * 1.1 - salt)
    r /= 0.78 + 0.37 * ragged
    if r >= 1.0:
        return 0.0
    dome = math.sqrt(1.0 - r * r * r)
    clumps = bumps(dn * 0.9 + salt, de * 0.9) + 0.6 * bumps(dn * 2.1, de * 2.1 + salt) - 0.8
    if kind == 0:
        return float(height_m * (0.2 + 0.8 * dome) + clumps * min(1.6, 0.5 * radius_m) * dome)
    if kind == 2:
        return float(height_m * (0.15 + 0.85 * dome) + 0.8 * clumps * dome)
    return float(max(0.1, height_m * dome * (1.0 + 0.4 * clumps)))


@njit(nogil=True, cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def raise_crowns(
    up_m: NDArray[np.float32], place: NDArray[np.float64], trees: NDArray[np.float64], feet_m: NDArray[np.float64]
) -> None:
    """Raise the surface to the crowns of `trees` (tree_rows) whose feet stand at `feet_m` (n,) [m].

    `place` is (south, west, cell) [m] of the grid's first node.
    """
    rows, columns = up_m.shape
    cell_m = place[2]
    for k in range(trees.shape[0]):
        reach_m = 1.15 * trees[k, 3]
        salt = 100.0 * lattice(int(8.0 * trees[k, 0]), int(8.0 * trees[k, 1]))
        first_row = max(0, math.ceil((trees[k, 0] - reach_m - place[0]) / cell_m))
        last_row = min(rows - 1, math.floor((trees[k, 0] + reach_m - place[0]) / cell_m))
        first_column = max(0, math.ceil((trees[k, 1] - reach_m - place[1]) / cell_m))
        last_column = min(columns - 1, math.floor((trees[k, 1] + reach_m - place[1]) / cell_m))
        for i in range(first_row, last_row + 1):
            dn = place[0] + i * cell_m - trees[k, 0]
            for j in range(first_column, last_column + 1):
                de = place[1] + j * cell_m - trees[k, 1]
                crown = crown_up_m(dn, de, trees[k, 2], trees[k, 3], int(trees[k, 4]), salt)
                if crown > 0.0:
                    up_m[i, j] = max(up_m[i, j], np.float32(feet_m[k] + crown))


@njit(nogil=True, cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def raise_roof(
    up_m: NDArray[np.float32], place: NDArray[np.float64], house: NDArray[np.float64], foot_m: float
) -> None:
    """Raise the surface to a roof over walls; `house` is building_row's, `foot_m` the ground at its centre."""
    rows, columns = up_m.shape
    north_m, east_m, c, s, half_length, half_width = house[0], house[1], house[2], house[3], house[4], house[5]
    reach_m = math.hypot(half_length, half_width) + EAVES_SLOPE_M
    cell_m = place[2]
    slope_m = max(EAVES_SLOPE_M, cell_m)
    for i in range(
        max(0, math.ceil((north_m - reach_m - place[0]) / cell_m)),
        min(rows - 1, math.floor((north_m + reach_m - place[0]) / cell_m)) + 1,
    ):
        for j in range(
            max(0, math.ceil((east_m - reach_m - place[1]) / cell_m)),
            min(columns - 1, math.floor((east_m + reach_m - place[1]) / cell_m)) + 1,
        ):
            dn, de = place[0] + i * cell_m - north_m, place[1] + j * cell_m - east_m
            along, across = abs(c * dn + s * de), abs(c * de - s * dn)
            outside_m = max(along - half_length, across - half_width)
            if outside_m >= slope_m:
                continue
            roof = foot_m + house[6] + (house[7] - house[6]) * max(0.0, 1.0 - across / half_width)
            if outside_m > 0.0:
                roof += (up_m[i, j] - roof) * outside_m / slope_m
            up_m[i, j] = max(up_m[i, j], np.float32(roof))


@njit(nogil=True, cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def raise_hedges(
    up_m: NDArray[np.float32], ground_m: NDArray[np.float32], place: NDArray[np.float64], hedges: NDArray[np.float64]
) -> None:
    """Raise the surface to `hedges` (hedge_rows), which stand on `ground_m` (the same grid, without them)."""
    rows, columns = up_m.shape
    cell_m = place[2]
    for k in range(hedges.shape[0]):
        n0, e0, n1, e1, half = hedges[k, 0], hedges[k, 1], hedges[k, 2], hedges[k, 3], 0.5 * hedges[k, 4]
        square = max(1e-9, (n1 - n0) ** 2 + (e1 - e0) ** 2)
        for i in range(
            max(0, math.ceil((min(n0, n1) - half - place[0]) / cell_m)),
            min(rows - 1, math.floor((max(n0, n1) + half - place[0]) / cell_m)) + 1,
        ):
            north_m = place[0] + i * cell_m
            for j in range(
                max(0, math.ceil((min(e0, e1) - half - place[1]) / cell_m)),
                min(columns - 1, math.floor((max(e0, e1) + half - place[1]) / cell_m)) + 1,
            ):
                east_m = place[1] + j * cell_m
                t = min(1.0, max(0.0, ((north_m - n0) * (n1 - n0) + (east_m - e0) * (e1 - e0)) / square))
                away_m = math.hypot(north_m - n0 - t * (n1 - n0), east_m - e0 - t * (e1 - e0))
                r = away_m / half / (0.8 + 0.3 * bumps(north_m * 1.3, east_m * 1.3))
                if r < 1.0:
                    top = HEDGE_HEIGHT_M * math.sqrt(1.0 - r**4) * (0.8 + 0.35 * bumps(north_m * 1.9, east_m * 1.9))
                    up_m[i, j] = max(up_m[i, j], np.float32(ground_m[i, j] + top))
