"""Nadir frames drawn for the tests: thin lines of exact pixel coverage over procedural ground."""

import math

import cv2
import numpy as np
from numpy.typing import NDArray

WIDTH_PX, HEIGHT_PX = 640, 480


def ground(
    seed: int, contrast: float = 14.0, width_px: int = WIDTH_PX, height_px: int = HEIGHT_PX
) -> NDArray[np.float64]:
    """Grass-like ground, (h, w) [grey levels]: noise of several scales and standard deviation `contrast`, no lines."""
    rng = np.random.default_rng(seed)
    total = np.zeros((height_px, width_px))
    for cell_px, amplitude in ((1, 0.6), (2, 0.8), (4, 1.0), (10, 1.0), (40, 1.2)):
        coarse = rng.normal(size=(height_px // cell_px + 2, width_px // cell_px + 2)).astype(np.float32)
        octave = cv2.resize(coarse, (width_px, height_px), interpolation=cv2.INTER_CUBIC)
        total += amplitude * octave / octave.std()
    levels: NDArray[np.float64] = 100.0 + contrast * total / total.std()
    return levels


def draw_line(
    levels: NDArray[np.float64], angle_rad: float, offset_px: float, width_px: float, level: float
) -> NDArray[np.float64]:
    """Blend a straight line into (h, w) grey levels; its angle and its offset are as in vision.records.LineEstimate."""
    height, width = levels.shape
    y, x = np.mgrid[:height, :width]
    aside = (x - (width - 1) / 2) * math.cos(angle_rad) + (y - (height - 1) / 2) * math.sin(angle_rad) - offset_px
    # A box one pixel wide slides over the line: the share of it that the line covers.
    coverage = np.clip(np.minimum(aside + 0.5, width_px / 2) - np.maximum(aside - 0.5, -width_px / 2), 0.0, 1.0)
    blended: NDArray[np.float64] = levels * (1.0 - coverage) + level * coverage
    return blended


def expose(levels: NDArray[np.float64], seed: int, noise: float = 2.0, blur_sigma_px: float = 0.5) -> NDArray[np.uint8]:
    """Lens blur, sensor noise and rounding to uint8."""
    blurred = cv2.GaussianBlur(levels, (0, 0), blur_sigma_px)
    noisy = blurred + np.random.default_rng(seed).normal(0.0, noise, levels.shape)
    return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)


def nadir_frame(
    seed: int,
    angle_rad: float,
    offset_px: float,
    spacing_px: float = 70.0,
    n_lines: int = 3,
    line_width_px: float = 1.2,
    level: float = 215.0,
    contrast: float = 14.0,
) -> NDArray[np.uint8]:
    """A frame with `n_lines` parallel conductors, `spacing_px` apart, whose middle runs at `angle_rad`, `offset_px`."""
    levels = ground(seed, contrast)
    for i in range(n_lines):
        levels = draw_line(levels, angle_rad, offset_px + (i - (n_lines - 1) / 2) * spacing_px, line_width_px, level)
    return expose(levels, seed + 1)
