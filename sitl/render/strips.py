"""Paints what runs along over the ground: roads, farm tracks, railways, rivers, the foot of hedges and fences."""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from sitl.render.colour import stored
from sitl.render.fields import rise
from sitl.render.texel import blend
from sitl.world.records import Strip, StripKind
from sitl.world.surface import bumps, lattice

_KINDS: dict[StripKind, int] = {"road": 0, "track": 1, "railway": 2, "river": 3, "fence": 4, "hedge": 5}
# In what order they lie over each other.
_ORDER: tuple[StripKind, ...] = ("river", "fence", "track", "road", "railway", "hedge")
_MARGIN_M = 2.5
STRIP_PALETTE = np.array(
    [
        stored(112, 111, 108),  # asphalt
        stored(150, 138, 116),  # gravel
        stored(186, 166, 134),  # dust in a rut
        stored(126, 117, 108),  # ballast
        stored(152, 147, 138),  # sleepers
        stored(62, 76, 66),  # water
        stored(112, 96, 70),  # mud
        stored(62, 84, 40),  # rank grass
        stored(44, 62, 28),  # hedge
    ],
    dtype=np.float64,
)


def strip_rows(strips: tuple[Strip, ...]) -> NDArray[np.float64]:
    """The straight pieces of all strips in painting order: (n, 8) float64.

    Both ends' north and east [m], the width [m], the kind, how far the strip has come at the piece's start [m], and
    which strip it is.
    """
    rows = []
    for kind in _ORDER:
        for which, strip in enumerate(strips):
            come_m = 0.0
            for start, end in zip(strip.points_ne_m[:-1], strip.points_ne_m[1:], strict=True):
                if strip.kind == kind:
                    rows.append((*start, *end, strip.width_m, _KINDS[kind], come_m, which))
                come_m += math.dist(start, end)
    return np.array(rows, dtype=np.float64).reshape(-1, 8)


@njit(nogil=True, cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def _away(strips: NDArray[np.float64], k: int, north_m: float, east_m: float) -> tuple[float, float, float]:
    """How far a place is from a piece [m], how far along the strip [m], and how far right of it [m]."""
    n0, e0 = strips[k, 0], strips[k, 1]
    dn, de = strips[k, 2] - n0, strips[k, 3] - e0
    length = max(1e-6, math.sqrt(dn * dn + de * de))
    dn, de = dn / length, de / length
    along = (north_m - n0) * dn + (east_m - e0) * de
    side = (east_m - e0) * dn - (north_m - n0) * de
    beyond = max(0.0, -along, along - length)
    return math.sqrt(side * side + beyond * beyond), strips[k, 6] + min(length, max(0.0, along)), side


@njit(nogil=True, cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def paint_strips(
    picture: NDArray[np.uint8],
    strips: NDArray[np.float64],
    fine: NDArray[np.float32],
    palette: NDArray[np.float64],
    corner_m: NDArray[np.float64],
    texel_m: NDArray[np.float64],
) -> None:
    """Paint `strips` (strip_rows) into `picture` (rows, columns, 4) uint8; `palette` is STRIP_PALETTE.

    `corner_m` is the picture's south and west, `texel_m` its texels' sides (north, east); `fine` is paint_fields'.
    """
    mask = fine.shape[0] - 1
    for k in range(strips.shape[0]):
        kind, half = int(strips[k, 5]), 0.5 * strips[k, 4]
        reach = half + _MARGIN_M
        low_n, high_n = min(strips[k, 0], strips[k, 2]) - reach, max(strips[k, 0], strips[k, 2]) + reach
        low_e, high_e = min(strips[k, 1], strips[k, 3]) - reach, max(strips[k, 1], strips[k, 3]) + reach
        for i in range(
            max(0, int((low_n - corner_m[0]) / texel_m[0])),
            min(picture.shape[0], int((high_n - corner_m[0]) / texel_m[0]) + 1),
        ):
            north_m = corner_m[0] + (i + 0.5) * texel_m[0]
            for j in range(
                max(0, int((low_e - corner_m[1]) / texel_m[1])),
                min(picture.shape[1], int((high_e - corner_m[1]) / texel_m[1]) + 1),
            ):
                east_m = corner_m[1] + (j + 0.5) * texel_m[1]
                away, along, side = _away(strips, k, north_m, east_m)
                if away >= reach:
                    continue
                # Each place belongs to the nearest of a strip's pieces, or joints would be painted twice.
                if k > 0 and strips[k - 1, 7] == strips[k, 7] and _away(strips, k - 1, north_m, east_m)[0] <= away:
                    continue
                if (
                    k + 1 < strips.shape[0]
                    and strips[k + 1, 7] == strips[k, 7]
                    and _away(strips, k + 1, north_m, east_m)[0] < away
                ):
                    continue
                grain = float(fine[i & mask, j & mask])
                grain2 = float(fine[(3 * i + 517) & mask, (3 * j + 211) & mask])
                _paint_place(picture[i, j], kind, half, away, along, side, grain, grain2, north_m, east_m, palette)


@njit(nogil=True, cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def _paint_place(
    texel: NDArray[np.uint8],
    kind: int,
    half: float,
    away: float,
    along: float,
    side: float,
    grain: float,
    grain2: float,
    north_m: float,
    east_m: float,
    palette: NDArray[np.float64],
) -> None:
    """Paint one place, `away` from the middle of a strip of half width `half`, and `along` it [m]."""
    if kind == 0:
        patch = bumps(along * 0.08, side * 0.35 + 9.0)
        wheel = rise(0.55, 0.15, abs(abs(side) - 0.5 * half) - 0.2)
        blend(texel, rise(half + 0.75, half + 0.15, away + 0.15 * grain), palette, 1, 1.0 + 0.05 * grain, 85.0)
        shade = 0.93 + 0.1 * patch + 0.045 * wheel + 0.02 * grain + 0.015 * grain2
        joint = abs((along + 40.0 * patch) % 37.0 - 5.0)
        if patch > 0.62 and joint < 0.04:
            shade *= 0.8  # a sealed crack across
        blend(texel, rise(half + 0.05, half - 0.03, away + 0.03 * grain), palette, 0, shade, 45.0)
    elif kind == 1:
        track = min(0.8, 0.5 * half)
        rut = 0.95 * rise(0.46, 0.14, abs(away - track) + 0.05 * grain + 0.03 * grain2)
        worn = 0.5 * rise(half + 0.5, 0.5 * half, away + 0.3 * grain)
        blend(texel, worn, palette, 1, 1.0 + 0.08 * grain, 140.0)
        blend(texel, rut, palette, 2, 0.97 + 0.05 * grain2, 85.0)
    elif kind == 2:
        stone = lattice(math.floor(north_m * 17.0), math.floor(east_m * 17.0))
        bed = rise(half + 0.2, half - 0.25, away + 0.15 * grain)
        blend(texel, rise(half + 1.2, half, away + 0.3 * grain), palette, 7, 0.95 + 0.1 * grain, 170.0)
        blend(texel, bed, palette, 3, 0.78 + 0.3 * stone + 0.05 * grain - 0.08 * rise(1.0, 0.4, away), 85.0)
        place = along % 0.6
        if away < 1.3 and place < 0.26:
            worn = 0.9 + 0.14 * lattice(int(along / 0.6), 7) + 0.03 * grain2
            blend(texel, 0.92, palette, 4, worn, 30.0)
    elif kind == 3:
        bank = half + 0.8 * (bumps(along * 0.12, 3.0 if side > 0.0 else 11.0) - 0.5) + 0.25 * grain2
        blend(texel, rise(bank + 1.8, bank + 0.4, away), palette, 7, 1.0 + 0.1 * grain, 170.0)
        blend(texel, rise(bank + 0.5, bank + 0.1, away), palette, 6, 0.9 + 0.08 * grain, 85.0)
        ripple = bumps(along * 1.1 + 0.6 * side, side * 2.6) - 0.5
        depth = rise(0.0, half, bank - away)
        shade = 1.15 - 0.3 * depth + 0.12 * ripple * depth
        blend(texel, rise(bank + 0.15, bank - 0.25, away), palette, 5, shade, 6.0)
    elif kind == 4:
        blend(texel, 0.75 * rise(0.55, 0.1, away + 0.12 * grain), palette, 7, 0.9 + 0.1 * grain2, 190.0)
    else:
        blend(texel, 0.8 * rise(half + 0.7, half, away + 0.2 * grain), palette, 7, 0.9 + 0.1 * grain, 190.0)
        leaf = bumps(north_m * 4.0, east_m * 4.0) - 0.5
        part = rise(1.02, 0.95, away / half / (0.8 + 0.3 * bumps(north_m * 1.3, east_m * 1.3)))
        blend(texel, part, palette, 8, 1.0 + 0.5 * leaf + 0.08 * grain, 255.0)
