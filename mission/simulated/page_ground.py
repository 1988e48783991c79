"""The simulated ground under a flight, for its page."""

from typing import cast

import cv2
import numpy as np

from mission.log.page.page import Ground
from mission.log.reader import Flight
from mission.simulated.simulation import draw_map
from sitl.world.errors import WorldError
from sitl.world.file import load_world
from sitl.world.light import LightName

_SIZE_PX = 1200
_MARGIN_M, _MARGIN_SHARE = 15.0, 0.35
_JPEG_QUALITY = 72


def page_ground(flight: Flight, world_name: str, light: str | None) -> Ground | None:
    """The ground that the flight's map shows; None where that world is not known here (any more)."""
    try:
        world = load_world(world_name, cast("LightName | None", light))
    except WorldError:
        return None
    places_ne_m = np.array([(state.north_m, state.east_m) for state in flight.states]).reshape(-1, 2)
    if not len(places_ne_m):
        return None
    low, high = places_ne_m.min(axis=0), places_ne_m.max(axis=0)
    half_m = float((0.5 + _MARGIN_SHARE) * (high - low).max()) + _MARGIN_M
    middle_north_m, middle_east_m = (0.5 * (low + high)).tolist()
    bounds = (middle_north_m - half_m, middle_east_m - half_m, middle_north_m + half_m, middle_east_m + half_m)
    image = draw_map(world, bounds, _SIZE_PX / (2.0 * half_m))
    jpeg = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])[1].tobytes()
    return Ground(jpeg, north_m=bounds[2], west_m=bounds[1], height_m=2.0 * half_m, width_m=2.0 * half_m)
