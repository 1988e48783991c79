"""Small worlds made by hand, and poses in them."""

import math
from typing import Any

import numpy as np

from drivers.camera.camera import Intrinsics
from sitl.place import Origin
from sitl.pose import Pose
from sitl.render.lens import CameraMount, pinhole
from sitl.render.sensor import Optics
from sitl.world.height_grid import HeightGrid
from sitl.world.records import Conductor, Ground, Light, PowerLine, World

FLAWLESS = Optics(blur_px=0.0, corner_light=1.0, read_noise=0.0, shot_noise=0.0)
CAMERA: Intrinsics = pinhole(320, 240, math.radians(70.0))
NOON = Light(math.radians(90.0), math.radians(45.0), direct=0.58, sky=0.42, visibility_m=1e9)
"""The sun stands in the east."""


def scene(*conductors: Conductor, **parts: Any) -> World:
    """A level world of 96 x 96 m with these conductors and no supports; `parts` take the place of World's."""
    whole: dict[str, Any] = {
        "name": "scene",
        "origin": Origin(0.1, 0.1, 100.0),
        "start_yaw_rad": 0.0,
        "lines": (PowerLine(((-40.0, 0.0), (40.0, 0.0)), (), conductors),),
        "terrain": HeightGrid.flat(-48.0, -48.0, 48.0, 48.0),
        "ground": Ground("pasture", 1),
        "strips": (),
        "buildings": (),
        "trees": (),
        "light": NOON,
    }
    return World(**{**whole, **parts})


def wire(up_m: float, east_m: float = 0.0, diameter_m: float = 0.05) -> Conductor:
    """A level wire that runs north."""
    return Conductor(diameter_m, np.array([[-45.0, east_m, -up_m], [45.0, east_m, -up_m]]))


def looking_down(north_m: float, east_m: float, up_m: float) -> Pose:
    """With the image's top to the north."""
    return Pose(0, north_m, east_m, -up_m, (1.0, 0.0, 0.0, 0.0))


def ahead(pitch_rad: float = 0.0) -> CameraMount:
    """A camera that looks forward, `pitch_rad` below the horizon."""
    axis = np.array([math.cos(pitch_rad), 0.0, math.sin(pitch_rad)])
    right = np.array([0.0, 1.0, 0.0])
    return CameraMount(body_from_camera=np.stack([right, np.cross(axis, right), axis], axis=1))
