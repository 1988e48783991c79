"""A camera that sees the world's conductors and nothing else: next to no work, and the flight can be steered by it.

Rendering a world takes more of a computer than the whole flight does. This camera draws the conductors as bright lines
over a noise that was made before, so that what is measured is what a companion computer runs.
"""

import time
from types import TracebackType
from typing import Self

import cv2
import numpy as np
from numpy.typing import NDArray

from drivers.camera.camera import Frame, Intrinsics
from sitl.pose import Pose, PoseBlock
from sitl.render.lens import CameraMount, camera_pose
from sitl.world.file import load_world

_SPARE_PX = 32  # the noise is that much larger than a frame, and is shown from elsewhere in each: no two are the same
_NEAREST_M = 0.5
_SHIFT = 4  # of cv2's coordinates with fractions [bits]


class LineCamera:
    """Gives a frame `rate_hz` times a second [wall] of what stands below the pose in `pose_block`."""

    def __init__(self, pose_block: str, intrinsics: Intrinsics, rate_hz: float) -> None:
        self._pose_block = pose_block
        self._intrinsics = intrinsics
        self._rate_hz = rate_hz
        self._poses: PoseBlock | None = None
        self._noise = np.empty((0, 0, 3), np.uint8)
        self._conductors: list[NDArray[np.float64]] = []
        self._seq = 0
        self._start_s = 0.0

    def read(self, timeout_s: float) -> Frame | None:
        """Wait for the next frame's time; those that were missed are dropped."""
        now_s = time.monotonic()
        self._seq = max(self._seq + 1, int((now_s - self._start_s) * self._rate_hz))
        time.sleep(max(0.0, self._start_s + self._seq / self._rate_hz - now_s))
        pose = None if self._poses is None else self._poses.read()
        if pose is None:
            return None
        image = self._draw(pose)
        image.setflags(write=False)
        return Frame(self._seq, pose.t_ns, image)

    def _draw(self, pose: Pose) -> NDArray[np.uint8]:
        camera = self._intrinsics
        x, y = (self._seq * 7) % _SPARE_PX, (self._seq * 13) % _SPARE_PX
        image = self._noise[y : y + camera.height_px, x : x + camera.width_px].copy()
        centre, ned_from_camera = camera_pose(pose, CameraMount())
        for points in self._conductors:
            seen = (points - centre) @ ned_from_camera  # the inverse rotation of each row
            seen = seen[seen[:, 2] > _NEAREST_M]
            if len(seen) > 1:
                x_px = camera.cx_px + camera.fx_px * seen[:, 0] / seen[:, 2]
                y_px = camera.cy_px + camera.fy_px * seen[:, 1] / seen[:, 2]
                ends = np.round(np.stack((x_px, y_px), 1) * (1 << _SHIFT)).astype(np.int32)
                cv2.polylines(image, [ends], False, (225, 225, 225), 2, cv2.LINE_AA, _SHIFT)
        return image

    def __enter__(self) -> Self:
        camera = self._intrinsics
        self._poses = PoseBlock.attach(self._pose_block)
        self._conductors = [conductor.points_ned_m for conductor in load_world().conductors]
        size = (camera.height_px + _SPARE_PX, camera.width_px + _SPARE_PX, 3)
        self._noise = np.random.default_rng(1).normal(90.0, 6.0, size).clip(0, 255).astype(np.uint8)
        self._start_s = time.monotonic()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._poses is not None:
            self._poses.close()
            self._poses = None
