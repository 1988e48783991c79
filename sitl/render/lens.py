"""How the simulated camera looks at the world: its place on the vehicle, its pinhole and its lens."""

import math
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from drivers.camera.camera import Intrinsics
from sitl.pose import Pose

_WIDEST_RAD = math.radians(80.0)


def pinhole(width_px: int, height_px: int, hfov_rad: float) -> Intrinsics:
    """The undistorted camera of that image size [px] and horizontal field of view [rad], its axis at the centre.

    Raises ValueError for an empty image or a field of view outside (0, pi).
    """
    if width_px < 1 or height_px < 1:
        raise ValueError(f"An image needs at least one pixel each way, not {width_px} x {height_px}.")
    if not 0.0 < hfov_rad < math.pi:
        raise ValueError(f"A pinhole's field of view lies between 0 and pi rad, not at {hfov_rad} rad.")
    f_px = width_px / (2.0 * math.tan(hfov_rad / 2.0))
    return Intrinsics(width_px, height_px, f_px, f_px, (width_px - 1) / 2.0, (height_px - 1) / 2.0)


def _looking_down() -> NDArray[np.float64]:
    """Image up is vehicle forward, image right is vehicle right: the columns are the camera's axes in FRD."""
    body_from_camera = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    body_from_camera.flags.writeable = False
    return body_from_camera


@dataclass(frozen=True, slots=True, eq=False)
class CameraMount:
    """Where a camera is fixed to the vehicle: position [m] FRD from the pose's point, and rotation body_from_camera.

    `body_from_camera` is (3, 3) float64, FRD from camera; by default the camera looks straight down with its image up
    along the vehicle's nose. Raises ValueError when it is no rotation.
    """

    position_frd_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    body_from_camera: NDArray[np.float64] = field(default_factory=_looking_down)

    def __post_init__(self) -> None:
        rotation = np.array(self.body_from_camera, dtype=np.float64)
        if rotation.shape != (3, 3) or not np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-9):
            raise ValueError("body_from_camera must be a 3 x 3 rotation matrix.")
        rotation.flags.writeable = False
        object.__setattr__(self, "body_from_camera", rotation)


def _looking_ahead(down_rad: float) -> NDArray[np.float64]:
    """Image right is vehicle right, and the axis points ahead and `down_rad` [rad] below the vehicle's nose."""
    c, s = math.cos(down_rad), math.sin(down_rad)
    return np.array([[0.0, -s, c], [1.0, 0.0, 0.0], [0.0, c, s]])


DOWN = CameraMount()
"""The camera that a flight follows the line with."""

FRONT = CameraMount((0.12, 0.0, 0.03), _looking_ahead(math.radians(20.0)))
"""A camera at the vehicle's nose that looks ahead and 20 degrees down."""


def ned_from_body(pose: Pose) -> NDArray[np.float64]:
    """The rotation (3, 3) float64 that turns FRD body vectors into NED."""
    w, x, y, z = pose.quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def camera_pose(pose: Pose, mount: CameraMount) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Where the camera is when the vehicle is at `pose`: centre (3,) [m] NED, and rotation ned_from_camera (3, 3)."""
    ned_from_frd = ned_from_body(pose)
    centre = np.array([pose.north_m, pose.east_m, pose.down_m]) + ned_from_frd @ np.array(mount.position_frd_m)
    return centre, ned_from_frd @ mount.body_from_camera


def ray_table(intrinsics: Intrinsics) -> NDArray[np.float32]:
    """What each pixel looks along: (2, height, width) float32, x and y of its ray at z = 1 in the camera frame.

    Rays further than 80 degrees off the axis, which a fisheye lens has, are drawn at 80 degrees.
    """
    u, v = np.meshgrid(np.arange(intrinsics.width_px), np.arange(intrinsics.height_px))
    x = (u - intrinsics.cx_px) / intrinsics.fx_px
    y = (v - intrinsics.cy_px) / intrinsics.fy_px
    distortion = np.array(intrinsics.distortion)
    if intrinsics.lens == "fisheye":
        radius = np.hypot(x, y)
        angle = _undistorted_angle(radius, distortion)
        scale = np.tan(np.minimum(angle, _WIDEST_RAD)) / np.maximum(radius, 1e-12)
        x, y = x * scale, y * scale
    elif intrinsics.is_distorted:
        points = np.stack([x, y], axis=-1).reshape(-1, 1, 2)
        criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 40, 1e-10)
        straight = cv2.undistortPoints(points, np.eye(3), distortion, criteria=criteria)
        x, y = np.asarray(straight, dtype=np.float64).reshape(*u.shape, 2).transpose(2, 0, 1)
    return np.ascontiguousarray(np.stack([x, y]), dtype=np.float32)


def _undistorted_angle(radius: NDArray[np.float64], distortion: NDArray[np.float64]) -> NDArray[np.float64]:
    """The angle off the axis [rad] that a fisheye lens images at a radius (in focal lengths), by interpolation."""
    angles = np.linspace(0.0, _WIDEST_RAD, 4096)
    t2 = angles**2
    k1, k2, k3, k4 = distortion
    radii = angles * (1 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4))))
    return np.interp(radius, radii, angles)


def lens_vector(intrinsics: Intrinsics) -> NDArray[np.float64]:
    """What the compiled kernels take of the intrinsics: (10,) float64.

    fx, fy, cx, cy [px], five coefficients (k1 k2 p1 p2 k3, or k1 k2 k3 k4 0), and whether the lens is a fisheye.
    """
    coefficients = (*intrinsics.distortion, 0.0)[:5]
    focal = (intrinsics.fx_px, intrinsics.fy_px, intrinsics.cx_px, intrinsics.cy_px)
    return np.array([*focal, *coefficients, float(intrinsics.lens == "fisheye")], dtype=np.float64)
