"""The room between conductors and what is below them; and the figures of a line that people ask for."""

import itertools
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sitl.world.errors import WrongKey
from sitl.world.extent import distances_to_building_m
from sitl.world.height_grid import HeightGrid
from sitl.world.records import Building, PowerLine, Tree


def ground_clearance_m(points_ned_m: NDArray[np.float64], terrain: HeightGrid) -> NDArray[np.float64]:
    """How high points (n, 3) NED [m] are over the ground below them, (n,) [m]."""
    return -points_ned_m[:, 2] - terrain.at_all(points_ned_m[:, 0], points_ned_m[:, 1])


def check_clearances(
    lines: Sequence[PowerLine], terrain: HeightGrid, buildings: Sequence[Building], trees: Sequence[Tree]
) -> None:
    """Raise WrongKey where a conductor touches the ground, a building or a tree."""
    for i, line in enumerate(lines):
        for conductor in line.conductors:
            over_m = ground_clearance_m(conductor.points_ned_m, terrain)
            lowest = int(over_m.argmin())
            if over_m[lowest] <= 0.0:
                north_m, east_m = conductor.points_ned_m[lowest, :2]
                raise WrongKey(
                    f"lines.{i}.{'shield_wires' if conductor.is_shield else 'conductors'}",
                    f"a conductor touches the ground {north_m:.0f} m north and {east_m:.0f} m east of the start; "
                    "give it less sag or the line higher supports",
                )
        wires = np.concatenate([conductor.points_ned_m for conductor in line.conductors])
        for k, building in enumerate(buildings):
            below = wires[distances_to_building_m(wires[:, :2], building) == 0.0]
            top_m = terrain.at(*building.centre_ne_m) + building.ridge_m
            if len(below) and (-below[:, 2]).min() <= top_m:
                raise WrongKey(f"buildings.{k}", f"a conductor of line {i + 1} touches its roof; move or lower it")
        for k, tree in enumerate(trees):
            gaps_m = np.hypot(wires[:, 0] - tree.north_m, wires[:, 1] - tree.east_m)
            top_m = terrain.at(tree.north_m, tree.east_m) + tree.height_m
            near = gaps_m <= tree.crown_radius_m
            if near.any() and (-wires[near, 2]).min() <= top_m:
                raise WrongKey(f"trees.{k}", f"a conductor of line {i + 1} touches it; move it or make it lower")


def least_clearance_m(line: PowerLine, terrain: HeightGrid) -> float:
    """How high the lowest conductor of a line is over the ground, at its lowest [m]."""
    return min(float(ground_clearance_m(wire.points_ned_m, terrain).min()) for wire in line.conductors)


def spans_m(line: PowerLine) -> list[float]:
    """The lengths of a line's spans on the map [m], missing ones included."""
    bases = [support.base_ned_m for support in line.supports]
    return [math.dist(here[:2], there[:2]) for here, there in itertools.pairwise(bases)]
