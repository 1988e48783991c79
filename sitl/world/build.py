"""Builds the world that a checked world file describes."""

import math
from collections.abc import Iterable
from pathlib import Path

from sitl.place import Origin
from sitl.world.clearance import check_clearances
from sitl.world.extent import corners
from sitl.world.houses import build_row, ridge_m
from sitl.world.light import LIGHTS, LightName
from sitl.world.lines import build_line
from sitl.world.models import BuildingModel, StripModel, TreeModel, WorldModel
from sitl.world.records import Building, Ground, PointNe, Strip, StripKind, Tree, World
from sitl.world.route import stands
from sitl.world.scatter import crown_radius_m, scatter_trees
from sitl.world.terrain import build_terrain

_WIDTH_M: dict[StripKind, float] = {
    "road": 5.0,
    "track": 2.6,
    "railway": 4.0,
    "river": 8.0,
    "fence": 0.12,
    "hedge": 1.2,
}


def build_world(name: str, model: WorldModel, folder: Path, light: LightName | None) -> World:
    """Build a world; `folder` is the file's own, and `light` takes the place of the file's.

    Raises WrongKey where the file asks for what cannot be, as a conductor that touches the ground.
    """
    origin = Origin(
        math.radians(model.origin.latitude_deg), math.radians(model.origin.longitude_deg), model.origin.altitude_m
    )
    start_yaw_rad = math.remainder(math.radians(model.start_yaw_deg), 2.0 * math.pi)
    laid = [stands(line, f"lines.{i}", start_yaw_rad) for i, line in enumerate(model.lines)]
    strips = tuple(_strip(strip) for strip in model.strips)
    buildings = [_building(building) for building in model.buildings]
    trees = [_tree(tree) for tree in model.trees]
    places = [stand.place_ne_m for line in laid for stand in line]
    terrain = build_terrain(model.terrain, [*places, *_places(strips, buildings, trees)], origin, folder)
    lines = tuple(
        build_line(line, on_level, terrain, f"lines.{i}")
        for i, (line, on_level) in enumerate(zip(model.lines, laid, strict=True))
    )
    check_clearances(lines, terrain, buildings, trees)
    for row in model.house_rows:
        buildings += build_row(row, strips, lines, buildings)
    for scatter in model.scattered_trees:
        trees += scatter_trees(scatter, terrain.bounds_ne_m, lines, strips, buildings)
    return World(
        name=name,
        origin=origin,
        start_yaw_rad=start_yaw_rad,
        lines=lines,
        terrain=terrain,
        ground=Ground(model.ground.style, model.ground.seed),
        strips=strips,
        buildings=tuple(buildings),
        trees=tuple(trees),
        light=LIGHTS[light or model.light],
    )


def _strip(model: StripModel) -> Strip:
    return Strip(model.kind, tuple(model.points_ne_m), model.width_m or _WIDTH_M[model.kind])


def _building(model: BuildingModel) -> Building:
    top_m = model.ridge_m if model.ridge_m is not None else ridge_m(model.roof, model.eaves_m, model.width_m)
    return Building(
        model.centre_ne_m,
        math.remainder(math.radians(model.heading_deg), 2.0 * math.pi),
        model.length_m,
        model.width_m,
        model.eaves_m,
        top_m,
        model.roof,
    )


def _tree(model: TreeModel) -> Tree:
    radius_m = model.crown_radius_m or crown_radius_m(model.kind, model.height_m)
    return Tree(model.kind, *model.place_ne_m, model.height_m, radius_m)


def _places(strips: Iterable[Strip], buildings: Iterable[Building], trees: Iterable[Tree]) -> list[PointNe]:
    """Where things stand that the terrain must reach beyond."""
    return [
        *(point for strip in strips for point in strip.points_ne_m),
        *(corner for building in buildings for corner in corners(building)),
        *((tree.north_m, tree.east_m) for tree in trees),
    ]
