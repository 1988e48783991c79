"""Whether intrinsics can be a camera's at all."""

import numpy as np

from drivers.camera.camera import Intrinsics

_MIN_FOCAL, _MAX_FOCAL = 0.04, 30.0  # of the image's width: 170 degrees to 2 degrees of view
_MIN_STRETCH, _MAX_STRETCH = 0.4, 4.0  # of a corner's distance from the centre, undistorted over distorted


def is_plausible(camera: Intrinsics) -> bool:
    """Whether the distorted radius grows with the true one up to the image's corners, and stays near it.

    Also whether its view is 2 to 170 degrees wide, its pixels are about square, and its axis is near the image.
    A polynomial that was fitted to the middle alone may turn back outside, so that two places share a pixel; and one
    that moves the corners to less than 0.4 or more than 4 times their distance is no plain lens', but a slip.
    """
    shares = camera.fx_px / camera.width_px, camera.fy_px / camera.fx_px, camera.cx_px / camera.width_px
    if not (_MIN_FOCAL < shares[0] < _MAX_FOCAL and 0.5 < shares[1] < 2.0 and -0.5 < shares[2] < 1.5):
        return False
    corner = np.hypot(
        max(camera.cx_px, camera.width_px - camera.cx_px) / camera.fx_px,
        max(camera.cy_px, camera.height_px - camera.cy_px) / camera.fy_px,
    )
    if camera.lens == "fisheye":
        k1, k2, k3, k4 = camera.distortion
        angle = np.linspace(0.0, np.pi / 2, 500)
        radius = angle * (1 + k1 * angle**2 + k2 * angle**4 + k3 * angle**6 + k4 * angle**8)
        falls = np.flatnonzero(np.diff(radius) <= 0)
        return len(falls) == 0 or bool(radius[falls[0]] > corner)
    k1, k2, _, _, k3 = camera.distortion
    true = np.linspace(0.0, _MAX_STRETCH * corner, 4000)
    radius = true * (1 + k1 * true**2 + k2 * true**4 + k3 * true**6)
    reaching = np.flatnonzero(radius >= corner)
    if len(reaching) == 0:
        return False
    at_corner = reaching[0]
    return bool(true[at_corner] >= _MIN_STRETCH * corner and (np.diff(radius[: at_corner + 1]) > 0).all())
