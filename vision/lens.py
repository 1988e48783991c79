"""Undoing a lens' distortion, so that angles and offsets are those of a straight camera of the same matrix.

A lens that bends straight lines by less than a pixel hides no line from the detector: then only the end points of what
was found are moved. A stronger one breaks a conductor into arcs that no straight line covers (docs/decisions): then
the grey image is straightened before the search, and what was found is bent back to where the frame shows it.
"""

from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from drivers.camera.camera import Intrinsics
from vision.conductors import Conductor
from vision.records import Segments

MAX_BEND_PX = 1.0

_ROUND_TRIP_PX = 0.05
_CRITERIA = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 40, 1e-9)


def undistort_points(points_px: NDArray[np.float64], camera: Intrinsics) -> NDArray[np.float64]:
    """Move image points (n, 2) [px] to where a straight camera of the same matrix has them; (n, 2) float64 [px].

    Points that have no place there are NaN: a fisheye lens sees them beside or behind the camera.
    """
    if len(points_px) == 0:
        return np.empty((0, 2))
    points = np.ascontiguousarray(points_px, dtype=np.float64).reshape(-1, 1, 2)
    matrix, distortion = camera.matrix, np.array(camera.distortion)
    if camera.lens == "fisheye":
        straight = cv2.fisheye.undistortPoints(points, matrix, distortion, P=matrix, criteria=_CRITERIA)
    else:
        straight = cv2.undistortPoints(points, matrix, distortion, P=matrix, criteria=_CRITERIA)
    moved = np.asarray(straight, dtype=np.float64).reshape(-1, 2)
    # OpenCV mirrors what lies behind the camera, and gives up quietly where its iteration fails.
    is_lost = ~(np.abs(distort_points(moved, camera) - points.reshape(-1, 2)).max(axis=1) <= _ROUND_TRIP_PX)
    moved[is_lost] = np.nan
    return moved


def distort_points(points_px: NDArray[np.float64], camera: Intrinsics) -> NDArray[np.float64]:
    """The other way: where the frame shows points (n, 2) [px] of the straight image; (n, 2) float64 [px]."""
    if len(points_px) == 0:
        return np.empty((0, 2))
    x = (points_px[:, 0] - camera.cx_px) / camera.fx_px
    y = (points_px[:, 1] - camera.cy_px) / camera.fy_px
    matrix, distortion = camera.matrix, np.array(camera.distortion)
    rays = np.stack([x, y, np.ones_like(x)], axis=1).reshape(-1, 1, 3)
    project = cv2.fisheye.projectPoints if camera.lens == "fisheye" else cv2.projectPoints
    seen, _ = project(rays, np.zeros(3), np.zeros(3), matrix, distortion)
    return np.asarray(seen, dtype=np.float64).reshape(-1, 2)


def bend_px(camera: Intrinsics) -> float:
    """How far [px] the lens bends a straight line across the frame away from its chord, at most."""
    if not camera.is_distorted:
        return 0.0
    along = np.linspace(0.0, 1.0, 33)
    right, bottom = camera.width_px - 1, camera.height_px - 1
    worst = 0.0
    for share in (0.0, 0.25, 0.5, 0.75, 1.0):
        for x, y in (
            (right * along, np.full_like(along, bottom * share)),
            (np.full_like(along, right * share), bottom * along),
            (right * along, bottom * (share + (1 - 2 * share) * along)),
        ):
            seen = distort_points(np.stack([x, y], axis=1), camera)
            chord = seen[-1] - seen[0]
            aside = (seen - seen[0]) @ np.array([-chord[1], chord[0]]) / np.hypot(*chord)
            worst = max(worst, float(np.abs(aside).max()))
    return worst


class LensCorrection:
    """Undoes the distortion of one camera, in the way that its strength asks for."""

    def __init__(self, camera: Intrinsics) -> None:
        self._camera = camera
        self.straightens_frames = bend_px(camera) > MAX_BEND_PX
        if self.straightens_frames:
            x, y = np.meshgrid(np.arange(camera.width_px), np.arange(camera.height_px))
            points_px = np.stack([x.ravel(), y.ravel()], axis=1).astype(np.float64)
            seen = distort_points(points_px, camera).reshape(*x.shape, 2).astype(np.float32)
            # Fixed-point maps are what OpenCV resamples with the fastest.
            self._maps = cv2.convertMaps(seen[..., 0], seen[..., 1], cv2.CV_16SC2)

    def straighten(self, grey: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """The image (h, w) that a straight camera would have taken; `grey` itself where the lens hardly bends.

        Raises ValueError for an image that is not of the camera's size.
        """
        size = (self._camera.width_px, self._camera.height_px)
        if grey.shape[::-1] != size:
            raise ValueError(f"The image is {grey.shape[1]} x {grey.shape[0]} px, but the calibration's are {size}.")
        if not self.straightens_frames:
            return grey
        straight = cv2.remap(grey, *self._maps, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        return np.asarray(straight, dtype=np.uint8)

    def correct_axes(self, conductors: list[Conductor]) -> list[Conductor]:
        """Conductors that were found in the image of `straighten`, their axes where a straight camera has them.

        Their edges stay. Those that have no place there are left out.
        """
        if self.straightens_frames:
            return conductors
        ends_px = np.array([conductor.axis for conductor in conductors]).reshape(-1, 2)
        axes = undistort_points(ends_px, self._camera).reshape(-1, 4)
        return [
            replace(conductor, axis=(x1, y1, x2, y2))
            for conductor, (x1, y1, x2, y2) in zip(conductors, axes.tolist(), strict=True)
            if np.isfinite((x1, y1, x2, y2)).all()
        ]

    def in_frame(self, segments: Segments) -> Segments:
        """Where the frame shows segments (n, 4) [px] that were found in the image of `straighten`."""
        if not self.straightens_frames:
            return segments
        seen = distort_points(segments.reshape(-1, 2), self._camera).reshape(-1, 4)
        seen.setflags(write=False)
        return seen
