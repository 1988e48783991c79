"""Takes pictures of a world as a camera on a flying vehicle does: exposed by its automatic, smeared by its motion."""

import itertools
import math
from dataclasses import dataclass

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from sitl.render.exposure import AutoExposure, Exposure, ExposureMeter
from sitl.render.glare import sample
from sitl.render.lens import camera_pose
from sitl.render.motion import Motion, Shutter, sub_times_s
from sitl.render.renderer import Renderer
from sitl.render.smear import find_flow, grid_places, smear
from sitl.world.surface import surface_of

_SHARP_PX = 0.3  # a smear shorter than this does not show beside the lens's blur
_NEAREST_M = 0.3
_MOST_SUB_POSES = 12
_GROUND_STEP_PX = 1.5
_MOST_STRIPS = 48


@dataclass(frozen=True, slots=True, eq=False)
class Shot:
    """A picture (height, width, 3) uint8 BGR, and how it was exposed."""

    image: NDArray[np.uint8]
    exposure: Exposure


class Photographer:
    """A camera in a rendered world. What it takes depends on the shots before it only by the exposure's automatic.

    `shutter.exposure_s` fixes the time and leaves the gain to the automatic.
    """

    def __init__(
        self, renderer: Renderer, shutter: Shutter | None = None, automatic: AutoExposure | None = None
    ) -> None:
        self._renderer = renderer
        self._shutter = Shutter() if shutter is None else shutter
        automatic = AutoExposure() if automatic is None else automatic
        fixed_s = self._shutter.exposure_s
        if fixed_s is not None:
            automatic = AutoExposure(automatic.target, fixed_s, fixed_s, automatic.most_gain, automatic.time_constant_s)
        self._automatic = automatic
        self._meter = ExposureMeter(automatic)
        self._surface = surface_of(renderer.world)
        wires = [np.hstack([wire.points_ned_m[:-1], wire.points_ned_m[1:]]) for wire in renderer.world.conductors]
        self._wires = np.concatenate([np.empty((0, 6)), *wires])

    def take(self, motion: Motion, seq: int) -> Shot:
        """The next frame of a flight. The first one is exposed as after a long look; `seq` chooses the noise."""
        return self._take(motion, seq, self._meter)

    def take_alone(self, motion: Motion, seq: int) -> Shot:
        """A single picture, exposed as after a long look, whatever was taken before."""
        return self._take(motion, seq, ExposureMeter(self._automatic))

    def _take(self, motion: Motion, seq: int, meter: ExposureMeter) -> Shot:
        pose, renderer = motion.pose, self._renderer
        sun = renderer.sun_camera(pose)
        if meter.exposure is None:
            meter.settle(sample(renderer.light(pose)), pose.t_ns)
        exposure = meter.exposure
        assert exposure is not None  # noqa: S101  settle() has set it
        light = self.gather(motion, exposure.time_s)
        shot = Shot(renderer.sensor.expose(light, exposure, seq, sun), exposure)
        glare = renderer.sensor.glare(light, exposure, sun)
        meter.follow(sample(light) if glare is None else sample(light) + glare, pose.t_ns)
        return shot

    def gather(self, motion: Motion, exposure_s: float) -> NDArray[np.float32]:
        """The light (height, width, 3) float32 that falls on the sensor while it moves; a later call may overwrite it.

        The ground is rendered once and smeared. The power line, which is nearer and moves more, is drawn over it from
        as many poses as its smear is pixels long, and strip by strip of rows for a rolling shutter.
        """
        renderer, shutter = self._renderer, self._shutter
        blur_px = self.smear_px(motion, exposure_s)
        shear_px = self.smear_px(motion, shutter.readout_s)
        if max(blur_px, shear_px) < _SHARP_PX:
            return renderer.light(motion.pose)
        light = renderer.ground_light(motion.pose)
        intrinsics = renderer.intrinsics
        places = grid_places(intrinsics.height_px), grid_places(intrinsics.width_px)
        depth_m = renderer.ground_depth_at(*places)
        flow = find_flow(motion, shutter, exposure_s, renderer.mount, intrinsics, renderer.rays, depth_m)
        longest_px = float(np.linalg.norm(flow[1] - flow[0], axis=-1).max())
        n_samples = min(_MOST_SUB_POSES, max(1, math.ceil(longest_px / _GROUND_STEP_PX + 0.5)))
        is_sharp = n_samples == 1 and shutter.readout_s == 0.0
        ground = light.copy() if is_sharp else smear(light, flow, n_samples)
        n_poses = 1 if blur_px < _SHARP_PX else min(_MOST_SUB_POSES, 1 + math.ceil(blur_px))
        n_strips = min(_MOST_STRIPS, intrinsics.height_px, max(1, math.ceil(2.0 * shear_px)))
        edges = np.linspace(0, intrinsics.height_px, n_strips + 1).round().astype(int)
        gathered = np.zeros_like(ground)
        for top, bottom in itertools.pairwise(edges.tolist()):
            middle_s = shutter.row_s((top + bottom - 1) / 2.0, intrinsics.height_px)
            for dt_s in sub_times_s(exposure_s, n_poses):
                light[top:bottom] = ground[top:bottom]  # what was drawn beyond the strip does not count
                renderer.add_line(light, motion.pose_at(middle_s + dt_s))
                cv2.scaleAdd(light[top:bottom], 1.0 / n_poses, gathered[top:bottom], dst=gathered[top:bottom])
        return gathered

    def smear_px(self, motion: Motion, duration_s: float) -> float:
        """At least how far anything in view moves over the picture within a time [px]."""
        if motion.is_still or duration_s == 0.0:
            return 0.0
        renderer = self._renderer
        x, y = renderer.rays[:, :: max(1, renderer.rays.shape[1] - 1), :: max(1, renderer.rays.shape[2] - 1)]
        # A turn moves more in the corners than in the middle.
        stretch = math.sqrt(1.0 + float((x**2 + y**2).max()))
        centre, _ = camera_pose(motion.pose, renderer.mount)
        over_ground_m = -float(centre[2]) - self._surface.at(float(centre[0]), float(centre[1]))
        nearest_m = max(_NEAREST_M, min(over_ground_m, nearest_wire_m(self._wires, centre)))
        by_moving = float(np.linalg.norm(motion.velocity_ned_m_s)) / nearest_m
        by_turning = stretch * float(np.linalg.norm(motion.rates_frd_rad_s))
        return float(stretch * renderer.intrinsics.fx_px * duration_s * (by_moving + by_turning))


@njit(nogil=True, cache=True)  # type: ignore[untyped-decorator]
def nearest_wire_m(wires: NDArray[np.float64], place: NDArray[np.float64]) -> float:
    """How far the nearest of straight pieces (n, 6), both ends NED [m], is from a place (3,); infinite without any."""
    nearest = np.inf
    for k in range(len(wires)):
        along, length2 = 0.0, 0.0
        for i in range(3):
            step = wires[k, 3 + i] - wires[k, i]
            along += step * (place[i] - wires[k, i])
            length2 += step * step
        part = min(1.0, max(0.0, along / max(1e-12, length2)))
        gap = 0.0
        for i in range(3):
            gap += (wires[k, i] + part * (wires[k, 3 + i] - wires[k, i]) - place[i]) ** 2
        nearest = min(nearest, gap)
    return math.sqrt(nearest)
