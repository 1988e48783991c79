"""The picture of a world's ground, painted once and kept on disk."""

import functools
import itertools
import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sitl.render.cache import key_of, recall
from sitl.render.detail import SIDE, paint_detail
from sitl.render.fields import PALETTE, lay_out, paint_fields
from sitl.render.noise import periodic_noise
from sitl.render.roofs import ROOF_PALETTE, house_rows, paint_houses
from sitl.render.strips import STRIP_PALETTE, paint_strips, strip_rows
from sitl.render.texture import Texture, build_texture, fill_levels, finest, layout
from sitl.render.vegetation import CROWN_PALETTE, paint_crowns, paint_litter
from sitl.world.records import Building, Ground, Strip, Tree, World
from sitl.world.surface import tree_rows

VERSION = 1
"""Of the painter: raise it with every change of what it paints, or old pictures would be taken from disk."""
TEXEL_M = 0.05
DETAIL_TEXEL_M = 0.005
_MOST_TEXELS = 48_000_000
_MOST_SIDE = 20_000  # cv2.remap reaches 32767
_UNIT = 128  # sides are multiples of it, so that every mip level halves evenly
_FINE = 1024
_N_BANDS = 8


@dataclass(frozen=True, slots=True, eq=False)
class GroundTexture:
    """How a ground looks. Colours are stored as the square root of linear light: cheap to undo, and fine in the dark.

    `surface` is blue, green and red albedo, and cover: 0 smooth, 1/3 bare soil, 2/3 grass, 1 leaves. `detail` is what
    the surface is too coarse to hold, as brightness around 0.5 of soil, grass and leaves, and in the fourth channel its
    hue.
    """

    surface: Texture
    detail: Texture


def ground_of(world: World) -> GroundTexture:
    """The ground of a world: painted, which takes seconds, or from the last time."""
    return _ground(world.terrain.bounds_ne_m, world.ground, world.strips, world.buildings, world.trees)


@functools.lru_cache(maxsize=2)
def _ground(
    bounds_ne_m: tuple[float, float, float, float],
    ground: Ground,
    strips: tuple[Strip, ...],
    buildings: tuple[Building, ...],
    trees: tuple[Tree, ...],
) -> GroundTexture:
    south_m, west_m, north_m, east_m = bounds_ne_m
    size_m = (north_m - south_m, east_m - west_m)
    n_rows, n_columns = picture_size(size_m)
    shape, levels = layout(n_rows, n_columns)

    def paint() -> NDArray[np.uint8]:
        atlas = np.zeros((*shape, 4), dtype=np.uint8)
        _paint(finest(atlas, levels), bounds_ne_m, ground, strips, buildings, trees)
        fill_levels(atlas, levels, repeats=False)
        return atlas

    key = key_of("surface", VERSION, n_rows, n_columns, bounds_ne_m, ground, strips, buildings, trees)
    surface = Texture(recall(key, (*shape, 4), paint), levels, (south_m, west_m), size_m, repeats=False)
    return GroundTexture(surface, _detail(ground.seed))


@functools.lru_cache(maxsize=2)
def _detail(seed: int) -> Texture:
    side_m = SIDE * DETAIL_TEXEL_M
    shape = (SIDE, SIDE, 4)
    picture = recall(key_of("detail", VERSION, seed), shape, lambda: paint_detail(np.random.default_rng((seed, 1))))
    return build_texture(picture, (0.0, 0.0), (side_m, side_m), repeats=True)


def picture_size(size_m: tuple[float, float]) -> tuple[int, int]:
    """How many rows and columns of texels a ground of that size (north, east) [m] gets."""
    texel_m = max(TEXEL_M, math.sqrt(size_m[0] * size_m[1] / _MOST_TEXELS), max(size_m) / _MOST_SIDE)
    rows, columns = (max(1, round(side / texel_m / _UNIT)) * _UNIT for side in size_m)
    return rows, columns


def _paint(
    picture: NDArray[np.uint8],
    bounds_ne_m: tuple[float, float, float, float],
    ground: Ground,
    strips: tuple[Strip, ...],
    buildings: tuple[Building, ...],
    trees: tuple[Tree, ...],
) -> None:
    rng = np.random.default_rng(ground.seed)
    south_m, west_m, north_m, east_m = bounds_ne_m
    size_m = (north_m - south_m, east_m - west_m)
    texel_m = np.array(size_m) / picture.shape[:2]
    coarse, owner, kinds = lay_out(ground, size_m, rng)
    fine = periodic_noise(_FINE, 64, 5, rng, persistence=0.8)
    houses = house_rows(buildings)
    pieces = strip_rows(strips)
    standing = tree_rows(tuple(sorted(trees, key=lambda tree: tree.height_m)))

    def paint_band(first: int, last: int) -> None:
        band, corner_m = picture[first:last], np.array([south_m + first * texel_m[0], west_m])
        paint_fields(picture, first, last, coarse, owner, kinds, fine, PALETTE, texel_m)
        paint_houses(band, houses, ROOF_PALETTE, corner_m, texel_m, True)
        paint_litter(band, standing, CROWN_PALETTE, corner_m, texel_m)
        paint_strips(band, pieces, fine, STRIP_PALETTE, corner_m, texel_m)
        paint_houses(band, houses, ROOF_PALETTE, corner_m, texel_m, False)
        paint_crowns(band, standing, CROWN_PALETTE, corner_m, texel_m)

    edges = np.linspace(0, picture.shape[0], _N_BANDS + 1).astype(int).tolist()
    with ThreadPoolExecutor(2) as threads:
        for done in [threads.submit(paint_band, *band) for band in itertools.pairwise(edges)]:
            done.result()
