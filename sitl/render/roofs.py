"""Paints houses from above: roofs with their courses and seams, walls where the surface is steep, and yards."""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from sitl.render.colour import stored
from sitl.render.fields import rise
from sitl.render.texel import blend
from sitl.world.records import Building, Roof
from sitl.world.surface import EAVES_SLOPE_M, building_row, bumps, lattice

_KINDS: dict[Roof, int] = {"tile": 0, "metal": 1, "flat": 2}
ROOF_PALETTE = np.array(
    [
        stored(148, 92, 70),  # tiles
        stored(146, 150, 152),  # sheet metal
        stored(126, 124, 120),  # bitumen and gravel
        stored(96, 88, 82),  # grey tiles
        stored(206, 198, 180),  # rendered wall
        stored(66, 70, 76),  # windows
        stored(150, 142, 128),  # a yard's gravel
        stored(176, 172, 164),  # gutter, flashing
    ],
    dtype=np.float64,
)
_YARD_M = 4.5


def house_rows(buildings: tuple[Building, ...]) -> NDArray[np.float64]:
    """Buildings as paint_houses takes them: (n, 9), sitl.world.surface.building_row and the kind of roof."""
    rows = [[*building_row(b), _KINDS[b.roof]] for b in buildings]
    return np.array(rows, dtype=np.float64).reshape(-1, 9)


@njit(nogil=True, cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def paint_houses(
    picture: NDArray[np.uint8],
    houses: NDArray[np.float64],
    palette: NDArray[np.float64],
    corner_m: NDArray[np.float64],
    texel_m: NDArray[np.float64],
    are_yards: bool,
) -> None:
    """Paint `houses` (house_rows), or the yards round them, into `picture` (rows, columns, 4) uint8.

    `palette` is ROOF_PALETTE, `corner_m` the picture's south and west, `texel_m` its texels' sides (north, east).
    """
    for k in range(houses.shape[0]):
        c, s, half_length, half_width = houses[k, 2], houses[k, 3], houses[k, 4], houses[k, 5]
        salt = lattice(int(8.0 * houses[k, 0]), int(8.0 * houses[k, 1]))
        reach = math.hypot(half_length, half_width) + (_YARD_M if are_yards else 1.0)
        for i in range(
            max(0, int((houses[k, 0] - reach - corner_m[0]) / texel_m[0])),
            min(picture.shape[0], int((houses[k, 0] + reach - corner_m[0]) / texel_m[0]) + 1),
        ):
            dn = corner_m[0] + (i + 0.5) * texel_m[0] - houses[k, 0]
            for j in range(
                max(0, int((houses[k, 1] - reach - corner_m[1]) / texel_m[1])),
                min(picture.shape[1], int((houses[k, 1] + reach - corner_m[1]) / texel_m[1]) + 1),
            ):
                de = corner_m[1] + (j + 0.5) * texel_m[1] - houses[k, 1]
                along, across = c * dn + s * de, c * de - s * dn
                outside = max(abs(along) - half_length, abs(across) - half_width)
                if are_yards:
                    part = 0.9 * rise(_YARD_M, 0.5, outside + 3.5 * bumps(dn * 0.35 + 50.0 * salt, de * 0.35))
                    if part > 0.0:
                        blend(picture[i, j], part, palette, 6, 0.95 + 0.12 * lattice(i, j), 85.0)
                elif outside < 0.0:
                    _paint_roof(picture[i, j], int(houses[k, 8]), along, across, half_length, half_width, salt, palette)
                elif outside < EAVES_SLOPE_M + 0.03:
                    _paint_wall(picture[i, j], along, across, half_length, half_width, outside, houses[k, 6], palette)


@njit(nogil=True, cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def _paint_roof(
    texel: NDArray[np.uint8],
    kind: int,
    along: float,
    across: float,
    half_length: float,
    half_width: float,
    salt: float,
    palette: NDArray[np.float64],
) -> None:
    """One place of a roof, (`along`, `across`) [m] from its centre; courses and the ridge run along."""
    weather = bumps(along * 0.5 + 70.0 * salt, across * 0.9) + 0.5 * bumps(along * 2.3, across * 2.3 + 30.0 * salt)
    if kind == 0:
        which = 3 if salt > 0.65 else 0
        course = abs(across) / 0.34
        row = math.floor(course)
        part = course - row  # the lower edge of each course throws a thin shadow
        tile = math.floor(along / 0.3 + 0.5 * (row % 2))
        shade = 0.9 + 0.12 * lattice(int(tile), int(row) + int(1000 * salt)) + 0.12 * (weather - 0.75)
        shade *= 1.0 - 0.24 * rise(0.22, 0.0, 1.0 - part) + 0.05 * part
        blend(texel, 1.0, palette, which, shade, 12.0)
        if abs(across) < 0.13:
            blend(texel, 1.0, palette, which, 1.08 + 0.05 * weather, 12.0)
    elif kind == 1:
        seam = abs(along / 0.55 - math.floor(along / 0.55) - 0.5) * 0.55
        shade = 0.93 + 0.1 * (weather - 0.75) + 0.03 * lattice(math.floor(along / 0.55), int(1000 * salt))
        shade *= 1.0 - 0.2 * rise(0.24, 0.27, seam)
        blend(texel, 1.0, palette, 1, shade, 0.0)
        if abs(abs(across) % 2.6 - 1.3) < 0.03:
            blend(texel, 0.4, palette, 5, 1.0, 0.0)
        if abs(across) < 0.12:
            blend(texel, 1.0, palette, 7, 1.05, 0.0)
    else:
        shade = 0.95 + 0.14 * (weather - 0.75) + 0.06 * lattice(int(along * 20.0 + 999.0), int(across * 20.0 + 999.0))
        if abs(across / 1.05 - math.floor(across / 1.05) - 0.5) > 0.465:
            shade *= 0.86
        blend(texel, 1.0, palette, 2, shade, 40.0)
    rim = min(half_length - abs(along), half_width - abs(across))
    if rim < (0.22 if kind == 2 else 0.09):
        blend(texel, 1.0, palette, 7, 1.0 if kind != 0 else 0.75, 0.0)


@njit(nogil=True, cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def _paint_wall(
    texel: NDArray[np.uint8],
    along: float,
    across: float,
    half_length: float,
    half_width: float,
    outside: float,
    eaves_m: float,
    palette: NDArray[np.float64],
) -> None:
    """One place of a wall: the grid's steep cells show its height as the distance from the house."""
    height_m = eaves_m * (1.0 - outside / EAVES_SLOPE_M)
    is_end = abs(along) - half_length > abs(across) - half_width
    place = (across if is_end else along) / 2.8
    blend(texel, 1.0, palette, 4, 0.97, 8.0)
    storey = height_m % 2.7
    if 0.8 < storey < 2.2 and abs(place - math.floor(place) - 0.5) < 0.2 and height_m < eaves_m - 0.3:
        blend(texel, 1.0, palette, 5, 1.0, 0.0)
