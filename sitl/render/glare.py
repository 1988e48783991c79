"""Light that a lens scatters over the picture: a veil around the sun, and around what is far over white."""

import math

import cv2
import numpy as np
from numpy.typing import NDArray

STRIDE_PX = 8
"""Glare is smooth: it is worked out on every eighth pixel each way."""

_SUN_BGR = np.array([0.80, 0.93, 1.0], dtype=np.float32)
# The eye's veil is 10 E / angle^2 [deg] (CIE 146:2002), in units of white E / pi so pi times that; a fair lens that is
# not quite clean scatters about a third of it.
_SCATTER_DEG2 = 10.0
_CORE_DEG = 1.2
_BRIGHT_SHARE = 0.08  # of what is over white
_BRIGHT_WIDTHS = (0.03, 0.12)  # of the image's width: a halo, and a haze around it
_LEAST = 0.003  # of white; a veil fainter than that is left out


def small_rays(rays: NDArray[np.float32]) -> NDArray[np.float32]:
    """Unit vectors (rows, columns, 3) float32 along the rays of every eighth pixel; `rays` is lens.ray_table's."""
    x, y = rays[:, STRIDE_PX // 2 :: STRIDE_PX, STRIDE_PX // 2 :: STRIDE_PX]
    directions = np.stack([x, y, np.ones_like(x)], axis=-1)
    return np.asarray(directions / np.linalg.norm(directions, axis=-1, keepdims=True), dtype=np.float32)


def sample(light: NDArray[np.float32]) -> NDArray[np.float32]:
    """Every eighth pixel of `light` (height, width, 3), at the places of small_rays()."""
    return light[STRIDE_PX // 2 :: STRIDE_PX, STRIDE_PX // 2 :: STRIDE_PX]


def find_glare(
    samples: NDArray[np.float32], scale: float, directions: NDArray[np.float32], sun_camera: NDArray[np.float64]
) -> NDArray[np.float32] | None:
    """The light that lens and sun add to a picture, on every eighth pixel; None where it is too little to see.

    `samples` is sample()'s, `directions` small_rays()'s, `scale` the exposure's. `sun_camera` (3,) points towards the
    sun in the camera frame and is as long as the sun is bright (Light.direct). What may stand before the sun is not
    known here, so that it blinds through trees and hills.
    """
    glare = np.zeros_like(samples)
    veil = _sun_veil(directions, sun_camera)
    if veil is not None and scale * float(veil.max()) > _LEAST:
        glare += veil[..., None] * _SUN_BGR
    over = np.maximum(samples - np.float32(1.0 / scale), np.float32(0.0))
    if scale * _BRIGHT_SHARE * float(over.max()) > _LEAST:
        for width in _BRIGHT_WIDTHS:
            sigma = width * samples.shape[1]
            halo = cv2.GaussianBlur(over, (0, 0), max(0.5, sigma), borderType=cv2.BORDER_REPLICATE)
            glare += np.float32(_BRIGHT_SHARE / len(_BRIGHT_WIDTHS)) * np.asarray(halo).reshape(over.shape)
    return glare if scale * float(glare.max()) > _LEAST else None


def _sun_veil(directions: NDArray[np.float32], sun_camera: NDArray[np.float64]) -> NDArray[np.float32] | None:
    """How bright the sun's scattered light is along each direction, in units of a clear noon's white."""
    bright = float(np.linalg.norm(sun_camera))
    if bright <= 0.0 or sun_camera[2] <= 0.0:  # no sun, or behind the lens
        return None
    cosine = np.clip(directions @ (sun_camera / bright).astype(np.float32), -1.0, 1.0)
    angle_deg2 = np.degrees(np.arccos(cosine)) ** 2
    on_the_lens = float(sun_camera[2])  # the sun's light on the front glass goes with the cosine of its angle
    return np.asarray(on_the_lens * _SCATTER_DEG2 / (angle_deg2 + _CORE_DEG**2), dtype=np.float32)


def add_glare(light: NDArray[np.float32], glare: NDArray[np.float32]) -> NDArray[np.float32]:
    """`light` (height, width, 3) with a glare of find_glare() over it; `light` may be written to."""
    height_px, width_px = light.shape[:2]
    # The samples stand in the middle of their blocks, within half a pixel; the last block may be cut off.
    whole = (glare.shape[1] * STRIDE_PX, glare.shape[0] * STRIDE_PX)
    if whole[0] < width_px or whole[1] < height_px:
        right, below = math.ceil(width_px / STRIDE_PX), math.ceil(height_px / STRIDE_PX)
        glare = np.pad(glare, ((0, below - glare.shape[0]), (0, right - glare.shape[1]), (0, 0)), mode="edge")
        whole = (right * STRIDE_PX, below * STRIDE_PX)
    wide = np.asarray(cv2.resize(glare, whole, interpolation=cv2.INTER_LINEAR))[:height_px, :width_px]
    return np.asarray(cv2.add(light, wide, dst=light), dtype=np.float32)
