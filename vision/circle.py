"""The search circle: a raster circle and its chords through the centre, worked out once for all searches."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vision.edges import N_DIRECTIONS, agrees


@dataclass(frozen=True, slots=True)
class Circle:
    """A raster circle's chords through its centre, one for each point of its rim.

    `chords` is (k, n, 2) int64 [px]: the points x, y of chord k from rim to rim. `wanted` is (k,) int64: the direction
    0 to 63 (vision.edges) of a gradient that points right of the chord, seen along it. `candidates` is (64, m) int64:
    for each direction of the centre's gradient the chords that agree with it, filled up with -1.
    """

    radius_px: int
    chords: NDArray[np.int64]
    wanted: NDArray[np.int64]
    candidates: NDArray[np.int64]


def raster_circle(radius_px: int) -> NDArray[np.int64]:
    """Rim of a raster circle around the origin, (k, 2) int64 x, y [px], in the order of the angle (Bresenham)."""
    if radius_px < 1:
        raise ValueError(f"A search circle of radius {radius_px} px has no rim: choose 1 px or more.")
    rim = set()
    x, y, error = radius_px, 0, 1 - radius_px
    while x >= y:
        for a, b in ((x, y), (y, x)):
            rim |= {(a, b), (a, -b), (-a, b), (-a, -b)}
        y += 1
        if error < 0:
            error += 2 * y + 1
        else:
            x -= 1
            error += 2 * (y - x) + 1
    return np.array(sorted(rim, key=lambda point: math.atan2(point[1], point[0])), dtype=np.int64)


def make_circle(radius_px: int) -> Circle:
    """Precompute the chords of a circle; raises ValueError for a radius below 1 px."""
    rim = raster_circle(radius_px)
    steps = np.arange(-radius_px, radius_px + 1)
    # The rim's points have a Chebyshev norm between r/sqrt(2) and r: 2 r + 1 samples never leave a hole.
    chords = np.rint(rim[:, None, :] * (steps / radius_px)[None, :, None]).astype(np.int64)
    # Right of the direction (dx, dy) is (-dy, dx): x right, y down.
    turns = np.arctan2(rim[:, 0], -rim[:, 1]) / (2 * math.pi)
    wanted = np.floor(turns * N_DIRECTIONS + 0.5).astype(np.int64) % N_DIRECTIONS
    agreeing = [np.flatnonzero([agrees(1 + seed, int(code)) for code in wanted]) for seed in range(N_DIRECTIONS)]
    candidates = np.full((N_DIRECTIONS, max(map(len, agreeing))), -1, dtype=np.int64)
    for seed, chosen in enumerate(agreeing):
        candidates[seed, : len(chosen)] = chosen
    return Circle(radius_px, chords, wanted, candidates)
