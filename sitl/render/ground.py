"""The ground as the camera sees it: a tiling texture with mip levels on the plane down = 0, and the sky beyond it."""

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

_BLOCK_PX = 32  # the mip level is worked out once for so many pixels of a row
_BORDER = 2  # texels copied from the other edge, so that interpolation sees across the seam
_SMALLEST = 4
_HUE = 0.25  # how far the detail's hue turns grass from green to straw and back
_SKY = (237.0, 219.0, 201.0, 0.0)  # a pale haze, as GroundTexture.surface stores colour
_GREY = (128.0, 128.0, 128.0, 128.0)
_OUTSIDE = -10.0


@dataclass(frozen=True, slots=True, eq=False)
class Texture:
    """A square four-channel picture that repeats in north and east, with all its mip levels in one image.

    `atlas` (rows, columns, 4) uint8 holds the levels, rows to the north and columns to the east. `levels` is (n, 3)
    float32: the row and column where each level's first texel lies, and its side in texels.
    """

    atlas: NDArray[np.uint8]
    levels: NDArray[np.float32]
    texel_m: float


@dataclass(frozen=True, slots=True, eq=False)
class GroundTexture:
    """How a ground looks. Colours are stored as the square root of linear light: cheap to undo, and fine in the dark.

    `surface` is blue, green, red and cover: 0 bare soil, 0.5 grass, 1 leaves. `detail` is what the surface is too
    coarse to hold, as brightness around 0.5 of soil, grass and leaves, and in the fourth channel its hue.
    """

    surface: Texture
    detail: Texture


def build_texture(picture: NDArray[np.uint8], texel_m: float) -> Texture:
    """Make a texture of a picture (side, side, 4) uint8 whose side is a power of two; raises ValueError otherwise."""
    side = picture.shape[0]
    if picture.shape != (side, side, 4) or picture.dtype != np.uint8 or side & (side - 1) or side < _SMALLEST:
        raise ValueError(f"A texture needs a square uint8 picture of four channels and 2^k rows, not {picture.shape}.")
    n_levels = int(math.log2(side // _SMALLEST)) + 1
    atlas = np.zeros((side + n_levels * _BORDER, side + side // 2 + 2 * _BORDER, 4), dtype=np.uint8)
    levels = np.empty((n_levels, 3), dtype=np.float32)
    row, column, level = 0, 0, picture
    for k in range(n_levels):
        wide = np.pad(level, ((0, _BORDER), (0, _BORDER), (0, 0)), mode="wrap")
        atlas[row : row + len(wide), column : column + len(wide)] = wide
        levels[k] = row, column, len(level)
        row, column = (0, side + _BORDER) if k == 0 else (row + len(wide), column)
        level = np.asarray(cv2.resize(level, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA), dtype=np.uint8)
    return Texture(atlas, levels, texel_m)


def dither(width_px: int, height_px: int) -> NDArray[np.float32]:
    """A threshold 0 to 1 for each pixel, (height, width) float32, evenly spread over every small neighbourhood.

    Jimenez's interleaved gradient noise (Next generation post processing in Call of Duty, SIGGRAPH 2014).
    """
    u, v = np.meshgrid(np.arange(width_px), np.arange(height_px))
    return np.asarray((52.9829189 * ((0.06711056 * u + 0.00583715 * v) % 1.0)) % 1.0, dtype=np.float32)


@njit(nogil=True, cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def map_ground(
    columns: NDArray[np.float32],
    rows: NDArray[np.float32],
    rays: NDArray[np.float32],
    thresholds: NDArray[np.float32],
    centre: NDArray[np.float64],
    ned_from_camera: NDArray[np.float64],
    f_px: float,
    levels: NDArray[np.float32],
    texel_m: float,
) -> None:
    """Find where in a texture's atlas each pixel looks: `columns` and `rows` (height, width) float32, for cv2.remap.

    `rays` is lens.ray_table's. `thresholds` is dither()'s: pixel by pixel it chooses between the two mip levels
    that fit, so that no edge shows where the level changes, at half the price of mixing them. `centre` (3,) NED [m]
    and `ned_from_camera` (3, 3) are the camera's, `levels` and `texel_m` the Texture's. Sky maps to outside the atlas.
    """
    height_px, width_px = columns.shape
    last = len(levels) - 1
    # float32 throughout, so that the loop over a block becomes vector instructions.
    rotation = ned_from_camera.astype(np.float32)
    north_m, east_m = np.float32(centre[0]), np.float32(centre[1])
    height_m = np.float32(max(0.01, -centre[2]))
    r00, r01, r02 = rotation[0, 0], rotation[0, 1], rotation[0, 2]
    r10, r11, r12 = rotation[1, 0], rotation[1, 1], rotation[1, 2]
    r20, r21, r22 = rotation[2, 0], rotation[2, 1], rotation[2, 2]
    one, half, outside, horizon = np.float32(1.0), np.float32(0.5), np.float32(_OUTSIDE), np.float32(0.01)
    for v in range(height_px):
        for first in range(0, width_px, _BLOCK_PX):
            rx, ry = rays[0, v, first], rays[1, v, first]
            fall = max(horizon, r20 * rx + r21 * ry + r22)
            # A pixel's footprint on the ground is its size at that depth, stretched along the line of sight.
            stretch = math.sqrt(math.sqrt(one + rx * rx + ry * ry) / fall)
            level = min(max(math.log2(height_m / fall / f_px * stretch / texel_m), 0.0), float(last))
            k0 = int(level)
            k1 = min(k0 + 1, last)
            part = np.float32(level - k0)
            scale0, scale1 = np.float32(1.0 / (texel_m * (1 << k0))), np.float32(1.0 / (texel_m * (1 << k1)))
            row0, column0, side0 = levels[k0, 0], levels[k0, 1], levels[k0, 2]
            row1, column1, side1 = levels[k1, 0], levels[k1, 1], levels[k1, 2]
            for u in range(first, min(first + _BLOCK_PX, width_px)):
                rx, ry = rays[0, v, u], rays[1, v, u]
                fall = r20 * rx + r21 * ry + r22
                depth_m = height_m / max(horizon, fall)
                is_coarse = thresholds[v, u] < part
                scale = scale1 if is_coarse else scale0
                side = side1 if is_coarse else side0
                x = (east_m + depth_m * (r10 * rx + r11 * ry + r12)) * scale - half
                y = (north_m + depth_m * (r00 * rx + r01 * ry + r02)) * scale - half
                x += (column1 if is_coarse else column0) - np.floor(x / side) * side
                y += (row1 if is_coarse else row0) - np.floor(y / side) * side
                columns[v, u] = x if fall > horizon else outside
                rows[v, u] = y if fall > horizon else outside


@njit(nogil=True, cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def light_ground(light: NDArray[np.float32], surface: NDArray[np.uint8], detail: NDArray[np.uint8]) -> None:
    """Bring surface and detail, (height, width, 4) uint8 each, together into `light` (height, width, 3) float32 BGR."""
    unit, two, one, zero = np.float32(1.0 / 255.0), np.float32(2.0), np.float32(1.0), np.float32(0.0)
    tinge, half = np.float32(_HUE), np.float32(0.5)
    for v in range(light.shape[0]):
        for u in range(light.shape[1]):
            cover = two * unit * np.float32(surface[v, u, 3])
            soil, grass = np.float32(detail[v, u, 0]), np.float32(detail[v, u, 1])
            leaf, hue = np.float32(detail[v, u, 2]), np.float32(detail[v, u, 3])
            soil_part, leaf_part = max(zero, one - cover), max(zero, cover - one)
            gain = two * unit * unit * (grass + soil_part * (soil - grass) + leaf_part * (leaf - grass))
            tint = tinge * (hue * unit - half) * (one - soil_part)
            b = np.float32(surface[v, u, 0]) * gain * (one - tint)
            g = np.float32(surface[v, u, 1]) * gain
            r = np.float32(surface[v, u, 2]) * gain * (one + tint)
            light[v, u, 0] = b * b
            light[v, u, 1] = g * g
            light[v, u, 2] = r * r


class GroundView:
    """The ground seen by one camera; keeps the buffers between frames. `rays` is sitl.render.lens.ray_table's."""

    def __init__(self, ground: GroundTexture, rays: NDArray[np.float32], f_px: float) -> None:
        self._ground = ground
        self._rays = rays
        self._f_px = f_px
        height_px, width_px = rays.shape[1:]
        self._thresholds = dither(width_px, height_px)
        self._columns = np.empty((height_px, width_px), dtype=np.float32)
        self._rows = np.empty((height_px, width_px), dtype=np.float32)
        self._surface = np.empty((height_px, width_px, 4), dtype=np.uint8)
        self._detail = np.empty((height_px, width_px, 4), dtype=np.uint8)

    def draw(
        self, light: NDArray[np.float32], centre: NDArray[np.float64], ned_from_camera: NDArray[np.float64]
    ) -> None:
        """Fill `light` (height, width, 3) float32 BGR, linear light, with the ground and what of the sky is in view."""
        for texture, out, beyond in (
            (self._ground.surface, self._surface, _SKY),
            (self._ground.detail, self._detail, _GREY),
        ):
            map_ground(
                self._columns,
                self._rows,
                self._rays,
                self._thresholds,
                centre,
                ned_from_camera,
                self._f_px,
                texture.levels,
                texture.texel_m,
            )
            cv2.remap(texture.atlas, self._columns, self._rows, cv2.INTER_LINEAR, out, cv2.BORDER_CONSTANT, beyond)
        light_ground(light, self._surface, self._detail)
