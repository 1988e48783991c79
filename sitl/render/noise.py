"""Noise that repeats without a seam, from which the ground is painted."""

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
