"""A camera and its poses in COLMAP's text format (https://colmap.github.io/format.html).

COLMAP's pixels have the centre of the first one at (0.5, 0.5), ours at (0, 0). A pose is camera_from_world: quaternion
w, x, y, z and the world's origin in the camera's frame; both use a camera frame of x right, y down, z forward.
"""

from collections.abc import Iterable

import numpy as np

from drivers.camera.camera import Intrinsics
from mission.export.poses import Floats, rotated

_CAMERA_ID = 1


def camera_lines(camera: Intrinsics) -> str:
    """cameras.txt for a camera.

    The model is PINHOLE without distortion, OPENCV_FISHEYE for a fisheye lens, OPENCV where k1 k2 p1 p2 tell the
    distortion, and FULL_OPENCV where k3 is needed, too.
    """
    matrix = (camera.fx_px, camera.fy_px, camera.cx_px + 0.5, camera.cy_px + 0.5)
    model, parameters = "PINHOLE", list(matrix)
    if camera.lens == "fisheye":
        model, parameters = "OPENCV_FISHEYE", [*matrix, *camera.distortion]
    elif any(camera.distortion[4:]):
        model, parameters = "FULL_OPENCV", [*matrix, *camera.distortion, 0.0, 0.0, 0.0]
    elif camera.is_distorted:
        model, parameters = "OPENCV", [*matrix, *camera.distortion[:4]]
    numbers = " ".join(map(repr, parameters))
    return (
        "# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n"
        f"{_CAMERA_ID} {model} {camera.width_px} {camera.height_px} {numbers}\n"
    )


def image_lines(names: Iterable[str], camera_from_world: Floats, centres_m: Floats) -> str:
    """images.txt for images without points: rotations (n, 4) and the cameras' places (n, 3) in the world [m]."""
    translations_m = -rotated(camera_from_world, centres_m)
    lines = [
        "# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME",
        "# POINTS2D[] as (X, Y, POINT3D_ID): none, hence every other line is empty",
    ]
    poses = np.concatenate([camera_from_world, translations_m], axis=1).tolist()
    for image_id, (name, pose) in enumerate(zip(names, poses, strict=True), start=1):
        numbers = " ".join(f"{number:.12g}" for number in pose)
        lines += [f"{image_id} {numbers} {_CAMERA_ID} {name}", ""]
    return "\n".join(lines) + "\n"


def point_lines() -> str:
    """points3D.txt without points: triangulating them is the reconstruction's part."""
    return "# POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)\n"
