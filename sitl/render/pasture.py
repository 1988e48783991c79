"""Paints the ground of a pasture: fields of grass in several states, bare patches, a farm track, hedges and trees."""

import itertools
import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from sitl.render.detail import paint_detail
from sitl.render.ground import GroundTexture, build_texture
from sitl.render.noise import periodic_noise
from sitl.render.vegetation import Plant, paint_plants
from sitl.world.records import Ground, Light

TEXEL_M = 0.05
DETAIL_TEXEL_M = 0.005
_SIDE = 4096
_PERIOD_M = _SIDE * TEXEL_M
_COARSE = 1024
_N_FIELDS = 14
_CLEARANCE_M = 6.5  # nothing grows taller than grass this near to the line or to the take-off point


def _stored(red: int, green: int, blue: int) -> tuple[float, float, float]:
    """An sRGB colour as the texture stores it: BGR, square root of linear light."""

    def root(value: int) -> float:
        v = value / 255.0
        return math.sqrt(v / 12.92 if v <= 0.04045 else ((v + 0.055) / 1.055) ** 2.4)

    return root(blue), root(green), root(red)


_LUSH = _stored(82, 108, 48)
_MEADOW = _stored(116, 130, 66)
_STRAW = _stored(170, 156, 102)
_TUFT = _stored(60, 84, 40)
_SOIL = _stored(142, 116, 86)
_TRACK = _stored(186, 166, 134)
_PALETTE = np.array([_LUSH, _MEADOW, _STRAW, _TUFT, _SOIL, _TRACK], dtype=np.float64)


def paint_pasture(ground: Ground, sun: Light, axis_ne_m: tuple[tuple[float, float], ...]) -> GroundTexture:
    """Paint the ground round a line with poles at `axis_ne_m` (north, east) [m]; same input, same ground."""
    rng = np.random.default_rng(ground.seed)
    fields = _lay_out_fields(rng)
    coarse = np.stack(
        [
            periodic_noise(_COARSE, 4, 5, rng) + 1.1 * fields[..., 0],  # how moist the grass is
            periodic_noise(_COARSE, 16, 5, rng),  # light and dark patches
            periodic_noise(_COARSE, 32, 4, rng),  # where the soil shows
            fields[..., 1],  # distance to the next field [m]
            fields[..., 2],  # how much of a row crop it is
        ],
        axis=-1,
    ).astype(np.float32)
    fine = periodic_noise(_COARSE, 64, 5, rng, persistence=0.8)
    picture = np.empty((_SIDE, _SIDE, 4), dtype=np.uint8)
    paint_fields(picture, coarse, fine, _PALETTE, TEXEL_M)
    paint_plants(picture, _plants(axis_ne_m, fields[..., 1], rng), TEXEL_M, sun, rng)
    return GroundTexture(build_texture(picture, TEXEL_M), build_texture(paint_detail(rng), DETAIL_TEXEL_M))


def _lay_out_fields(rng: np.random.Generator) -> NDArray[np.float32]:
    """Divide the ground: (side, side, 3) float32 of moisture, distance to the next field [m], and row crop 0 or 1."""
    seeds = rng.uniform(0.0, _PERIOD_M, (_N_FIELDS, 2)).astype(np.float32)
    moisture = rng.normal(0.0, 1.0, _N_FIELDS)
    crop = (np.arange(_N_FIELDS) % 5 == 0).astype(np.float64)
    steps = (np.arange(_COARSE, dtype=np.float32) + np.float32(0.5)) * np.float32(_PERIOD_M / _COARSE)
    period_m = np.float32(_PERIOD_M)
    bend = np.float32(5.0) * np.stack([periodic_noise(_COARSE, 4, 3, rng), periodic_noise(_COARSE, 4, 3, rng)])
    nearest = np.full((_COARSE, _COARSE), np.inf, dtype=np.float32)
    second = nearest.copy()
    owner = np.zeros((_COARSE, _COARSE), dtype=np.int64)
    for k, (north_m, east_m) in enumerate(seeds):
        dn = steps[:, None] + bend[0] - north_m
        de = steps[None, :] + bend[1] - east_m
        dn -= period_m * np.round(dn / period_m)
        de -= period_m * np.round(de / period_m)
        distance = np.sqrt(dn * dn + de * de)
        second = np.minimum(second, np.maximum(distance, nearest))
        owner[distance < nearest] = k
        nearest = np.minimum(nearest, distance)
    border_m = 0.5 * (second - nearest)
    return np.stack([moisture[owner], border_m, crop[owner]], axis=-1).astype(np.float32)


def _plants(
    axis_ne_m: tuple[tuple[float, float], ...], border_m: NDArray[np.float32], rng: np.random.Generator
) -> list[Plant]:
    """Hedges between the fields, single trees and bushes in them; none on the line, the track or the take-off point."""
    axis = np.array(axis_ne_m).reshape(-1, 2)
    keep_clear = [np.zeros((1, 2))]
    for start, end in itertools.pairwise(axis):
        keep_clear.append(start + np.linspace(0.0, 1.0, 40)[:, None] * (end - start))
    clear = np.concatenate(keep_clear)

    plants = []
    for place in rng.uniform(0.0, _PERIOD_M, (5200, 2)):
        i, j = (place / _PERIOD_M * _COARSE).astype(int)
        is_hedge = border_m[i, j] < 0.9 and rng.random() < 0.8
        if not is_hedge and rng.random() > 0.035:
            continue
        if is_hedge:
            radius_m = rng.uniform(0.5, 1.3) if rng.random() < 0.85 else rng.uniform(1.8, 3.2)
        else:
            radius_m = rng.uniform(0.35, 0.8) if rng.random() < 0.6 else rng.uniform(1.5, 3.6)
        offset = np.abs(clear - place) % _PERIOD_M
        gap_m = float(np.hypot(*np.minimum(offset, _PERIOD_M - offset).T).min())
        if gap_m - radius_m < (_CLEARANCE_M if radius_m > 1.0 else 1.5):
            continue
        track_m, _ = track_at(place[0], _PERIOD_M)
        away_m = abs(place[1] - track_m)
        if min(away_m, _PERIOD_M - away_m) - radius_m < 2.0:
            continue
        plants.append(Plant(float(place[0]), float(place[1]), float(radius_m)))
    return plants


@njit(nogil=True, cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def track_at(north_m: float, period_m: float) -> tuple[float, float]:
    """Where the middle of the farm track, which winds northward, is at that northing.

    Returns its easting [m], and the cosine between its direction and north.
    """
    turn = 2.0 * math.pi * north_m / period_m
    east_m = 16.0 + 9.0 * math.sin(turn) + 2.5 * math.sin(3.0 * turn + 1.0)
    slope = (9.0 * math.cos(turn) + 7.5 * math.cos(3.0 * turn + 1.0)) * 2.0 * math.pi / period_m
    return east_m, 1.0 / math.sqrt(1.0 + slope * slope)


@njit(nogil=True, cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def _rise(low: float, high: float, x: float) -> float:
    """The smooth step from 0 at `low` to 1 at `high`."""
    t = min(1.0, max(0.0, (x - low) / (high - low)))
    return t * t * (3.0 - 2.0 * t)


@njit(nogil=True, cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def paint_fields(
    picture: NDArray[np.uint8],
    coarse: NDArray[np.float32],
    fine: NDArray[np.float32],
    palette: NDArray[np.float64],
    texel_m: float,
) -> None:
    """Paint grass, soil, crop rows and track into `picture` (side, side, 4) uint8, as GroundTexture.surface has it.

    `coarse` (n, n, 5) float32 covers the whole picture: moisture, patches, soil, distance to the next field [m], crop.
    `fine` (m, m) float32 repeats texel by texel; n and m are powers of two.
    `palette` is (6, 3): lush, meadow, straw, tuft, soil, track.
    """
    side, n = picture.shape[0], coarse.shape[0]
    coarse_mask, fine_mask = n - 1, fine.shape[0] - 1
    ratio = n / side
    period_m = side * texel_m
    here, colour = np.empty(5), np.empty(3)
    for i in range(side):
        north_m = (i + 0.5) * texel_m
        track_m, track_cosine = track_at(north_m, period_m)
        y = (i + 0.5) * ratio - 0.5
        i0 = math.floor(y)
        fy = y - i0
        i1, i0 = (i0 + 1) & coarse_mask, i0 & coarse_mask
        for j in range(side):
            east_m = (j + 0.5) * texel_m
            x = (j + 0.5) * ratio - 0.5
            j0 = math.floor(x)
            fx = x - j0
            j1, j0 = (j0 + 1) & coarse_mask, j0 & coarse_mask
            for c in range(5):
                upper = coarse[i0, j0, c] * (1.0 - fx) + coarse[i0, j1, c] * fx
                lower = coarse[i1, j0, c] * (1.0 - fx) + coarse[i1, j1, c] * fx
                here[c] = upper * (1.0 - fy) + lower * fy
            grain = float(fine[i & fine_mask, j & fine_mask])
            grain2 = float(fine[(3 * i + 517) & fine_mask, (3 * j + 211) & fine_mask])

            moist = here[0] + 0.35 * grain
            lush, straw = _rise(0.1, 1.6, moist), _rise(0.1, 1.7, -moist)
            tuft = 0.6 * _rise(0.5, 2.3, grain + 0.6 * here[1])
            tuft = max(tuft, 0.7 * _rise(1.3, 0.2, here[3] + 0.4 * grain))
            shade = 1.0 + 0.055 * here[1] + 0.05 * grain + 0.035 * grain2
            soil = _rise(1.55, 2.1, here[2] + 0.35 * grain + 0.25 * here[1])
            crop = here[4] * _rise(1.5, 2.5, here[3])
            if crop > 0.0:
                # Dark leaves and soil in turns, fading out at the field's edge.
                turn = 2.0 * math.pi * (north_m * 32.0 + east_m * 128.0) / period_m
                rows = 0.5 + 0.5 * math.sin(turn + 0.5 * grain)
                soil = max(soil, 0.75 * crop * _rise(0.55, 0.95, rows + 0.15 * grain))
                tuft = max(tuft, 0.6 * crop * (1.0 - rows))

            away_m = abs(east_m - track_m)
            away_m = min(away_m, period_m - away_m) * track_cosine
            rut = 0.95 * _rise(0.46, 0.14, abs(away_m - 0.8) + 0.05 * grain + 0.03 * grain2)
            worn = 0.5 * _rise(2.1, 0.9, away_m + 0.3 * grain)
            earth = max(soil, rut, 0.6 * worn)
            for c in range(3):
                value = palette[1, c] + lush * (palette[0, c] - palette[1, c])
                value += straw * (palette[2, c] - value)
                value += tuft * (palette[3, c] - value)
                value += worn * (palette[2, c] - value)
                value += soil * (palette[4, c] - value)
                value += rut * (palette[5, c] - value)
                colour[c] = value * shade
                picture[i, j, c] = int(min(255.0, max(0.0, 255.0 * colour[c] + 0.5)))
            picture[i, j, 3] = int(127.5 * (1.0 - earth) + 0.5)
