"""The picture of a flight, written beside its log."""

from pathlib import Path
from typing import TYPE_CHECKING

import cv2

from mission.log.picture import draw_summary
from mission.log.reader import read_flight
from mission.log.summary import FlightReport

if TYPE_CHECKING:
    from sitl.world import World
