"""A map of the world: the ground and the line seen from straight above, for pictures of a flight."""

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from drivers.camera.camera import Intrinsics
from sitl.pose import Pose
from sitl.render.exposure import SUNNY_S, Exposure
from sitl.render.renderer import Renderer
from sitl.render.sensor import Optics
from sitl.world.records import World

_ABOVE_M = 20_000.0  # from so high, a pole 10 m tall leans by less than a centimetre for each 20 m off the centre
_WIRE_PX = 1.3
_FLAWLESS = Optics(blur_px=0.45, corner_light=1.0, read_noise=0.0, shot_noise=0.0, has_glare=False)


def render_map(world: World, bounds_ne_m: tuple[float, float, float, float], px_per_m: float) -> NDArray[np.uint8]:
    """Draw the world as an orthophoto.

    `bounds_ne_m` is (north_min, east_min, north_max, east_max) [m]. Returns (height, width, 3) uint8 BGR, north up,
    whose edges are the bounds: the point (north, east) lies at column (east - east_min) px_per_m - 0.5 and row
    (north_max - north) px_per_m - 0.5. Conductors are drawn at least a pixel wide, or a map would hardly show them.
    Raises ValueError for bounds without an area or a picture without a pixel.
    """
    north_min_m, east_min_m, north_max_m, east_max_m = bounds_ne_m
    width_px = round((east_max_m - east_min_m) * px_per_m)
    height_px = round((north_max_m - north_min_m) * px_per_m)
    if width_px < 1 or height_px < 1:
        raise ValueError(f"The map's bounds {bounds_ne_m} at {px_per_m} px/m leave no picture.")
    f_px = px_per_m * _ABOVE_M
    # A camera far above sees every height at nearly the same scale; the ground's is exact.
    camera = Intrinsics(width_px, height_px, f_px, f_px, (width_px - 1) / 2.0, (height_px - 1) / 2.0)
    clear = dataclasses.replace(world, light=dataclasses.replace(world.light, visibility_m=math.inf))
    renderer = Renderer(clear, camera, optics=_FLAWLESS, wire_at_least_m=_WIRE_PX / px_per_m)
    north_m, east_m = (north_min_m + north_max_m) / 2.0, (east_min_m + east_max_m) / 2.0
    # A map is as bright at dusk as at noon.
    exposure = Exposure(SUNNY_S / (world.light.direct + world.light.sky))
    return renderer.render(Pose(0, north_m, east_m, -_ABOVE_M, (1.0, 0.0, 0.0, 0.0)), 0, exposure)
