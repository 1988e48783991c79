"""Renders what a camera on the vehicle sees of the world."""

import functools
import itertools

import numpy as np
from numba import njit
from numpy.typing import NDArray

from drivers.camera.camera import Intrinsics
from sitl.pose import Pose
from sitl.render.exposure import SUNNY, Exposure
from sitl.render.ground import GroundTexture, GroundView
from sitl.render.lens import CameraMount, camera_pose, lens_vector, ray_table
from sitl.render.linework import build_layers
from sitl.render.pasture import paint_pasture
from sitl.render.projection import clip_to_view, draw_discs, draw_members, project_point
from sitl.render.sensor import Optics, Sensor
from sitl.world.records import World

_REACH = 1.25  # members are drawn this much beyond the image, so that their width cannot be cut off


# Painting takes seconds, and all renderers of a process can share the result.
_paint = functools.lru_cache(maxsize=2)(paint_pasture)


def _ground_of(world: World) -> GroundTexture:
    """Paint the world's ground, or take it from the last time."""
    return _paint(world.ground, world.light, world.line.axis_ne_m)


class Renderer:
    """Renders a world for one camera; the same pose and `seq` give the same image, to the bit.

    `intrinsics` may have distortion; `mount` is where the camera sits on the vehicle; `seed` is the noise's.
    `wire_at_least_m` is for maps: see sitl.render.linework.build_layers.
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
        self._layers = build_layers(world, wire_at_least_m)
        self._sun_ned = np.array(world.light.direction_ned)
        self._level = world.light.direct + world.light.sky
        self._lens = lens_vector(intrinsics)
        self.rays = ray_table(intrinsics)
        self._ground = GroundView(_ground_of(world), self.rays, intrinsics.fx_px)
        x, y = self.rays
        self._view = np.array([x.min(), x.max(), y.min(), y.max()], dtype=np.float64)
        shape = (intrinsics.height_px, intrinsics.width_px)
        self._light = np.empty((*shape, 3), dtype=np.float32)
        self._coverage = np.zeros(shape, dtype=np.float32)
        self._shaded = np.zeros(shape, dtype=np.float32)
        self._looked_from = Pose(0, 0.0, 0.0, 0.0, (1.0, 0.0, 0.0, 0.0))
        self.sensor = Sensor(self.rays, Optics() if optics is None else optics, seed)

    def render(self, pose: Pose, seq: int, exposure: Exposure = SUNNY) -> NDArray[np.uint8]:
        """The image (height, width, 3) uint8 BGR at a pose; `seq` chooses the noise."""
        return self.sensor.expose(self.light(pose), exposure, seq, self.sun_camera(pose))

    def sun_camera(self, pose: Pose) -> NDArray[np.float64]:
        """Towards the sun, (3,) in the camera frame, as long as its light is bright (Light.direct)."""
        _, ned_from_camera = camera_pose(pose, self.mount)
        return self.world.light.direct * (self._sun_ned @ ned_from_camera)

    def light(self, pose: Pose) -> NDArray[np.float32]:
        """The light (height, width, 3) float32 linear BGR that comes to the camera; the next call overwrites it.

        Its unit is a white sheet at a clear noon; a darker hour's light is less.
        """
        self.ground_light(pose)
        self.add_line(self._light, pose)
        return self._light

    def ground_light(self, pose: Pose) -> NDArray[np.float32]:
        """What light() gives, without the power line; the next call of either overwrites it."""
        self._looked_from = pose
        self._ground.draw(self._light, *camera_pose(pose, self.mount))
        if self._level != 1.0:
            self._light *= np.float32(self._level)
        return self._light

    def add_line(self, light: NDArray[np.float32], pose: Pose) -> None:
        """Draw the power line as a pose sees it over `light`, the ground as it is seen from there or near there."""
        centre, ned_from_camera = camera_pose(pose, self.mount)
        camera_from_ned = np.ascontiguousarray(ned_from_camera.T)
        for layer in self._layers:
            n_seen = draw_members(
                self._coverage,
                self._shaded,
                layer.members,
                layer.is_ribbon,
                layer.material,
                self._sun_ned,
                centre,
                camera_from_ned,
                self._lens,
                _REACH * self._view,
            )
            n_seen += draw_discs(self._coverage, self._shaded, layer.discs, centre, camera_from_ned, self._lens)
            if n_seen:
                bgr = layer.bgr if layer.is_shadow else self._level * layer.bgr
                merge_layer(light, self._coverage, self._shaded, bgr, layer.is_shadow)

    def ground_depth_at(self, rows: NDArray[np.int64], columns: NDArray[np.int64]) -> NDArray[np.float32]:
        """How far the ground is that was looked at last, at those rows and columns: (rows, columns) float32 [m]."""
        return self.depth(self._looked_from)[np.ix_(rows, columns)]

    def depth(self, pose: Pose) -> NDArray[np.float32]:
        """How far the ground is along the camera's axis, (height, width) float32 [m]; infinite where there is sky."""
        centre, ned_from_camera = camera_pose(pose, self.mount)
        x, y = self.rays
        fall = (ned_from_camera[2, 0] * x + ned_from_camera[2, 1] * y + ned_from_camera[2, 2]).astype(np.float32)
        with np.errstate(divide="ignore"):
            depth_m = np.float32(max(0.01, -centre[2])) / fall
        return np.where(fall > 0.0, depth_m, np.float32(np.inf))

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


@njit(nogil=True, cache=True)  # type: ignore[untyped-decorator]
def merge_layer(
    light: NDArray[np.float32],
    coverage: NDArray[np.float32],
    shaded: NDArray[np.float32],
    bgr: NDArray[np.float64],
    is_shadow: bool,
) -> None:
    """Blend a layer of colour `bgr` (3,) into `light` (height, width, 3), in linear light, and empty it.

    `coverage` and `shaded` are (height, width) float32 as add_strip leaves them. Where pieces overlap, the coverage
    adds up to more than 1 and counts as 1. A shadow's `bgr` is the light that is left where it is full.
    """
    for v in range(coverage.shape[0]):
        for u in range(coverage.shape[1]):
            part = coverage[v, u]
            if part == 0.0:
                continue
            bright = shaded[v, u]
            if part > 1.0:
                bright /= part
                part = np.float32(1.0)
            coverage[v, u] = shaded[v, u] = 0.0
            for c in range(3):
                if is_shadow:
                    light[v, u, c] *= np.float32(1.0 - min(1.0, bright) * (1.0 - bgr[c]))
                else:
                    light[v, u, c] = np.float32(light[v, u, c] * (1.0 - part) + bright * bgr[c])
