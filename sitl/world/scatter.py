"""Strews trees over the world, the same for the same seed."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sitl.world.extent import distances_m, distances_to_building_m
from sitl.world.models import ScatterModel
from sitl.world.records import Building, PowerLine, Strip, Tree, TreeKind

_HEIGHTS_M: dict[TreeKind, tuple[float, float]] = {
    "broadleaf": (6.0, 16.0),
    "conifer": (8.0, 22.0),
    "poplar": (12.0, 22.0),
    "bush": (0.8, 2.5),
}
_RADIUS_PER_HEIGHT: dict[TreeKind, float] = {"broadleaf": 0.32, "conifer": 0.16, "poplar": 0.11, "bush": 0.6}
_ROOM_M = 1.0  # to walls and to what runs over the ground


def crown_radius_m(kind: TreeKind, height_m: float) -> float:
    """The crown that a tree of this kind and height [m] has."""
    return _RADIUS_PER_HEIGHT[kind] * height_m


def scatter_trees(
    model: ScatterModel,
    bounds_ne_m: tuple[float, float, float, float],
    lines: Sequence[PowerLine],
    strips: Sequence[Strip],
    buildings: Sequence[Building],
) -> tuple[Tree, ...]:
    """Trees over `bounds_ne_m` (south, west, north, east), or the model's area, except where they must not stand."""
    south, west, north, east = bounds_ne_m
    if model.area is not None:
        south, west = max(south, model.area.south_m), max(west, model.area.west_m)
        north, east = min(north, model.area.north_m), min(east, model.area.east_m)
    rng = np.random.default_rng(model.seed)
    places = _places(rng, (south, west, north, east), 100.0 / math.sqrt(model.density_per_ha))
    n = len(places)
    kinds = rng.integers(len(model.kinds), size=n)
    shares, widths = rng.random(n), rng.uniform(0.85, 1.2, n)
    ranges = np.array([model.height_m or _HEIGHTS_M[kind] for kind in model.kinds])[kinds]
    heights_m = ranges[:, 0] + shares * (ranges[:, 1] - ranges[:, 0])
    radii_m = heights_m * np.array([_RADIUS_PER_HEIGHT[kind] for kind in model.kinds])[kinds] * widths

    is_free = np.hypot(places[:, 0], places[:, 1]) > model.keep_start_clear_m + radii_m
    for line in lines:
        half_m = half_width_m(line)
        is_free &= distances_m(places, np.array(line.axis_ne_m)) > half_m + model.keep_clear_m + radii_m
    for strip in strips:
        is_free &= distances_m(places, np.array(strip.points_ne_m)) > 0.5 * strip.width_m + 0.5 * radii_m + _ROOM_M
    for building in buildings:
        is_free &= distances_to_building_m(places, building) > radii_m + _ROOM_M
    return tuple(
        Tree(model.kinds[kind], float(place[0]), float(place[1]), float(height_m), float(radius_m))
        for place, kind, height_m, radius_m in zip(
            places[is_free], kinds[is_free], heights_m[is_free], radii_m[is_free], strict=True
        )
    )


def half_width_m(line: PowerLine) -> float:
    """How far the outermost wire lies from the line's axis, at most [m]."""
    axis = np.array(line.axis_ne_m)
    return max(float(distances_m(wire.points_ned_m[::8, :2], axis).max()) for wire in line.conductors)


def _places(
    rng: np.random.Generator, bounds_ne_m: tuple[float, float, float, float], cell_m: float
) -> NDArray[np.float64]:
    """One place (n, 2) anywhere in each cell of a grid: as uneven as a wood, but neither heaped nor bare."""
    south, west, north, east = bounds_ne_m
    if north <= south or east <= west:
        return np.empty((0, 2))
    rows, columns = (max(1, round((north - south) / cell_m)), max(1, round((east - west) / cell_m)))
    i, j = np.divmod(np.arange(rows * columns), columns)
    shift = rng.random((rows * columns, 2))
    return np.column_stack(
        [south + (i + shift[:, 0]) * (north - south) / rows, west + (j + shift[:, 1]) * (east - west) / columns]
    )
