"""How far a point is from capsules and convex solids that are sorted into the cells of a map.

A capsule is a tapering round bar. A solid is a profile, a chain of corners (distance from the axis, height) that closes
along the axis, either spun around a vertical axis (a tree's crown) or drawn out along a level one (a house). For both
the distance in space follows exactly from that to the profile in its half-plane.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

N_KINDS = 4
"""Conductor, support, tree, building: the order of the distances."""


@njit(nogil=True, cache=True)  # type: ignore[untyped-decorator]
def capsule_distance_m(north: float, east: float, up: float, bar: NDArray[np.float64]) -> float:
    """From a point [m] to the surface of a bar (start north, east, up, end north, east, up, start and end radius)."""
    dn, de, du = bar[3] - bar[0], bar[4] - bar[1], bar[5] - bar[2]
    pn, pe, pu = north - bar[0], east - bar[1], up - bar[2]
    length2 = dn * dn + de * de + du * du
    t: float = min(max((pn * dn + pe * de + pu * du) / max(length2, 1e-12), 0.0), 1.0)
    rn, re, ru = pn - t * dn, pe - t * de, pu - t * du
    distance_m: float = math.sqrt(rn * rn + re * re + ru * ru) - bar[6] - t * (bar[7] - bar[6])
    return max(distance_m, 0.0)


@njit(nogil=True, cache=True)  # type: ignore[untyped-decorator]
def profile_distance_m(across: float, up: float, corners: NDArray[np.float64]) -> float:
    """From a point (across >= 0, up) [m] to a convex profile (n, 2), from the axis' foot outwards to its top."""
    best2 = np.inf
    is_inside = True
    for i in range(len(corners) - 1):
        a0, a1 = corners[i, 0], corners[i, 1]
        d0, d1 = corners[i + 1, 0] - a0, corners[i + 1, 1] - a1
        p0, p1 = across - a0, up - a1
        length2 = d0 * d0 + d1 * d1
        if length2 == 0.0:
            continue
        if d0 * p1 - d1 * p0 < 0.0:  # right of a side that has the body on its left
            is_inside = False
        t = min(max((p0 * d0 + p1 * d1) / length2, 0.0), 1.0)
        r0, r1 = p0 - t * d0, p1 - t * d1
        best2 = min(best2, r0 * r0 + r1 * r1)
    return 0.0 if is_inside else math.sqrt(best2)


@njit(nogil=True, cache=True)  # type: ignore[untyped-decorator]
def solid_distance_m(
    north: float, east: float, up: float, solid: NDArray[np.float64], corners: NDArray[np.float64]
) -> float:
    """From a point [m] to a solid (centre north, east, heading's cosine, sine, half its length; below 0: spun)."""
    pn, pe = north - solid[0], east - solid[1]
    half_m = solid[4]
    if half_m < 0.0:
        across, beyond = math.sqrt(pn * pn + pe * pe), 0.0
    else:
        across = abs(pe * solid[2] - pn * solid[3])
        beyond = max(abs(pn * solid[2] + pe * solid[3]) - half_m, 0.0)
    inside: float = profile_distance_m(across, up, corners)
    return math.sqrt(beyond * beyond + inside * inside)


@njit(nogil=True, cache=True)  # type: ignore[untyped-decorator]
def nearest_m(
    point: tuple[float, float, float],
    reach_m: float,
    grid: tuple[float, float, float],
    cells: NDArray[np.int32],
    items: NDArray[np.int32],
    bars: NDArray[np.float64],
    bar_kinds: NDArray[np.int8],
    solids: NDArray[np.float64],
    solid_kinds: NDArray[np.int8],
    corners: NDArray[np.float64],
) -> tuple[float, float, float, float]:
    """The least distance [m] of a point (north, east, up) to each of the kinds; inf from `reach_m` on.

    `grid` is south, west and the cell's edge [m]; `cells` (rows, columns, 2) says which part of `items` lies in each.
    An item below len(bars) is a bar, the others solids. Goes outwards ring by ring, and ends where nothing nearer than
    what is found can be.
    """
    north, east, up = point
    south_m, west_m, cell_m = grid
    rows, columns = cells.shape[0], cells.shape[1]
    row, column = math.floor((north - south_m) / cell_m), math.floor((east - west_m) / cell_m)
    best = np.full(N_KINDS, reach_m)
    for ring in range(math.ceil(reach_m / cell_m) + 1):
        # What stands in ring n alone is at least n - 1 cells away, wherever in its cell the point is.
        if (ring - 1) * cell_m > best.max():
            break
        for i in range(max(row - ring, 0), min(row + ring, rows - 1) + 1):
            step = 1 if abs(i - row) == ring else 2 * ring
            for j in range(column - ring, column + ring + 1, max(step, 1)):
                if j < 0 or j >= columns:
                    continue
                for k in range(cells[i, j, 0], cells[i, j, 1]):
                    item = items[k]
                    if item < len(bars):
                        kind = bar_kinds[item]
                        if (ring - 1) * cell_m > best[kind]:
                            continue
                        distance_m = capsule_distance_m(north, east, up, bars[item])
                    else:
                        item -= len(bars)
                        kind = solid_kinds[item]
                        solid = solids[item]
                        # The profile is looked at only where the cylinder around it is near enough.
                        away_m = math.sqrt((north - solid[0]) ** 2 + (east - solid[1]) ** 2) - solid[5]
                        if away_m >= best[kind]:
                            continue
                        chain = corners[int(solid[6]) : int(solid[7])]
                        distance_m = solid_distance_m(north, east, up, solid, chain)
                    if distance_m < best[kind]:
                        best[kind] = distance_m
    for kind in range(N_KINDS):
        if best[kind] >= reach_m:
            best[kind] = np.inf
    return best[0], best[1], best[2], best[3]
