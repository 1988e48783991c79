"""The picture of a flight, written beside its log."""

from pathlib import Path

import cv2
import numpy as np

from mission.log.errors import LogError
from mission.log.picture import draw_summary, flight_view
from mission.log.reader import read_flight
from mission.log.summary import summarise
from mission.log.track_map import MapBackground
from mission.simulated.simulation import World, draw_map


class PictureError(Exception):
    """The picture of a flight could not be made; the message is one sentence."""


def write_picture(log: Path, world: World | None) -> Path:
    """Draw the flight of a log as `<log>.png`; `world` gives its ground where it was simulated.

    Raises PictureError with one sentence when it cannot be drawn or written.
    """
    file = log.with_suffix(".png")
    try:
        file.write_bytes(_draw(log, world))
    except (LogError, OSError, ValueError, cv2.error) as error:
        raise PictureError(f"The picture {file} cannot be drawn: {error}.") from error
    return file


def _draw(log: Path, world: World | None) -> bytes:
    flight = read_flight(log, with_images=True)
    background = None
    if world is not None:
        view = flight_view(flight)
        background = MapBackground(draw_map(world, view.bounds_ne_m, view.px_per_m), view.bounds_ne_m)
    image = draw_summary(flight, summarise(flight), background)
    _, encoded = cv2.imencode(".png", np.asarray(image))
    return encoded.tobytes()
