"""Distances on the map between places and the polylines of lines, roads and houses."""

import itertools
import math

import numpy as np
from numpy.typing import NDArray

from sitl.world.records import Building, PointNe


def distances_m(places: NDArray[np.float64], polyline: NDArray[np.float64]) -> NDArray[np.float64]:
    """The distances (n,) [m] of places (n, 2) to the nearest point of a polyline (m, 2), north and east [m]."""
    nearest = np.full(len(places), np.inf)
    for start, end in itertools.pairwise(polyline):
        step = end - start
        along = np.clip((places - start) @ step / max(float(step @ step), 1e-12), 0.0, 1.0)
        gap = places - start - along[:, None] * step
        np.minimum(nearest, np.hypot(gap[:, 0], gap[:, 1]), out=nearest)
    return nearest


def distances_to_building_m(places: NDArray[np.float64], building: Building) -> NDArray[np.float64]:
    """The distances (n,) [m] of places (n, 2) to a building's walls; 0 within them."""
    cos, sin = math.cos(building.heading_rad), math.sin(building.heading_rad)
    offset = places - np.array(building.centre_ne_m)
    along = np.abs(offset[:, 0] * cos + offset[:, 1] * sin) - 0.5 * building.length_m
    aside = np.abs(offset[:, 1] * cos - offset[:, 0] * sin) - 0.5 * building.width_m
    return np.asarray(np.hypot(np.maximum(along, 0.0), np.maximum(aside, 0.0)))


def corners(building: Building) -> list[PointNe]:
    """The four corners of a building."""
    cos, sin = math.cos(building.heading_rad), math.sin(building.heading_rad)
    (north, east), half_l, half_w = building.centre_ne_m, 0.5 * building.length_m, 0.5 * building.width_m
    return [
        (north + a * half_l * cos - b * half_w * sin, east + a * half_l * sin + b * half_w * cos)
        for a, b in ((1, 1), (1, -1), (-1, -1), (-1, 1))
    ]
