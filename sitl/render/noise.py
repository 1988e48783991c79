"""Noise that repeats without a seam, from which the ground is painted."""

import math

import cv2
import numpy as np
from numpy.typing import NDArray

_PAD = 3  # cells copied round the edge, so that the interpolation sees its neighbours across the seam


def periodic_noise(
    side: int, n_cells: int, n_octaves: int, rng: np.random.Generator, persistence: float = 0.5
) -> NDArray[np.float32]:
    """Fractal value noise (side, side) float32 of mean 0 and standard deviation 1, which tiles.

    The coarsest octave has `n_cells` cells a side, each further one twice as many and `persistence` times the
    amplitude. `side` must be a multiple of the finest octave's cells; raises ValueError otherwise.
    """
    if side % (n_cells << (n_octaves - 1)):
        raise ValueError(f"{n_cells << (n_octaves - 1)} cells do not fit evenly into {side} pixels.")
    total = np.zeros((side, side), dtype=np.float32)
    for octave in range(n_octaves):
        n = n_cells << octave
        scale = side // n
        grid = np.pad(rng.standard_normal((n, n), dtype=np.float32), _PAD, mode="wrap")
        large = cv2.resize(grid, None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC)
        edge = _PAD * scale
        total += persistence**octave * large[edge : edge + side, edge : edge + side]
    return np.asarray((total - total.mean()) / total.std(), dtype=np.float32)


def plane_noise(
    shape: tuple[int, ...], cell_px: float, n_octaves: int, rng: np.random.Generator, persistence: float = 0.5
) -> NDArray[np.float32]:
    """Fractal value noise (rows, columns) float32 of mean 0 and standard deviation 1, which does not tile.

    The coarsest octave's cells are `cell_px` wide, each further one's half as wide with `persistence` the amplitude.
    """
    total = np.zeros(shape, dtype=np.float32)
    for octave in range(n_octaves):
        cell = max(1.0, cell_px / 2**octave)
        n = [math.ceil(side / cell) + 2 * _PAD for side in shape]
        grid = rng.standard_normal(n, dtype=np.float32)
        y, x = ((np.arange(side, dtype=np.float32) + 0.5) / cell + 1.0 for side in shape)
        columns, rows = np.meshgrid(x, y)
        total += persistence**octave * cv2.remap(grid, columns, rows, cv2.INTER_CUBIC)
    return np.asarray((total - total.mean()) / max(1e-6, total.std()), dtype=np.float32)
