"""The lines along roads, the rails, the fences: what of the strips on the ground is thin enough to be linework."""

import itertools
import math

import numpy as np
from numpy.typing import NDArray

from sitl.world.height_grid import HeightGrid
from sitl.world.records import Strip

Decal = tuple[NDArray[np.float64], tuple[float, float, float]]

_WHITE = (0.62, 0.64, 0.64)
_STEP_M = 4.0
_DASH_M, _DASH_GAP_M = 3.0, 6.0
_GAUGE_M = 1.435
_POST_GAP_M = 3.0
_RAIL_UP_M = 0.14
_MOST_PER_OBJECT = 60


def decals_of(strips: tuple[Strip, ...], terrain: HeightGrid) -> list[Decal]:
    """Painted lines as ribbons (n, 9) with their linear BGR: edge lines, and dashes where a road has two lanes."""
    found: list[Decal] = []
    for strip in strips:
        if strip.kind != "road":
            continue
        half_m = strip.width_m / 2.0
        if half_m > 2.0:
            sides_m = (-(half_m - 0.22), half_m - 0.22)
            found += [(_bars(_walk(strip, side_m, _STEP_M), terrain, 0.12, 0.0), _WHITE) for side_m in sides_m]
        if half_m > 2.4:
            middle = _walk(strip, 0.0, _DASH_M)
            dashes = middle[:-1:3], middle[1::3]
            n = min(len(d) for d in dashes)
            found.append((_between(dashes[0][:n], dashes[1][:n], terrain, 0.12, 0.0), _WHITE))
    return [(rows, bgr) for rows, bgr in found if len(rows)]


def rails_of(strips: tuple[Strip, ...], terrain: HeightGrid) -> list[NDArray[np.float64]]:
    """The rails of all railways, as objects (n, 9) of round bars."""
    found = []
    for strip in strips:
        if strip.kind == "railway":
            for side_m in (-_GAUGE_M / 2.0, _GAUGE_M / 2.0):
                rows = _bars(_walk(strip, side_m, _STEP_M), terrain, 0.075, _RAIL_UP_M)
                found += np.split(rows, range(_MOST_PER_OBJECT, len(rows), _MOST_PER_OBJECT))
    return [rows for rows in found if len(rows)]


def fences_of(strips: tuple[Strip, ...], terrain: HeightGrid) -> list[NDArray[np.float64]]:
    """Posts and wires of all fences, as objects (n, 9) of round bars."""
    found = []
    for strip in strips:
        if strip.kind != "fence":
            continue
        places = _walk(strip, 0.0, _POST_GAP_M)
        feet = np.array([[n, e, -terrain.at(n, e)] for n, e in places])
        posts = np.hstack([feet, feet - [0.0, 0.0, 1.25], np.tile([0.11, 0.09, 1.0], (len(feet), 1))])
        wires = [
            np.hstack([feet[:-1] - [0, 0, up], feet[1:] - [0, 0, up], np.tile([0.004, 0.004, 1.6], (len(feet) - 1, 1))])
            for up in (0.35, 0.75, 1.15)
        ]
        for first in range(0, len(feet), 12):
            found.append(posts[first : first + 12])
            found.append(np.concatenate([wire[first : first + 12] for wire in wires]))
    return [rows for rows in found if len(rows)]


def _walk(strip: Strip, side_m: float, step_m: float) -> NDArray[np.float64]:
    """Places (n, 2) north, east [m] along a strip, `side_m` right of its middle, about `step_m` apart."""
    points = np.array(strip.points_ne_m, dtype=np.float64)
    along = np.diff(points, axis=0)
    length_m = np.maximum(1e-9, np.hypot(along[:, 0], along[:, 1]))
    right = np.stack([-along[:, 1], along[:, 0]], axis=1) / length_m[:, None]
    joint = np.concatenate([right[:1], right[:-1] + right[1:], right[-1:]])
    # At a joint the side line lies on the bisector, farther out the sharper the turn.
    joint /= np.maximum(0.2, np.sum(joint * np.concatenate([right[:1], right]), axis=1))[:, None]
    moved = points + side_m * joint
    pieces = [moved[:1]]
    for (start, end), long_m in zip(itertools.pairwise(moved), length_m, strict=True):
        n = max(1, math.ceil(long_m / step_m - 1e-6))
        pieces.append(start + (end - start) * (np.arange(1, n + 1) / n)[:, None])
    return np.concatenate(pieces)


def _bars(places: NDArray[np.float64], terrain: HeightGrid, width_m: float, up_m: float) -> NDArray[np.float64]:
    return _between(places[:-1], places[1:], terrain, width_m, up_m)


def _between(
    starts: NDArray[np.float64], ends: NDArray[np.float64], terrain: HeightGrid, width_m: float, up_m: float
) -> NDArray[np.float64]:
    """Members (n, 9) between places on the terrain, `up_m` [m] over it."""
    rows = [
        [*start, -terrain.at(*start) - up_m, *end, -terrain.at(*end) - up_m, width_m, width_m, 1.0]
        for start, end in zip(starts.tolist(), ends.tolist(), strict=True)
    ]
    return np.array(rows, dtype=np.float64).reshape(-1, 9)
