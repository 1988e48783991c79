"""Paints what the ground's coarse picture is too coarse to hold: blades of grass, crumbs of soil, leaves."""

import cv2
import numpy as np
from numpy.typing import NDArray

from sitl.render.noise import periodic_noise

SIDE = 2048
_CONTRAST = 0.115  # standard deviation of the brightness, of 1; the textures' channels hold +- 4 of it
_MARGIN_PX = 64


def paint_detail(rng: np.random.Generator) -> NDArray[np.uint8]:
    """The detail picture (2048, 2048, 4) uint8 as GroundTexture.detail has it: soil, grass, leaves, hue; it tiles."""
    grass = _strokes(rng, n_rounds=30, n_each=2200, length_px=(8.0, 30.0), thickness=(1, 2))
    leaves = _strokes(rng, n_rounds=16, n_each=2000, length_px=(4.0, 12.0), thickness=(4, 9))
    soil = periodic_noise(SIDE, 64, 6, rng, persistence=0.85) + 0.7 * _pebbles(rng)
    hue = periodic_noise(SIDE, 16, 6, rng, persistence=0.75)
    channels = [_even_out(channel) for channel in (soil, grass, leaves, hue)]
    return np.ascontiguousarray(np.stack(channels, axis=-1))


def _strokes(
    rng: np.random.Generator, *, n_rounds: int, n_each: int, length_px: tuple[float, float], thickness: tuple[int, int]
) -> NDArray[np.float32]:
    """Short strokes of many brightnesses, one over the other."""
    canvas = np.full((SIDE, SIDE), 110, dtype=np.uint8)
    for brightness in rng.permutation(np.linspace(30.0, 220.0, n_rounds)):
        middle = rng.uniform(0.0, SIDE, (n_each, 2))
        angle = rng.uniform(0.0, np.pi, n_each)
        half = 0.5 * rng.uniform(*length_px, n_each)[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        width = int(rng.integers(thickness[0], thickness[1] + 1))
        for shift in _wraps(middle):
            near = np.all((shift > -_MARGIN_PX) & (shift < SIDE + _MARGIN_PX), axis=-1)
            ends = np.stack([shift[near] - half[near], shift[near] + half[near]], axis=1)
            cv2.polylines(canvas, list(np.round(16 * ends).astype(np.int32)), False, brightness, width, cv2.LINE_AA, 4)
    return canvas.astype(np.float32)


def _pebbles(rng: np.random.Generator) -> NDArray[np.float32]:
    """Small light and dark stones on an even ground, standard deviation about 1."""
    canvas = np.full((SIDE, SIDE), 128, dtype=np.uint8)
    middle = rng.uniform(0.0, SIDE, (9000, 2))
    radius = rng.gamma(2.0, 1.1, len(middle)) + 0.8
    brightness = rng.uniform(60.0, 230.0, len(middle))
    for shift in _wraps(middle):
        near = np.flatnonzero(np.all((shift > -_MARGIN_PX) & (shift < SIDE + _MARGIN_PX), axis=-1))
        for k in near:
            centre = (round(16 * shift[k, 0]), round(16 * shift[k, 1]))
            cv2.circle(canvas, centre, round(16 * radius[k]), brightness[k], -1, cv2.LINE_AA, 4)
    return (canvas.astype(np.float32) - 128.0) / 30.0


def _wraps(middle: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """The places and their eight copies in the neighbouring tiles, so that what lies on an edge shows on both sides."""
    return [middle + SIDE * np.array([i, j]) for i in (0, -1, 1) for j in (0, -1, 1)]


def _even_out(channel: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Take the large shapes out, whose repetition would show, and scale to 0.5 +- the contrast."""
    pad = SIDE // 4
    wrapped = np.pad(channel, pad, mode="wrap")
    small = cv2.resize(wrapped, None, fx=0.125, fy=0.125, interpolation=cv2.INTER_AREA)
    large = cv2.resize(cv2.GaussianBlur(small, (0, 0), 8.0), wrapped.shape[::-1], interpolation=cv2.INTER_LINEAR)
    rest = (wrapped - large)[pad:-pad, pad:-pad]
    value = 0.5 + _CONTRAST * (rest - rest.mean()) / rest.std()
    return np.asarray(np.clip(np.round(255.0 * value), 0, 255), dtype=np.uint8)
