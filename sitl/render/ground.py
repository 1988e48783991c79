"""The ground, and all that stands on it as a surface, seen by one camera: its colour in its light, haze, the sky."""

import math

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from sitl.render.daylight import Daylight, sky_mix
from sitl.render.depth import COARSE_PX, find_inverse_depth
from sitl.render.paint import GroundTexture
from sitl.render.relief import Relief
from sitl.render.texture import Texture, dither, map_texture

LIGHT_PX = 4
"""How far apart the light is worked out, in pixels."""
_HUE = 0.25  # how far the detail's hue turns grass from green to straw and back
_DETAIL_LEVELS = 5.0  # beyond, a detail says less than the eye can see
_SOIL_GRAIN = 0.6
_LEAN = 0.7
_GREY = (128.0, 128.0, 128.0, 128.0)


@njit(nogil=True, cache=True, error_model="numpy", inline="always", fastmath=True)  # type: ignore[untyped-decorator]
def light_at(
    w: float,
    rx: float,
    ry: float,
    centre: NDArray[np.float64],
    r: NDArray[np.float64],
    shares: NDArray[np.uint8],
    place: NDArray[np.float64],
    day: NDArray[np.float32],
) -> tuple[float, float, float, float, float, float]:
    """What a pixel multiplies its albedo by, and what comes on top: BGR each.

    The pixel's inverse depth is `w` [1/m] and its ray (`rx`, `ry`, 1) in the camera frame; `centre` and `r` are the
    camera's position and rotation; `shares` is daylight.light_map's, on the grid at `place`; `day` is Daylight.table.
    """
    north = r[0, 0] * rx + r[0, 1] * ry + r[0, 2]
    east = r[1, 0] * rx + r[1, 1] * ry + r[1, 2]
    down = r[2, 0] * rx + r[2, 1] * ry + r[2, 2]
    square = north * north + east * east
    length = math.sqrt(square + down * down)
    if w <= 1e-6:
        rim, glow = sky_mix(day, north / length, east / length, -down / length)
        b = day[3, 0] + rim * (day[2, 0] - day[3, 0]) + glow * day[4, 0]
        g = day[3, 1] + rim * (day[2, 1] - day[3, 1]) + glow * day[4, 1]
        red = day[3, 2] + rim * (day[2, 2] - day[3, 2]) + glow * day[4, 2]
        return 0.0, 0.0, 0.0, b, g, red
    depth = 1.0 / w
    per_cell = 1.0 / place[2]
    y = (centre[0] + depth * north - place[0]) * per_cell
    x = (centre[1] + depth * east - place[1]) * per_cell
    last_row, last_column = shares.shape[0] - 1, shares.shape[1] - 1
    if y < 0.0 or y >= last_row:
        y = abs(y) % (2.0 * last_row)
        y = min(y, 2.0 * last_row - y)
    if x < 0.0 or x >= last_column:
        x = abs(x) % (2.0 * last_column)
        x = min(x, 2.0 * last_column - x)
    i, j = min(int(y), last_row - 1), min(int(x), last_column - 1)
    v, u = y - i, x - j
    a, b, c, d = (1.0 - v) * (1.0 - u), (1.0 - v) * u, v * (1.0 - u), v * u
    sun = a * shares[i, j, 0] + b * shares[i, j + 1, 0] + c * shares[i + 1, j, 0] + d * shares[i + 1, j + 1, 0]
    sky = a * shares[i, j, 1] + b * shares[i, j + 1, 1] + c * shares[i + 1, j, 1] + d * shares[i + 1, j + 1, 1]
    haze = day[6, 0] * depth * length
    clear = math.exp(-haze) if haze > 0.05 else 1.0 - haze + 0.5 * haze * haze
    sun *= clear / 255.0
    sky *= clear / 255.0
    dim = 1.0 - clear
    glow = 0.0
    if dim > 0.01:  # the air towards the sun is brighter
        flat = 1.0 / math.sqrt(square + 1e-12)
        glow = sky_mix(day, north * flat, east * flat, 0.0)[1]
    return (
        sun * day[0, 0] + sky * day[1, 0],
        sun * day[0, 1] + sky * day[1, 1],
        sun * day[0, 2] + sky * day[1, 2],
        dim * (day[2, 0] + glow * day[4, 0]),
        dim * (day[2, 1] + glow * day[4, 1]),
        dim * (day[2, 2] + glow * day[4, 2]),
    )


@njit(nogil=True, cache=True, error_model="numpy", fastmath=True)  # type: ignore[untyped-decorator]
def light_grid(
    grid: NDArray[np.float32],
    inverse: NDArray[np.float32],
    rays: NDArray[np.float32],
    centre: NDArray[np.float64],
    r: NDArray[np.float64],
    shares: NDArray[np.uint8],
    place: NDArray[np.float64],
    day: NDArray[np.float32],
) -> None:
    """Fill `grid` (6, rows, columns) float32 with light_at() for every LIGHT_PX-th pixel of `inverse`."""
    for i in range(grid.shape[1]):
        for j in range(grid.shape[2]):
            v, u = i * LIGHT_PX, j * LIGHT_PX
            shine = light_at(inverse[v, u], rays[0, v, u], rays[1, v, u], centre, r, shares, place, day)
            grid[0, i, j], grid[1, i, j], grid[2, i, j] = shine[0], shine[1], shine[2]
            grid[3, i, j], grid[4, i, j], grid[5, i, j] = shine[3], shine[4], shine[5]


@njit(nogil=True, cache=True, error_model="numpy", fastmath=True)  # type: ignore[untyped-decorator]
def light_ground(
    light: NDArray[np.float32],
    surface: NDArray[np.int32],
    detail: NDArray[np.int32],
    detail_rows: tuple[int, int],
    grid: NDArray[np.float32],
    is_edge: NDArray[np.uint8],
    inverse: NDArray[np.float32],
) -> None:
    """Bring surface and detail, and the light on them, into `light` (height, width, 3) float32 linear BGR.

    `surface` and `detail` are (height, width) int32, the four channels of a pixel in one number, the first lowest: so
    the loops become vector instructions. `detail` counts in `detail_rows` (first, last) only. `grid` is
    light_grid's, mixed between its places; but where `is_edge` tells that depths jump, a pixel takes the light of the
    place whose `inverse` depth is most like its own.
    """
    unit, two, three, one, zero = np.float32(1 / 255), np.float32(2), np.float32(3), np.float32(1), np.float32(0)
    middle, dull = np.float32(127.5), np.float32(_SOIL_GRAIN)
    tinge, half, quarter = np.float32(_HUE), np.float32(0.5), np.float32(1.0 / LIGHT_PX)
    height_px, width_px = light.shape[0], light.shape[1]
    n = grid.shape[2]
    row = np.empty(n, dtype=np.float32)
    shine = np.empty((6, n * LIGHT_PX), dtype=np.float32)
    gain, tint = np.ones(width_px, dtype=np.float32), np.zeros(width_px, dtype=np.float32)
    lit = np.empty((3, width_px), dtype=np.float32)
    byte, second, third, fourth = np.int32(255), np.int32(8), np.int32(16), np.int32(24)
    for v in range(height_px):
        i = v // LIGHT_PX
        part = np.float32(v - i * LIGHT_PX) * quarter
        for c in range(6):
            for j in range(n):
                row[j] = grid[c, i, j] + part * (grid[c, i + 1, j] - grid[c, i, j])
            for j in range(n - 1):
                step = (row[j + 1] - row[j]) * quarter
                for k in range(LIGHT_PX):
                    shine[c, j * LIGHT_PX + k] = row[j] + np.float32(k) * step
        low, high = i * LIGHT_PX, (i + 1) * LIGHT_PX
        for j in range(is_edge.shape[1]):
            if is_edge[i, j]:
                left, right = j * LIGHT_PX, (j + 1) * LIGHT_PX
                for u in range(left, min(width_px, right)):
                    w = inverse[v, u]
                    best, x, y = 1e30, j, i
                    for k in range(4):
                        away = abs(inverse[high if k > 1 else low, right if k & 1 else left] - w)
                        if away < best:
                            best, x, y = away, j + (k & 1), i + (k >> 1)
                    for c in range(6):
                        shine[c, u] = grid[c, y, x]
        if detail_rows[0] <= v <= detail_rows[1]:
            for u in range(width_px):
                four = detail[v, u]
                cover = three * unit * np.float32((surface[v, u] >> fourth) & byte)
                soil = middle + dull * (np.float32(four & byte) - middle)
                grass = np.float32((four >> second) & byte)
                leaf, hue = np.float32((four >> third) & byte), np.float32((four >> fourth) & byte)
                grassy = min(one, max(zero, cover - one))
                grain = soil + grassy * (grass - soil)
                leafy = max(zero, cover - two)
                grain += leafy * (leaf - grain)
                grain += leafy * (grain - middle)
                gain[u] = unit * (one + min(one, cover) * (two * unit * grain - one))
                tint[u] = tinge * (hue * unit - half) * grassy
        else:
            gain[:] = unit
            tint[:] = zero
        for u in range(width_px):
            four = surface[v, u]
            b = np.float32(four & byte) * gain[u] * (one - tint[u])
            g = np.float32((four >> second) & byte) * gain[u]
            red = np.float32((four >> third) & byte) * gain[u] * (one + tint[u])
            lit[0, u] = b * b * shine[0, u] + shine[3, u]
            lit[1, u] = g * g * shine[1, u] + shine[4, u]
            lit[2, u] = red * red * shine[2, u] + shine[5, u]
        for u in range(width_px):
            light[v, u, 0], light[v, u, 1], light[v, u, 2] = lit[0, u], lit[1, u], lit[2, u]


class GroundView:
    """The ground seen by one camera; keeps the buffers between frames. `rays` is sitl.render.lens.ray_table's.

    `shares` is daylight.light_map's for the surface that `relief` was made of. After draw(), `inverse` (height, width
    and more) float32 is 1 / depth [1/m], 0 or less in the sky, and `shine` the light_grid.
    """

    def __init__(
        self,
        ground: GroundTexture,
        relief: Relief,
        shares: NDArray[np.uint8],
        daylight: Daylight,
        rays: NDArray[np.float32],
        f_px: float,
    ) -> None:
        self._ground, self._relief, self._shares, self._day = ground, relief, shares, daylight.table
        self._f_px = f_px
        height_px, width_px = rays.shape[1:]
        self._rays = widen(rays)
        n_rows, n_columns = self._rays.shape[1:]
        self.inverse = np.empty((n_rows, n_columns), dtype=np.float32)
        self.shine = np.empty((6, n_rows // LIGHT_PX + 1, n_columns // LIGHT_PX + 1), dtype=np.float32)
        self._marched = np.zeros((n_rows, n_columns), dtype=np.uint8)
        self._odd = np.zeros((n_rows // 2, n_columns // 2), dtype=np.float32)
        self._is_edge = np.zeros((n_rows // LIGHT_PX, n_columns // LIGHT_PX), dtype=np.uint8)
        self._thresholds = dither(width_px, height_px)
        self._columns = np.empty((height_px, width_px), dtype=np.float32)
        self._rows = np.empty((height_px, width_px), dtype=np.float32)
        self._surface = np.empty((height_px, width_px, 4), dtype=np.uint8)
        self._detail = np.empty((height_px, width_px, 4), dtype=np.uint8)

    def look(self, centre: NDArray[np.float64], ned_from_camera: NDArray[np.float64]) -> None:
        """Fill `inverse` for a camera at `centre` (3,) NED [m] with that rotation (3, 3)."""
        relief = self._relief
        find_inverse_depth(
            self.inverse, self._is_edge, self._marched, self._odd, self._rays,
            relief.up_m, relief.highest_m, relief.levels, relief.leaf_m, relief.place, relief.far_m, relief.is_flat,
            centre, ned_from_camera, self._f_px,
        )  # fmt: skip

    def draw(
        self, light: NDArray[np.float32], centre: NDArray[np.float64], ned_from_camera: NDArray[np.float64]
    ) -> None:
        """Fill `light` (height, width, 3) float32 BGR, linear light, with the ground and what of the sky is in view."""
        self.look(centre, ned_from_camera)
        surface, detail = self._ground.surface, self._ground.detail
        self._fetch(surface, self._surface, (0.0, 0.0, 0.0, 0.0), len(surface.levels), 0.0, centre, ned_from_camera)
        seen = self._fetch(detail, self._detail, _GREY, _DETAIL_LEVELS, _LEAN, centre, ned_from_camera)
        camera = (centre, ned_from_camera, self._shares, self._relief.place, self._day)
        light_grid(self.shine, self.inverse, self._rays, *camera)
        light_ground(
            light, self._surface.view(np.int32)[..., 0], self._detail.view(np.int32)[..., 0], seen, self.shine,
            self._is_edge, self.inverse,
        )  # fmt: skip

    def _fetch(
        self,
        texture: Texture,
        out: NDArray[np.uint8],
        beyond: tuple[float, float, float, float],
        n_levels: float,
        lean: float,
        centre: NDArray[np.float64],
        ned_from_camera: NDArray[np.float64],
    ) -> tuple[int, int]:
        """Fill the rows of `out` that see the texture, and return the first and the last of them."""
        texel_m = texture.texel_m
        # The finest texels are worth as much as they are everywhere; the last levels stand for all that is farther.
        told = n_levels if texture.repeats else 99.0
        frame = np.array([*texture.corner_m, *texture.size_m, texel_m, float(texture.repeats), told])
        first, last = map_texture(
            self._columns, self._rows, self.inverse, self._rays, self._thresholds, centre, ned_from_camera,
            self._f_px, texture.levels, frame, lean,
        )  # fmt: skip
        out[:first] = out[last + 1 :] = beyond
        if first <= last:
            rows = slice(first, last + 1)
            # Of grain, the nearest texel is as good as a mean of four.
            how = cv2.INTER_NEAREST if texture.repeats else cv2.INTER_LINEAR
            cv2.remap(texture.atlas, self._columns[rows], self._rows[rows], how, out[rows], cv2.BORDER_CONSTANT, beyond)
        return int(first), int(last)


def widen(rays: NDArray[np.float32]) -> NDArray[np.float32]:
    """Continue a ray table straight on to a multiple of COARSE_PX rows and columns, and one more of each."""
    for axis in (1, 2):
        n = rays.shape[axis]
        more = -(-n // COARSE_PX) * COARSE_PX + 1 - n
        last, before = np.take(rays, [n - 1], axis), np.take(rays, [n - 2 if n > 1 else n - 1], axis)
        steps = np.arange(1, more + 1, dtype=np.float32).reshape([-1 if k == axis else 1 for k in range(3)])
        rays = np.concatenate([rays, last + steps * (last - before)], axis=axis)
    return np.ascontiguousarray(rays, dtype=np.float32)
