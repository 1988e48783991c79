"""Renders what a camera on the vehicle sees of the world."""

import functools
import itertools

import numpy as np
from numpy.typing import NDArray

from drivers.camera.camera import Intrinsics
from sitl.pose import Pose
from sitl.render.daylight import daylight_of, light_map
from sitl.render.exposure import SUNNY, Exposure
from sitl.render.ground import GroundView
from sitl.render.lens import CameraMount, camera_pose, lens_vector, ray_table
from sitl.render.linework import build_linework
from sitl.render.merge import draw_linework
from sitl.render.paint import ground_of
from sitl.render.projection import clip_to_view, project_point
from sitl.render.relief import Relief
from sitl.render.sensor import Optics, Sensor
from sitl.world.height_grid import HeightGrid
from sitl.world.records import Light, World
from sitl.world.surface import surface_of

_REACH = 1.25  # members are drawn this much beyond the image, so that their width cannot be cut off
_MOST_STRIPS = 1 << 14


@functools.lru_cache(maxsize=4)
def _stage(surface: HeightGrid, light: Light) -> tuple[Relief, NDArray[np.uint8]]:
    """A surface made ready for rays, and its light; all renderers of a process share them."""
    return Relief.of(surface), light_map(surface, light)


class Renderer:
    """Renders a world for one camera; the same pose and `seq` give the same image, to the bit.

    `intrinsics` may have distortion; `mount` is where the camera sits on the vehicle; `seed` is the noise's.
    `wire_at_least_m` is for maps: see sitl.render.linework.build_linework.
    """

    def __init__(
        self,
        world: World,
        intrinsics: Intrinsics,
        mount: CameraMount | None = None,
        optics: Optics | None = None,
        seed: int = 0,
        wire_at_least_m: float = 0.0,
    ) -> None:
        self.intrinsics = intrinsics
        self.world = world
        self.mount = CameraMount() if mount is None else mount
        self._linework = build_linework(world, wire_at_least_m)
        self._sun_ned = np.array(world.light.direction_ned)
        self._day = daylight_of(world.light)
        self._lens = lens_vector(intrinsics)
        self.rays = ray_table(intrinsics)
        relief, shares = _stage(surface_of(world), world.light)
        self._ground = GroundView(ground_of(world), relief, shares, self._day, self.rays, intrinsics.fx_px)
        x, y = self.rays
        self._view = np.array([x.min(), x.max(), y.min(), y.max()], dtype=np.float64)
        shape = (intrinsics.height_px, intrinsics.width_px)
        self._light = np.empty((*shape, 3), dtype=np.float32)
        self._coverage = np.zeros(shape, dtype=np.float32)
        self._shaded = np.zeros(shape, dtype=np.float32)
        self._strips = np.empty((_MOST_STRIPS, 8), dtype=np.float64)
        self.sensor = Sensor(self.rays, Optics() if optics is None else optics, seed)

    def light(self, pose: Pose) -> NDArray[np.float32]:
        """The light that comes through the lens at a pose: (height, width, 3) float32 linear BGR.

        A matt surface in a clear noon's full light shows its albedo. The array is the renderer's own: the next call
        writes into it.
        """
        self.ground_light(pose)
        self.add_line(self._light, pose)
        return self._light

    def ground_light(self, pose: Pose) -> NDArray[np.float32]:
        """What light() gives, without the linework; the next call of either overwrites it."""
        self._ground.draw(self._light, *camera_pose(pose, self.mount))
        return self._light

    def add_line(self, light: NDArray[np.float32], pose: Pose) -> None:
        """Draw the linework as it is seen from a pose over `light`, hidden by the ground that was looked at last.

        That may have been from near there.
        """
        self._draw_lines(light, np.empty((0, 0), dtype=np.float32), *camera_pose(pose, self.mount))

    def depth(self, pose: Pose) -> NDArray[np.float32]:
        """How far each pixel sees at a pose: (height, width) float32 [m] along the optical axis; inf in the sky.

        Ground, what stands on it, and of the linework what covers a twentieth of the pixel or more.
        """
        centre, ned_from_camera = camera_pose(pose, self.mount)
        self._ground.look(centre, ned_from_camera)
        nearest = self._ground.inverse[: self.intrinsics.height_px, : self.intrinsics.width_px].copy()
        self._draw_lines(self._light, nearest, centre, ned_from_camera)
        return np.where(nearest > 0.0, 1.0 / np.maximum(nearest, 1e-12), np.inf).astype(np.float32)

    def ground_depth_at(self, rows: NDArray[np.int64], columns: NDArray[np.int64]) -> NDArray[np.float32]:
        """How far the ground is that was looked at last, at those rows and columns: (rows, columns) float32 [m]."""
        inverse = self._ground.inverse[np.ix_(rows, columns)]
        return np.where(inverse > 0.0, 1.0 / np.maximum(inverse, 1e-12), np.inf).astype(np.float32)

    def render(self, pose: Pose, seq: int, exposure: Exposure = SUNNY) -> NDArray[np.uint8]:
        """The image (height, width, 3) uint8 BGR at a pose; `seq` chooses the noise."""
        return self.sensor.expose(self.light(pose), exposure, seq, self.sun_camera(pose))

    def sun_camera(self, pose: Pose) -> NDArray[np.float64]:
        """Towards the sun, (3,) in the camera frame, as long as its light is bright (Light.direct)."""
        _, ned_from_camera = camera_pose(pose, self.mount)
        return self.world.light.direct * (self._sun_ned @ ned_from_camera)

    def _draw_lines(
        self,
        light: NDArray[np.float32],
        nearest: NDArray[np.float32],
        centre: NDArray[np.float64],
        ned_from_camera: NDArray[np.float64],
    ) -> None:
        lines = self._linework
        draw_linework(
            light, self._ground.inverse, nearest, self._coverage, self._shaded, self._strips,
            lines.members, lines.discs, lines.spans, lines.looks, self._sun_ned, centre,
            np.ascontiguousarray(ned_from_camera.T), self._lens, _REACH * self._view,
            self._ground.shine, self._day.air_bgr, float(self._day.table[6, 0]),
        )  # fmt: skip

    def project(self, pose: Pose) -> list[NDArray[np.float64]]:
        """Where the conductors truly are in the image at a pose.

        Returns for each conductor its visible part as (n, 4) float64 [px]: x1, y1, x2, y2 of straight pieces in the
        conductor's order, the centre of the first pixel at (0, 0); none of them where it is out of view.
        """
        centre, ned_from_camera = camera_pose(pose, self.mount)
        pieces = []
        for conductor in self.world.conductors:
            points = (conductor.points_ned_m - centre) @ ned_from_camera
            rows = []
            for p, q in itertools.pairwise(points):
                first, last = clip_to_view(p, q, self._view)
                if first < last:
                    a, b = p + first * (q - p), p + last * (q - p)
                    rows.append([*project_point(*a, self._lens), *project_point(*b, self._lens)])
            pieces.append(np.array(rows, dtype=np.float64).reshape(-1, 4))
        return pieces
