"""Paints the open ground: fields in several states, row crops, bare patches, the rough grass between them."""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from sitl.render.colour import stored
from sitl.render.noise import plane_noise
from sitl.world.records import Ground, GroundStyle

COARSE_M = 0.4
# How wide a style's fields are [m], which parts of them bear a row crop and are ploughed, how moist they are on the
# whole, and how readily bare ground shows.
_STYLES: dict[GroundStyle, tuple[float, float, float, float, float]] = {
    "pasture": (62.0, 0.14, 0.14, 0.0, 0.0),
    "meadow": (90.0, 0.0, 0.0, 0.5, -0.5),
    "cropland": (75.0, 0.5, 0.25, -0.3, 0.0),
    "forest_floor": (150.0, 0.0, 0.0, 0.2, 1.1),
    "village": (28.0, 0.08, 0.04, 0.3, 0.1),
}
_BEND_M = 1.6
_LUSH = stored(74, 98, 44)
_MEADOW = stored(104, 118, 60)
_STRAW = stored(164, 150, 98)
_TUFT = stored(54, 76, 36)
_SOIL = stored(134, 109, 82)
PALETTE = np.array([_LUSH, _MEADOW, _STRAW, _TUFT, _SOIL], dtype=np.float64)


def lay_out(
    ground: Ground, size_m: tuple[float, float], rng: np.random.Generator
) -> tuple[NDArray[np.float32], NDArray[np.int32], NDArray[np.float32]]:
    """Divide the ground into fields.

    Returns `coarse` (rows, columns, 4) float32 over the whole of `size_m` (north, east) [m]: how moist the grass is,
    light and dark patches, where the soil shows, distance to the next field [m]; `owner` (rows, columns) int32, the
    field that each place belongs to; and `kinds` (n, 5) float32: moisture, row crop, ploughed, and the rows' direction
    as cosine and sine over their spacing [1/m].
    """
    shape = tuple(max(8, round(side / COARSE_M)) for side in size_m)
    field_m, crops, ploughed, moist, bare = _STYLES[ground.style]
    n_fields = max(3, round(size_m[0] * size_m[1] / field_m**2))
    seeds = rng.uniform((0.0, 0.0), size_m, (n_fields, 2))
    bend = _BEND_M * np.stack([plane_noise(shape, 40.0, 3, rng), plane_noise(shape, 40.0, 3, rng)])
    owner, border_m = divide(seeds, bend, size_m[0] / shape[0], size_m[1] / shape[1])
    kinds = np.zeros((n_fields, 5), dtype=np.float32)
    kinds[:, 0] = rng.normal(moist, 1.0, n_fields)
    use = (rng.permutation(n_fields) + 0.5) / n_fields
    kinds[:, 1] = use < crops
    kinds[:, 2] = use > 1.0 - ploughed
    turn = rng.uniform(0.0, math.pi, n_fields)
    spacing_m = rng.uniform(0.7, 1.5, n_fields)
    kinds[:, 3], kinds[:, 4] = np.cos(turn) / spacing_m, np.sin(turn) / spacing_m
    coarse = np.stack(
        [
            plane_noise(shape, 120.0, 5, rng) + 1.1 * kinds[owner, 0],
            plane_noise(shape, 32.0, 5, rng),
            plane_noise(shape, 16.0, 4, rng) + bare,
            border_m,
        ],
        axis=-1,
    )
    return np.ascontiguousarray(coarse, dtype=np.float32), owner, kinds


@njit(nogil=True, cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def divide(
    seeds: NDArray[np.float64], bend: NDArray[np.float32], step_north_m: float, step_east_m: float
) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """Which of the `seeds` (n, 2) [m] each place is nearest to, and how far it is to the border with the next [m].

    `bend` (2, rows, columns) float32 [m] is by how much each place counts as moved.
    """
    owner = np.empty(bend.shape[1:], dtype=np.int32)
    border_m = np.empty(bend.shape[1:], dtype=np.float32)
    for i in range(bend.shape[1]):
        for j in range(bend.shape[2]):
            north_m = (i + 0.5) * step_north_m + bend[0, i, j]
            east_m = (j + 0.5) * step_east_m + bend[1, i, j]
            nearest, second, who = np.inf, np.inf, 0
            for k in range(seeds.shape[0]):
                square = (seeds[k, 0] - north_m) ** 2 + (seeds[k, 1] - east_m) ** 2
                if square < nearest:
                    nearest, second, who = square, nearest, k
                elif square < second:
                    second = square
            owner[i, j] = who
            border_m[i, j] = 0.5 * (math.sqrt(second) - math.sqrt(nearest))
    return owner, border_m


@njit(nogil=True, cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def rise(low: float, high: float, x: float) -> float:
    """The smooth step from 0 at `low` to 1 at `high`."""
    t = min(1.0, max(0.0, (x - low) / (high - low)))
    return t * t * (3.0 - 2.0 * t)


@njit(nogil=True, cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def paint_fields(
    picture: NDArray[np.uint8],
    first_row: int,
    last_row: int,
    coarse: NDArray[np.float32],
    owner: NDArray[np.int32],
    kinds: NDArray[np.float32],
    fine: NDArray[np.float32],
    palette: NDArray[np.float64],
    texel_m: NDArray[np.float64],
) -> None:
    """Paint grass, soil and crop rows into `picture` (rows, columns, 4) uint8, from `first_row` to before `last_row`.

    `coarse`, `owner` and `kinds` are lay_out's and cover the whole picture. `fine` (m, m) float32 repeats texel by
    texel; m is a power of two. `palette` is PALETTE, `texel_m` (north, east).
    """
    fine_mask = fine.shape[0] - 1
    n, m = coarse.shape[0], coarse.shape[1]
    ratio_y, ratio_x = n / picture.shape[0], m / picture.shape[1]
    here = np.empty(4)
    for i in range(first_row, last_row):
        north_m = (i + 0.5) * texel_m[0]
        y = min(n - 1.001, max(0.0, (i + 0.5) * ratio_y - 0.5))
        i0 = int(y)
        fy = y - i0
        for j in range(picture.shape[1]):
            east_m = (j + 0.5) * texel_m[1]
            x = min(m - 1.001, max(0.0, (j + 0.5) * ratio_x - 0.5))
            j0 = int(x)
            fx = x - j0
            for c in range(4):
                upper = coarse[i0, j0, c] * (1.0 - fx) + coarse[i0, j0 + 1, c] * fx
                lower = coarse[i0 + 1, j0, c] * (1.0 - fx) + coarse[i0 + 1, j0 + 1, c] * fx
                here[c] = upper * (1.0 - fy) + lower * fy
            grain = float(fine[i & fine_mask, j & fine_mask])
            grain2 = float(fine[(3 * i + 517) & fine_mask, (3 * j + 211) & fine_mask])
            field = owner[i0 + (1 if fy > 0.5 else 0), j0 + (1 if fx > 0.5 else 0)]

            moist = here[0] + 0.35 * grain
            lush, straw = rise(0.1, 1.6, moist), rise(0.1, 1.7, -moist)
            tuft = 0.6 * rise(0.5, 2.3, grain + 0.6 * here[1])
            tuft = max(tuft, 0.7 * rise(1.3, 0.2, here[3] + 0.4 * grain))
            shade = 1.0 + 0.06 * here[1] + 0.06 * grain + 0.045 * grain2
            soil = rise(1.55, 2.1, here[2] + 0.35 * grain + 0.25 * here[1])
            inside = rise(1.5, 2.5, here[3])
            crop, ploughed = kinds[field, 1] * inside, kinds[field, 2] * inside
            if crop > 0.0 or ploughed > 0.0:
                # Dark leaves and soil in turns, or furrows, fading out at the field's edge.
                turn = 2.0 * math.pi * (north_m * kinds[field, 3] + east_m * kinds[field, 4])
                rows = 0.5 + 0.5 * math.sin(turn + 0.4 * grain)
                soil = max(soil, 0.8 * crop * rise(0.5, 0.9, rows + 0.15 * grain), 0.95 * ploughed)
                tuft = max(tuft * (1.0 - ploughed), 0.6 * crop * (1.0 - rows))
                shade *= 1.0 - 0.13 * ploughed * rows
            for c in range(3):
                value = palette[1, c] + lush * (palette[0, c] - palette[1, c])
                value += straw * (palette[2, c] - value)
                value += tuft * (palette[3, c] - value)
                value += soil * (palette[4, c] - value)
                picture[i, j, c] = int(min(255.0, max(0.0, 255.0 * value * shade + 0.5)))
            picture[i, j, 3] = int(170.0 - 85.0 * soil + 0.5)
