"""The height of whatever one would touch first from above: terrain, trees, roofs."""

from sitl.world.height_grid import HeightGrid
from sitl.world.records import World


def surface_of(world: World) -> HeightGrid:
    """Heights [m] of terrain, crowns and roofs over the world's bounds."""
    return world.terrain
