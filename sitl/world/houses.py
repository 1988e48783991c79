"""Rows of houses along a road, the same for the same seed."""

import itertools
import math
from collections.abc import Sequence

import numpy as np

from sitl.world.extent import corners, distances_m, distances_to_building_m
from sitl.world.models import HouseRowModel
from sitl.world.records import Building, PointNe, PowerLine, Roof, Strip
from sitl.world.scatter import half_width_m

_SLOPE_RAD: dict[Roof, float] = {"tile": math.radians(35.0), "metal": math.radians(16.0), "flat": 0.0}
_START_ROOM_M, _LINE_ROOM_M, _ROOM_M = 10.0, 5.5, 2.0


def ridge_m(roof: Roof, eaves_m: float, width_m: float) -> float:
    """The height of the ridge [m] that such a roof has over a house of that width."""
    return eaves_m + 0.5 * width_m * math.tan(_SLOPE_RAD[roof])


def build_row(
    row: HouseRowModel,
    strips: Sequence[Strip],
    lines: Sequence[PowerLine],
    standing: Sequence[Building],
) -> list[Building]:
    """The houses of one row, with gaps where one would stand in the way of another, a road, a line or the start."""
    road = strips[row.strip - 1]
    others = [strip for strip in strips if strip is not road]
    rng = np.random.default_rng(row.seed)
    length_m = sum(math.dist(a, b) for a, b in itertools.pairwise(road.points_ne_m))
    houses: list[Building] = []
    for side in {"left": (-1.0,), "right": (1.0,), "both": (-1.0, 1.0)}[row.side]:
        along_m = row.from_m + rng.uniform(0.2, 0.6) * row.every_m
        while along_m < min(length_m, row.to_m or length_m):
            place, heading_rad = _place_at(road.points_ne_m, along_m)
            house_m, width_m = rng.uniform(9.0, 14.0), rng.uniform(7.0, 9.5)
            aside_m = side * (0.5 * road.width_m + row.setback_m + rng.uniform(0.0, 2.0) + 0.5 * width_m)
            eaves_m = rng.uniform(2.8, 5.2)
            roof = row.roofs[int(rng.integers(len(row.roofs)))]
            house = Building(
                (place[0] - aside_m * math.sin(heading_rad), place[1] + aside_m * math.cos(heading_rad)),
                heading_rad, house_m, width_m, eaves_m, ridge_m(roof, eaves_m, width_m), roof,
            )  # fmt: skip
            if _is_free(house, others, lines, [*standing, *houses]):
                houses.append(house)
            along_m += max(house_m + _ROOM_M, row.every_m * rng.uniform(0.85, 1.2))
    return houses


def _place_at(points: Sequence[PointNe], along_m: float) -> tuple[PointNe, float]:
    """The place [m] on a polyline after `along_m`, and its heading there [rad]."""
    for start, end in itertools.pairwise(points):
        step_m = math.dist(start, end)
        heading_rad = math.atan2(end[1] - start[1], end[0] - start[0])
        if along_m <= step_m:
            break
        along_m -= step_m
    return (start[0] + along_m * math.cos(heading_rad), start[1] + along_m * math.sin(heading_rad)), heading_rad


def _is_free(
    house: Building, strips: Sequence[Strip], lines: Sequence[PowerLine], standing: Sequence[Building]
) -> bool:
    outline = np.array([*_outline(house), house.centre_ne_m])
    if np.hypot(*outline.T).min() < _START_ROOM_M:
        return False
    if any(distances_m(outline, np.array(s.points_ne_m)).min() < 0.5 * s.width_m + _ROOM_M for s in strips):
        return False
    for line in lines:
        if distances_m(outline, np.array(line.axis_ne_m)).min() < half_width_m(line) + _LINE_ROOM_M:
            return False
    return all(
        distances_to_building_m(outline, other).min() >= _ROOM_M
        and distances_to_building_m(np.array([*_outline(other), other.centre_ne_m]), house).min() >= _ROOM_M
        for other in standing
    )


def _outline(house: Building) -> list[PointNe]:
    """The corners, and the middles of the walls."""
    at = corners(house)
    return [*at, *(((a[0] + b[0]) / 2.0, (a[1] + b[1]) / 2.0) for a, b in itertools.pairwise([*at, at[0]]))]
