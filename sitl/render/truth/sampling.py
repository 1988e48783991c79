"""Where pictures of a line are taken from: views along its corridor, as an inspection flight has them."""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from sitl.control import quaternion_of
from sitl.pose import Pose
from sitl.render.motion import Motion
from sitl.world.height_grid import HeightGrid
from sitl.world.records import World

CameraName = Literal["down", "front"]

_ABOVE_WIRES_M = (4.0, 15.0)
_ABOVE_ALL_M = 3.0
_BESIDE_M: dict[CameraName, float] = {"down": 4.0, "front": 8.0}  # standard deviation across the line
_YAW_RAD: dict[CameraName, float] = {"down": math.radians(25.0), "front": math.radians(12.0)}
_TILT_RAD, _MOST_TILT_RAD = math.radians(5.0), math.radians(20.0)
_FASTEST_M_S = 7.0
_NEAR_M = 15.0


@dataclass(frozen=True, slots=True)
class View:
    """A moving vehicle, and how it is turned [rad]."""

    motion: Motion
    roll_rad: float
    pitch_rad: float
    yaw_rad: float


def sample_view(
    world: World,
    surface: HeightGrid,
    camera: CameraName,
    rng: np.random.Generator,
    above_wires_m: tuple[float, float] = _ABOVE_WIRES_M,
    beside_m: float | None = None,
) -> View:
    """A view over the world's line, `above_wires_m` [m] from and to, along it either way, tilted as in flight.

    `surface` is surface_of(world); `beside_m` the standard deviation across the line [m], else the camera's own.
    """
    north_m, east_m, heading_rad = _place_on(world, rng)
    beside_m = rng.normal(0.0, _BESIDE_M[camera] if beside_m is None else beside_m)
    north_m -= beside_m * math.sin(heading_rad)
    east_m += beside_m * math.cos(heading_rad)
    over_all_m = surface.at(north_m, east_m) + _ABOVE_ALL_M
    height_m = max(_wires_up_m(world, north_m, east_m) + rng.uniform(*above_wires_m), over_all_m)
    course_rad = heading_rad + (math.pi if rng.random() < 0.5 else 0.0)
    yaw_rad = math.remainder(course_rad + rng.normal(0.0, _YAW_RAD[camera]), 2.0 * math.pi)
    roll_rad, pitch_rad = np.clip(rng.normal(0.0, _TILT_RAD, 2), -_MOST_TILT_RAD, _MOST_TILT_RAD).tolist()
    speed_m_s = rng.uniform(0.0, _FASTEST_M_S)
    motion = Motion(
        Pose(0, north_m, east_m, -height_m, quaternion_of(roll_rad, pitch_rad, yaw_rad)),
        (speed_m_s * math.cos(course_rad), speed_m_s * math.sin(course_rad), float(rng.normal(0.0, 0.3))),
        tuple(rng.normal(0.0, 0.1, 3).tolist()),
    )
    return View(motion, roll_rad, pitch_rad, yaw_rad)


def _place_on(world: World, rng: np.random.Generator) -> tuple[float, float, float]:
    """Somewhere on the line's axis, every metre as likely as another: north, east [m] and the line's heading [rad]."""
    axis = np.array(world.line.axis_ne_m, dtype=np.float64)
    steps = np.diff(axis, axis=0)
    lengths_m = np.hypot(steps[:, 0], steps[:, 1])
    k = int(rng.choice(len(steps), p=lengths_m / lengths_m.sum()))
    north_m, east_m = axis[k] + rng.random() * steps[k]
    return float(north_m), float(east_m), math.atan2(steps[k, 1], steps[k, 0])


def _wires_up_m(world: World, north_m: float, east_m: float) -> float:
    """How high the wires and the supports of all lines hang around a place; 0 where there are none."""
    tops = [np.array([support.top_ned_m for support in world.supports]).reshape(-1, 3)]
    points = np.concatenate([*(conductor.points_ned_m for conductor in world.conductors), *tops])
    near = np.hypot(points[:, 0] - north_m, points[:, 1] - east_m) < _NEAR_M
    return float(max(0.0, (-points[near, 2]).max(initial=0.0)))
