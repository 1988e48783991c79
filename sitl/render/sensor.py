"""What lens and sensor make of the light: blur, glare, fall-off to the corners, noise and the tone curve."""

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from sitl.render.exposure import Exposure
from sitl.render.glare import add_glare, find_glare, sample, small_rays

_TONE_STEPS = 4096
_N_NOISE = 1 << 18


@dataclass(frozen=True, slots=True)
class Optics:
    """Lens and sensor. The default is a small global-shutter camera with a fair lens.

    `blur_px` is the standard deviation of the lens's blur, `corner_light` the light in the image's corners compared
    with its middle, `read_noise` and `shot_noise` the noise of a dark and, added in quadrature and growing with the
    square root of the light, of a white pixel, in units of white, both at gain 1. `has_glare` says whether the lens
    scatters light.
    """

    blur_px: float = 0.55
    corner_light: float = 0.72
    read_noise: float = 0.003
    shot_noise: float = 0.018
    has_glare: bool = True


class Sensor:
    """Turns light into images; the same light, exposure and `seq` give the same image. `rays` is lens.ray_table's.

    At a higher gain a pixel is white with fewer electrons: the read noise grows with the gain, and the shot noise,
    which is the square root of the electrons' number, with its square root.
    """

    def __init__(self, rays: NDArray[np.float32], optics: Optics, seed: int) -> None:
        self._optics = optics
        self._seed = seed
        self._directions = small_rays(rays)
        self._fall_off = fall_off(rays.shape[2], rays.shape[1], optics.corner_light)
        self._noise = noise_table(seed)
        self._tone = tone_curve()

    def expose(
        self, light: NDArray[np.float32], exposure: Exposure, seq: int, sun_camera: NDArray[np.float64]
    ) -> NDArray[np.uint8]:
        """The image (height, width, 3) uint8 BGR of `light` (height, width, 3) float32 BGR; `seq` chooses the noise.

        Light is linear, in units of a white sheet at a clear noon; `sun_camera` is find_glare()'s.
        """
        optics = self._optics
        glare = self.glare(light, exposure, sun_camera)
        seen = blur(light, optics.blur_px)
        if glare is not None:
            seen = add_glare(seen.copy() if seen is light else seen, glare)
        height_px, width_px = light.shape[:2]
        image = np.empty((height_px, width_px, 3), dtype=np.uint8)
        rng = np.random.default_rng((self._seed, seq))
        develop(
            seen.reshape(height_px, -1),
            self._fall_off,
            exposure.scale,
            optics.read_noise * exposure.gain,
            optics.shot_noise * math.sqrt(exposure.gain),
            self._noise,
            rng.integers(0, len(self._noise) - 3 * width_px, height_px),
            self._tone,
            image.reshape(height_px, -1),
        )
        return image

    def glare(
        self, light: NDArray[np.float32], exposure: Exposure, sun_camera: NDArray[np.float64]
    ) -> NDArray[np.float32] | None:
        """The glare over `light` on every eighth pixel, or None; see find_glare()."""
        if not self._optics.has_glare or not self._directions.size:
            return None
        return find_glare(sample(light), exposure.scale, self._directions, sun_camera)


def fall_off(width_px: int, height_px: int, corner_light: float) -> NDArray[np.float32]:
    """The part of the light that a lens lets through, 1 in the middle and less to the corners.

    (height, 3 * width) float32: once for each channel of a pixel, as develop() goes through them.
    """
    x = (np.arange(width_px) - (width_px - 1) / 2.0) / math.hypot(width_px, height_px) * 2.0
    y = (np.arange(height_px) - (height_px - 1) / 2.0) / math.hypot(width_px, height_px) * 2.0
    part = 1.0 - (1.0 - corner_light) * (x[None, :] ** 2 + y[:, None] ** 2)
    return np.repeat(part.astype(np.float32), 3, axis=1)


def blur(image: NDArray[np.float32], blur_px: float) -> NDArray[np.float32]:
    """The image after the lens's blur; `blur_px` of 0 leaves it as it is."""
    if blur_px <= 0.0:
        return image
    side = 2 * math.ceil(2.0 * blur_px) + 1
    return np.asarray(cv2.GaussianBlur(image, (side, side), blur_px, borderType=cv2.BORDER_REPLICATE), np.float32)


def tone_curve() -> NDArray[np.uint8]:
    """The sRGB transfer function (IEC 61966-2-1) as a table over linear light 0 to 1: (4096,) uint8."""
    linear = np.arange(_TONE_STEPS) / (_TONE_STEPS - 1)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return np.round(255.0 * encoded).astype(np.uint8)


def noise_table(seed: int) -> NDArray[np.float32]:
    """A stock of standard normal numbers, (2^18,) float32, that develop() starts reading elsewhere for every row."""
    return np.random.default_rng(seed).standard_normal(_N_NOISE, dtype=np.float32)


@njit(nogil=True, cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def develop(
    light: NDArray[np.float32],
    fall_off: NDArray[np.float32],
    exposure: float,
    read_noise: float,
    shot_noise: float,
    noise: NDArray[np.float32],
    row_starts: NDArray[np.int64],
    tone: NDArray[np.uint8],
    image: NDArray[np.uint8],
) -> None:
    """Turn linear light into an image.

    `light` (height, 3 * width) float32 and `image` (height, 3 * width) uint8 go through the channels of one pixel
    after the other; `fall_off` is fall_off()'s, `noise` noise_table()'s, where `row_starts` (height,) int64 says where
    each row reads; `tone` is tone_curve()'s.
    """
    n = light.shape[1]
    white = np.float32(len(tone) - 1)
    read2, shot2 = np.float32(read_noise * read_noise), np.float32(shot_noise * shot_noise)
    zero, half, gain = np.float32(0.0), np.float32(0.5), np.float32(exposure)
    steps = np.empty(n, dtype=np.int32)
    for v in range(light.shape[0]):
        # Two passes, so that the first becomes vector instructions; the second is a table.
        grain = noise[row_starts[v] : row_starts[v] + n]
        for i in range(n):
            value = gain * fall_off[v, i] * light[v, i]
            value += np.sqrt(read2 + shot2 * value) * grain[i]
            steps[i] = np.int32(min(max(value * white + half, zero), white))
        for i in range(n):
            image[v, i] = tone[steps[i]]
