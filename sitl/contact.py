"""What a vehicle must not touch, and how far away it is: wires, poles and towers, trees, houses."""

import itertools
import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from sitl.clearance_kernel import nearest_m
from sitl.world.records import Building, PointNed, Tree, TreeKind, World

REACH_M = 40.0
"""How far is looked by default; what is farther away counts as nothing."""

Thing = Literal["conductor", "support", "tree", "building"]
THINGS: tuple[Thing, ...] = ("conductor", "support", "tree", "building")

_CELL_M = 8.0
_ROUND_CORNERS = 9
# Where a crown begins at its trunk, and where it is widest, in shares of the tree's height: from there on upwards it is
# what one sees of it from above (sitl.world.surface), but for its clumps.
_CROWNS: dict[TreeKind, tuple[float, float]] = {
    "broadleaf": (0.25, 0.42),
    "conifer": (0.12, 0.12),
    "poplar": (0.1, 0.3),
    "bush": (0.0, 0.0),
}
_TRUNK_RADIUS = 0.015  # of the height
_BELOW_GROUND_M = 5.0  # houses go on below, so that a slope does not come out under them
_N_BAR_NUMBERS, _N_SOLID_NUMBERS = 8, 8


@dataclass(frozen=True, slots=True)
class Clearance:
    """Least distances [m] of a point from what stands in the world, 0 within it; inf where nothing is in reach.

    `other_m` is the nearer of trees and buildings.
    """

    conductor_m: float
    support_m: float
    tree_m: float
    building_m: float

    @property
    def other_m(self) -> float:
        """The distance from the nearest tree or building [m]."""
        return min(self.tree_m, self.building_m)

    @property
    def nearest(self) -> tuple[Thing, float]:
        """What is nearest, and how far [m]."""
        distances = (self.conductor_m, self.support_m, self.tree_m, self.building_m)
        least = min(range(len(distances)), key=distances.__getitem__)
        return THINGS[least], distances[least]


_NOTHING_NEAR = Clearance(math.inf, math.inf, math.inf, math.inf)


class Obstacles:
    """What stands in a world: conductors and members as round bars, crowns as solids of revolution, houses as prisms.

    The ground is not among them: a vehicle knows its own. A query takes microseconds.
    """

    def __init__(self, world: World) -> None:
        """Sort everything into the cells of a map."""
        bars: list[tuple[float, ...]] = []
        bar_kinds: list[int] = []
        for conductor in world.conductors:
            radius_m = conductor.diameter_m / 2
            for start, end in itertools.pairwise(conductor.points_ned_m.tolist()):
                bars.append(_bar(start, end, radius_m, radius_m))
                bar_kinds.append(THINGS.index("conductor"))
        for support in world.supports:
            for member in support.members:
                radii = (member.start_diameter_m / 2, member.end_diameter_m / 2)
                bars.append(_bar(member.start_ned_m, member.end_ned_m, *radii))
                bar_kinds.append(THINGS.index("support"))
        shapes: list[tuple[tuple[float, ...], list[tuple[float, float]], int]] = []
        for tree in world.trees:
            base_m = world.terrain.at(tree.north_m, tree.east_m)
            foot = (tree.north_m, tree.east_m, -base_m)
            top = (tree.north_m, tree.east_m, -base_m - 0.6 * tree.height_m)
            trunk_m = _TRUNK_RADIUS * tree.height_m
            bars.append(_bar(foot, top, trunk_m, trunk_m))
            bar_kinds.append(THINGS.index("tree"))
            crown = (tree.north_m, tree.east_m, 1.0, 0.0, -1.0, tree.crown_radius_m)
            shapes.append((crown, _crown_profile(tree, base_m), THINGS.index("tree")))
        for building in world.buildings:
            north_m, east_m = building.centre_ne_m
            heading = (math.cos(building.heading_rad), math.sin(building.heading_rad))
            around_m = math.hypot(building.length_m, building.width_m) / 2
            house = (north_m, east_m, *heading, building.length_m / 2, around_m)
            profile = _house_profile(building, world.terrain.at(north_m, east_m))
            shapes.append((house, profile, THINGS.index("building")))

        solids: list[tuple[float, ...]] = []
        corners: list[tuple[float, float]] = []
        for numbers, profile, _ in shapes:
            solids.append((*numbers, float(len(corners)), float(len(corners) + len(profile))))
            corners += profile
        self._bars = np.array(bars, dtype=np.float64).reshape(-1, _N_BAR_NUMBERS)
        self._bar_kinds = np.array(bar_kinds, dtype=np.int8)
        self._solids = np.array(solids, dtype=np.float64).reshape(-1, _N_SOLID_NUMBERS)
        self._solid_kinds = np.array([kind for _, _, kind in shapes], dtype=np.int8)
        self._corners = np.array(corners, dtype=np.float64).reshape(-1, 2)
        self._sort()
        self.clearance((0.0, 0.0, 0.0))  # compiled before the flight

    def clearance(self, position_ned_m: PointNed, reach_m: float = REACH_M) -> Clearance:
        """How far the point is from each kind of thing [m]; what is farther than `reach_m` is not seen."""
        if len(self._items) == 0:
            return _NOTHING_NEAR
        north_m, east_m, down_m = position_ned_m
        return Clearance(
            *nearest_m(
                (float(north_m), float(east_m), -float(down_m)),
                reach_m,
                self._grid,
                self._cells,
                self._items,
                self._bars,
                self._bar_kinds,
                self._solids,
                self._solid_kinds,
                self._corners,
            )
        )

    def _sort(self) -> None:
        """Fill the map's cells with what reaches into them."""
        bars, solids = self._bars, self._solids
        radius = np.maximum(bars[:, 6], bars[:, 7])
        around = solids[:, 5:6]
        south_west = np.concatenate([np.minimum(bars[:, 0:2], bars[:, 3:5]) - radius[:, None], solids[:, :2] - around])
        north_east = np.concatenate([np.maximum(bars[:, 0:2], bars[:, 3:5]) + radius[:, None], solids[:, :2] + around])
        if len(south_west) == 0:
            self._grid = (0.0, 0.0, _CELL_M)
            self._cells = np.zeros((1, 1, 2), dtype=np.int32)
            self._items = np.zeros(0, dtype=np.int32)
            return
        south_m, west_m = south_west.min(axis=0).tolist()
        self._grid = (south_m, west_m, _CELL_M)
        first = np.floor((south_west - (south_m, west_m)) / _CELL_M).astype(int)
        last = np.floor((north_east - (south_m, west_m)) / _CELL_M).astype(int)
        rows, columns = (last.max(axis=0) + 1).tolist()
        within: list[list[int]] = [[] for _ in range(rows * columns)]
        for item, ((i0, j0), (i1, j1)) in enumerate(zip(first.tolist(), last.tolist(), strict=True)):
            for i, j in itertools.product(range(i0, i1 + 1), range(j0, j1 + 1)):
                within[i * columns + j].append(item)
        ends = np.cumsum([len(cell) for cell in within])
        starts = ends - [len(cell) for cell in within]
        self._cells = np.stack([starts, ends], axis=1).astype(np.int32).reshape(rows, columns, 2)
        self._items = np.array(list(itertools.chain.from_iterable(within)), dtype=np.int32)


def _bar(start: PointNed | list[float], end: PointNed | list[float], *radii_m: float) -> tuple[float, ...]:
    return (start[0], start[1], -start[2], end[0], end[1], -end[2], *radii_m)


def _crown_profile(tree: Tree, ground_m: float) -> list[tuple[float, float]]:
    """A conifer's crown is a cone, the others' are domes over a blunt underside."""
    foot, widest = _CROWNS[tree.kind]
    foot_m, widest_m = ground_m + foot * tree.height_m, ground_m + widest * tree.height_m
    dome_m, radius_m = (1.0 - widest) * tree.height_m, tree.crown_radius_m
    angles = [0.0, math.pi / 2] if tree.kind == "conifer" else np.linspace(0.0, math.pi / 2, _ROUND_CORNERS).tolist()
    return [(0.0, foot_m), *((radius_m * math.cos(a), widest_m + dome_m * math.sin(a)) for a in angles)]


def _house_profile(building: Building, ground_m: float) -> list[tuple[float, float]]:
    """Half a house seen along its ridge."""
    half_m, foot_m = building.width_m / 2, ground_m - _BELOW_GROUND_M
    return [
        (0.0, foot_m),
        (half_m, foot_m),
        (half_m, ground_m + building.eaves_m),
        (0.0, ground_m + building.ridge_m),
    ]
