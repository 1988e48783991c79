"""The fence around a flight: where the vehicle may be, and whether it has left. Pure.

Everything is measured from the take-off point: north and east [m], height above it [m]. A point on the fence itself
is inside, as far as rounding tells.
"""

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

Point = tuple[float, float]
"""North and east of the take-off point [m]."""

_SAME_POINT_M = 0.01


@dataclass(frozen=True, slots=True)
class Fence:
    """A cylinder around the take-off point, and within it a polygon and a least height, where they are given.

    `polygon_ne_m` are the corners in order, the last is joined with the first; empty where there is none.
    `min_altitude_m` binds once the vehicle was above it, and until it is sent down to land.
    """

    max_distance_m: float
    max_altitude_m: float
    polygon_ne_m: tuple[Point, ...] = ()
    min_altitude_m: float | None = None


def breach(fence: Fence, north_m: float, east_m: float, altitude_m: float, *, is_min_in_force: bool) -> str | None:
    """How the fence is broken, as a sentence; None while the vehicle is inside.

    `is_min_in_force` says that the vehicle was above `min_altitude_m` in this flight, and is not on its way to land.
    """
    distance_m = math.hypot(north_m, east_m)
    if distance_m > fence.max_distance_m:
        return f"{distance_m:.0f} m from the take-off point, allowed are {fence.max_distance_m:g} m"
    if altitude_m > fence.max_altitude_m:
        return f"{altitude_m:.0f} m high, allowed are {fence.max_altitude_m:g} m"
    if fence.polygon_ne_m and not is_inside(fence.polygon_ne_m, north_m, east_m):
        return f"outside the fence's polygon, {north_m:.0f} m north and {east_m:.0f} m east of the take-off point"
    if is_min_in_force and fence.min_altitude_m is not None and altitude_m < fence.min_altitude_m:
        return f"{altitude_m:.1f} m high, at least {fence.min_altitude_m:g} m are required"
    return None


def is_inside(polygon: Sequence[Point], north_m: float, east_m: float) -> bool:
    """Whether a point lies within a polygon (even-odd rule)."""
    crossings = 0
    for (north_a, east_a), (north_b, east_b) in _edges(polygon):
        if (east_a > east_m) != (east_b > east_m):
            crossings += north_m < north_a + (east_m - east_a) / (east_b - east_a) * (north_b - north_a)
    return crossings % 2 == 1


def nearest_edge_m(polygon: Sequence[Point], north_m: float, east_m: float) -> float:
    """The distance from a point to the polygon's outline [m]."""
    return min(_distance_m((north_m, east_m), a, b) for a, b in _edges(polygon))


def polygon_fault(polygon: Sequence[Point]) -> str | None:
    """What makes a polygon unfit for a fence, in words; None where it is fit."""
    for number, (a, b) in enumerate(_edges(polygon), start=1):
        if math.dist(a, b) < _SAME_POINT_M:
            return f"corner {number} stands at the same place as the next"
    edges = list(_edges(polygon))
    for (i, one), (j, other) in itertools.combinations(enumerate(edges), 2):
        are_neighbours = j - i == 1 or (i == 0 and j == len(edges) - 1)
        if not are_neighbours and _do_cross(*one, *other):
            return f"its sides {i + 1} and {j + 1} cross"
        if are_neighbours and _do_fold_back(*one, *other):
            return f"its sides {i + 1} and {j + 1} lie on each other"
    return None if is_inside(polygon, 0.0, 0.0) else "the take-off point (0, 0) is not within it"


def _edges(polygon: Sequence[Point]) -> Iterator[tuple[Point, Point]]:
    return zip(polygon, [*polygon[1:], *polygon[:1]], strict=True)


def _side(a: Point, b: Point, point: Point) -> float:
    """Positive where the point lies to one side of the line from a to b, negative to the other [m2]."""
    return (b[0] - a[0]) * (point[1] - a[1]) - (b[1] - a[1]) * (point[0] - a[0])


def _do_cross(a: Point, b: Point, c: Point, d: Point) -> bool:
    """Whether the stretches ab and cd have a point in common."""
    if _side(a, b, c) * _side(a, b, d) < 0 and _side(c, d, a) * _side(c, d, b) < 0:
        return True
    touching = ((a, c, d), (b, c, d), (c, a, b), (d, a, b))
    return any(_distance_m(point, start, end) < _SAME_POINT_M for point, start, end in touching)


def _do_fold_back(a: Point, b: Point, c: Point, d: Point) -> bool:
    """Whether two stretches with a common end run back on each other."""
    if b == c:
        far_one, joint, far_other = a, b, d
    elif a == d:
        far_one, joint, far_other = b, a, c
    else:
        return False
    return (
        _distance_m(far_one, joint, far_other) < _SAME_POINT_M or _distance_m(far_other, joint, far_one) < _SAME_POINT_M
    )


def _distance_m(point: Point, a: Point, b: Point) -> float:
    """From a point to the stretch ab."""
    along_n, along_e = b[0] - a[0], b[1] - a[1]
    square = along_n * along_n + along_e * along_e
    share = 0.0 if square == 0 else ((point[0] - a[0]) * along_n + (point[1] - a[1]) * along_e) / square
    share = min(1.0, max(0.0, share))
    return math.hypot(point[0] - a[0] - share * along_n, point[1] - a[1] - share * along_e)
