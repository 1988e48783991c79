"""The day's light: its colours, the sky, haze, and how much of sun and sky reaches each place of a surface."""

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from sitl.world.height_grid import HeightGrid
from sitl.world.records import Light

_KOSCHMIEDER = math.log(20.0)  # a contrast of 5 % is left at the visibility
_SOFT_CELLS = 0.6


@dataclass(frozen=True, slots=True, eq=False)
class Daylight:
    """What the kernels take of a Light: linear BGR, and directions in NED.

    `table` is (8, 3) float32: the sun's light on a surface that faces it, the sky's on a level one, the sky's radiance
    at the horizon and at the zenith, the glow round the sun, the direction to the sun, the extinction [1/m] (thrice),
    and how much of the glow is wide, narrow, and how grey the day is.
    """

    table: NDArray[np.float32]

    @property
    def level_bgr(self) -> NDArray[np.float64]:
        """What a level white surface in the open shows, (3,) linear BGR."""
        return np.asarray(self.table[0] * max(0.0, -float(self.table[5, 2])) + self.table[1], dtype=np.float64)

    @property
    def air_bgr(self) -> NDArray[np.float64]:
        """What far things fade into, (3,) linear BGR."""
        return np.asarray(self.table[2], dtype=np.float64)


def daylight_of(light: Light) -> Daylight:
    """The colours that a light has: white at noon, warm near the horizon, blue in a clear dusk, grey when overcast."""
    height = math.sin(max(0.0, light.elevation_rad))
    low = math.exp(-height / 0.3)  # the sun's way through the air reddens it
    sun = _even(np.array([1.0 - 0.62 * low, 1.0 - 0.12 * low, 1.0 + 0.5 * low]))
    grey = 1.0 if light.direct <= 0.0 else 0.0
    blue = (1.0 - grey) * (1.0 + 1.2 * low)
    sky = _even(np.array([1.0 + 0.16 * blue, 1.0, 1.0 - 0.13 * blue]))
    horizon = _even(np.array([1.0 + 0.1 * blue, 1.0, 1.0 - 0.05 * blue + 0.3 * low * (1.0 - grey)]))
    zenith = _even(np.array([1.0 + 0.55 * (1.0 - grey), 1.0, 1.0 - 0.3 * (1.0 - grey)]))
    table = np.zeros((8, 3), dtype=np.float32)
    table[0] = light.direct * sun
    table[1] = light.sky * sky
    table[2] = light.sky * horizon * (1.0 if grey else 1.45)
    table[3] = light.sky * zenith * (1.2 if grey else 0.75)
    table[4] = (light.direct * (0.35 + 0.5 * low)) * sun
    table[5] = light.direction_ned
    table[6] = _KOSCHMIEDER / light.visibility_m
    return Daylight(table)


def _even(bgr: NDArray[np.float64]) -> NDArray[np.float64]:
    """The same hue with the luminance 1 (ITU-R BT.709)."""
    return bgr / float(bgr @ np.array([0.0722, 0.7152, 0.2126]))


def light_map(surface: HeightGrid, light: Light) -> NDArray[np.uint8]:
    """How much of the sun and of the sky reaches each node of a surface: (rows, columns, 2) uint8, 255 is all of it.

    The sun's part has the slope's cosine and the shadows in it, cast along the grid; the sky's has less where higher
    things stand round.
    """
    up_m, cell_m = surface.up_m, surface.cell_m
    north, east, down = light.direction_ned
    shares = np.empty((*up_m.shape, 2), dtype=np.uint8)
    if abs(north) >= abs(east):
        open_sun = sunlit(up_m, cell_m, north, east, -down)
    else:
        open_sun = np.ascontiguousarray(sunlit(np.ascontiguousarray(up_m.T), cell_m, east, north, -down).T)
    open_sun = cv2.GaussianBlur(open_sun, (0, 0), _SOFT_CELLS)
    wide, near = (
        cv2.blur(up_m, (side, side), borderType=cv2.BORDER_REFLECT)
        for side in (2 * max(1, round(m / cell_m)) + 1 for m in (3.5, 0.6))
    )
    shade_nodes(shares, up_m, wide, near, open_sun, cell_m, np.array([north, east, -down]))
    return shares


@njit(nogil=True, cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def sunlit(up_m: NDArray[np.float32], cell_m: float, ahead: float, side: float, height: float) -> NDArray[np.float32]:
    """Where the sun is seen from, 0 to 1, (rows, columns) float32.

    The sun stands `ahead` along the rows' axis, `side` along the columns' and `height` up; |ahead| >= |side|. Each
    line of nodes towards the sun is walked once, away from the sun, with the shadow's edge sinking as it goes.
    """
    n_rows, n_columns = up_m.shape
    seen = np.ones((n_rows, n_columns), dtype=np.float32)
    if height <= 0.0 or abs(ahead) < 1e-6:
        return seen
    slope = side / ahead
    sink_m = cell_m * math.sqrt(1.0 + slope * slope) * height / math.sqrt(ahead * ahead + side * side)
    n_lines = n_columns + int(abs(slope) * n_rows) + 2
    offset = int(slope * n_rows) + 1 if slope > 0.0 else 1
    edge_m = np.full(n_lines, -np.inf)
    for k in range(n_rows):
        i = n_rows - 1 - k if ahead > 0.0 else k
        shift = offset - math.floor(slope * i + 0.5)
        for j in range(n_columns):
            line = j + shift
            if 0 <= line < n_lines:
                over_m = edge_m[line] - up_m[i, j]
                seen[i, j] = min(1.0, max(0.0, 0.5 - over_m / (sink_m + 1e-3)))
                edge_m[line] = max(edge_m[line], float(up_m[i, j])) - sink_m
    return seen


@njit(nogil=True, cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def shade_nodes(
    shares: NDArray[np.uint8],
    up_m: NDArray[np.float32],
    wide_m: NDArray[np.float32],
    near_m: NDArray[np.float32],
    open_sun: NDArray[np.float32],
    cell_m: float,
    sun: NDArray[np.float64],
) -> None:
    """Fill light_map's `shares`; `wide_m` and `near_m` are the mean heights round each node, `sun` north, east, up."""
    n_rows, n_columns = up_m.shape
    for i in range(n_rows):
        south, north = max(0, i - 1), min(n_rows - 1, i + 1)
        for j in range(n_columns):
            west, east = max(0, j - 1), min(n_columns - 1, j + 1)
            slope_n = (up_m[north, j] - up_m[south, j]) / ((north - south) * cell_m)
            slope_e = (up_m[i, east] - up_m[i, west]) / ((east - west) * cell_m)
            steep = 1.0 / math.sqrt(1.0 + slope_n * slope_n + slope_e * slope_e)
            cosine = max(0.0, (sun[2] - slope_n * sun[0] - slope_e * sun[1]) * steep)
            hollow = min(6.0, max(0.0, wide_m[i, j] - up_m[i, j]))
            pit = min(0.6, max(0.0, near_m[i, j] - up_m[i, j]))
            sky = 0.08 + 0.46 * (1.0 + steep) / (1.0 + 0.22 * hollow) / (1.0 + 0.8 * pit)
            shares[i, j, 0] = int(255.0 * min(1.0, cosine * open_sun[i, j]) + 0.5)
            shares[i, j, 1] = int(255.0 * min(1.0, sky) + 0.5)


@njit(nogil=True, cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def sky_mix(day: NDArray[np.float32], north: float, east: float, up: float) -> tuple[float, float]:
    """How much of the horizon's and of the sun's glow is in the sky's radiance in a direction (a unit vector).

    The radiance is zenith + (horizon - zenith) first + glow second; `day` is Daylight.table, which has all three.
    """
    t = 1.0 - max(0.0, up)
    toward = max(0.0, north * day[5, 0] + east * day[5, 1] - max(0.0, up) * day[5, 2])
    near = toward * toward
    near *= near
    return t * t * t, near * (0.5 + 0.5 * near * near)
