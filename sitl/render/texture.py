"""Pictures of the ground with all their mip levels in one image, and where in it a pixel finds its colour."""

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

_BLOCK_PX = 32  # the mip level is worked out once for so many pixels of a row
_BORDER = 2  # texels copied round each level, so that interpolation sees across its edges
_MOST_LEVELS = 8
_OUTSIDE = -10.0


@dataclass(frozen=True, slots=True, eq=False)
class Texture:
    """A four-channel picture that covers `size_m` (north, east) from `corner_m` (south, west), and what follows beyond.

    `atlas` (rows, columns, 4) uint8 holds the levels, rows to the north and columns to the east. `levels` is (n, 4)
    float32: the row and column where each level's first texel lies, and how many rows and columns it has. Beyond its
    edges the picture goes on mirrored, or, where it `repeats`, from its other edge.
    """

    atlas: NDArray[np.uint8]
    levels: NDArray[np.float32]
    corner_m: tuple[float, float]
    size_m: tuple[float, float]
    repeats: bool

    @property
    def texel_m(self) -> float:
        """The side of a texel of the finest level [m]."""
        return math.sqrt(self.size_m[0] / self.levels[0, 2] * self.size_m[1] / self.levels[0, 3])


def layout(n_rows: int, n_columns: int) -> tuple[tuple[int, int], NDArray[np.float32]]:
    """The shape of the atlas for a picture of that size, and where its levels lie (Texture.levels).

    Raises ValueError unless both numbers can be halved for each level, down to 4 texels or seven times.
    """
    n_levels = min(_MOST_LEVELS, int(math.log2(min(n_rows, n_columns) / 4)) + 1) if min(n_rows, n_columns) >= 4 else 0
    unit = 1 << max(0, n_levels - 1)
    if n_levels < 1 or n_rows % unit or n_columns % unit:
        raise ValueError(f"A texture's sides must be multiples of {unit} texels, not {n_rows} x {n_columns}.")
    levels = np.empty((n_levels, 4), dtype=np.float32)
    row, column = _BORDER, _BORDER
    for k in range(n_levels):
        levels[k] = row, column, n_rows >> k, n_columns >> k
        row, column = (_BORDER, n_columns + 3 * _BORDER) if k == 0 else (row + (n_rows >> k) + 2 * _BORDER, column)
    width = n_columns + 2 * _BORDER + (n_columns // 2 + 2 * _BORDER if n_levels > 1 else 0)
    return (max(n_rows + 2 * _BORDER, row), width), levels


def fill_levels(atlas: NDArray[np.uint8], levels: NDArray[np.float32], repeats: bool) -> None:
    """Make all coarser levels, and all borders, from the finest level that is already in the atlas."""
    kind = cv2.BORDER_WRAP if repeats else cv2.BORDER_REPLICATE
    picture: NDArray[np.uint8] | None = None
    for row, column, n_rows, n_columns in levels.astype(int):
        if picture is None:
            picture = atlas[row : row + n_rows, column : column + n_columns]
        else:
            small = cv2.resize(picture, (n_columns, n_rows), interpolation=cv2.INTER_AREA)
            picture = np.asarray(small, dtype=np.uint8)
        # Only the rim is made wider, not a copy of the whole: the finest level is large.
        b = _BORDER
        atlas[row : row + n_rows, column : column + n_columns] = picture
        wide = atlas[row - b : row + n_rows + b, column - b : column + n_columns + b]
        for rim, inner in ((wide[:b], wide[n_rows : n_rows + b]), (wide[-b:], wide[b : 2 * b])):
            rim[:] = inner
        for rim, inner in ((wide[:, :b], wide[:, n_columns : n_columns + b]), (wide[:, -b:], wide[:, b : 2 * b])):
            rim[:] = inner
        if kind == cv2.BORDER_REPLICATE:
            wide[:b], wide[-b:] = wide[b], wide[-b - 1]
            wide[:, :b], wide[:, -b:] = wide[:, b : b + 1], wide[:, -b - 1 : -b]


def build_texture(
    picture: NDArray[np.uint8], corner_m: tuple[float, float], size_m: tuple[float, float], *, repeats: bool
) -> Texture:
    """Make a texture of a picture (rows, columns, 4) uint8; raises ValueError as layout() does."""
    if picture.ndim != 3 or picture.shape[2] != 4 or picture.dtype != np.uint8:
        raise ValueError(f"A texture needs a uint8 picture of four channels, not {picture.shape}.")
    shape, levels = layout(*picture.shape[:2])
    atlas = np.zeros((*shape, 4), dtype=np.uint8)
    atlas[_BORDER : _BORDER + picture.shape[0], _BORDER : _BORDER + picture.shape[1]] = picture
    fill_levels(atlas, levels, repeats)
    return Texture(atlas, levels, corner_m, size_m, repeats)


def finest(atlas: NDArray[np.uint8], levels: NDArray[np.float32]) -> NDArray[np.uint8]:
    """The finest level's part of an atlas, to be painted on."""
    row, column, n_rows, n_columns = levels[0].astype(int)
    return atlas[row : row + n_rows, column : column + n_columns]


def dither(width_px: int, height_px: int) -> NDArray[np.float32]:
    """A threshold 0 to 1 for each pixel, (height, width) float32, evenly spread over every small neighbourhood.

    Jimenez's interleaved gradient noise (Next generation post processing in Call of Duty, SIGGRAPH 2014).
    """
    u, v = np.meshgrid(np.arange(width_px), np.arange(height_px))
    return np.asarray((52.9829189 * ((0.06711056 * u + 0.00583715 * v) % 1.0)) % 1.0, dtype=np.float32)


@njit(nogil=True, cache=True, error_model="numpy", fastmath=True)  # type: ignore[untyped-decorator]
def map_texture(
    columns: NDArray[np.float32],
    rows: NDArray[np.float32],
    inverse: NDArray[np.float32],
    rays: NDArray[np.float32],
    thresholds: NDArray[np.float32],
    centre: NDArray[np.float64],
    ned_from_camera: NDArray[np.float64],
    f_px: float,
    levels: NDArray[np.float32],
    frame: NDArray[np.float64],
    lean: float,
) -> tuple[int, int]:
    """Find where in a texture's atlas each pixel looks: `columns` and `rows` (height, width) float32, for cv2.remap.

    `inverse` is 1 / depth [1/m] and `rays` lens.ray_table's; both may be larger than the image. `thresholds` is
    dither()'s: pixel by pixel it chooses between the two mip levels that fit, so that no edge shows where the level
    changes, at half the price of mixing them. `centre` (3,) NED [m] and `ned_from_camera` (3, 3) are the camera's.
    `frame` is (7,): the texture's corner and size [m], its texel [m], whether it repeats, and how many of its levels
    say anything. `lean` moves the texture with the height, so that it goes on up a wall. Sky, and what is too far away
    for those levels, maps to outside the atlas. Returns the rows of the image (first, last) that see the texture.
    """
    height_px, width_px = columns.shape
    last = len(levels) - 1
    told = int(frame[6])
    texel_m = frame[4]
    repeats = frame[5] != 0.0
    # float32 throughout, so that the loop over a block becomes vector instructions.
    rotation = ned_from_camera.astype(np.float32)
    north_m, east_m = np.float32(centre[0] - frame[0]), np.float32(centre[1] - frame[1])
    down_m, lift = np.float32(centre[2]), np.float32(lean)
    r00, r01, r02 = rotation[0, 0], rotation[0, 1], rotation[0, 2]
    r10, r11, r12 = rotation[1, 0], rotation[1, 1], rotation[1, 2]
    r20, r21, r22 = rotation[2, 0], rotation[2, 1], rotation[2, 2]
    zero, half, one = np.float32(0.0), np.float32(0.5), np.float32(1.0)
    outside, tiny = np.float32(_OUTSIDE), np.float32(1e-6)
    first_row, last_row = height_px, -1
    for v in range(height_px):
        for first in range(0, width_px, _BLOCK_PX):
            end = min(first + _BLOCK_PX, width_px)
            rx, ry = rays[0, v, first], rays[1, v, first]
            w = max(inverse[v, first], inverse[v, end - 1], inverse[v, (first + end) >> 1])
            depth = one / max(tiny, w)
            fall = max(np.float32(0.02), r20 * rx + r21 * ry + r22)
            # A pixel's footprint on level ground is its size at that depth, stretched along the line of sight.
            stretch = math.sqrt(math.sqrt(one + rx * rx + ry * ry) / fall)
            level = max(math.log2(depth / f_px * stretch / texel_m), 0.0)
            if w <= tiny or level >= told:
                for u in range(first, end):
                    columns[v, u] = outside
                    rows[v, u] = outside
                continue
            first_row, last_row = min(first_row, v), v
            level = min(level, float(last))
            k0 = int(level)
            k1 = min(k0 + 1, last)
            part = np.float32(level - k0)
            row0, column0, row1, column1 = levels[k0, 0], levels[k0, 1], levels[k1, 0], levels[k1, 1]
            tall0, wide0, tall1, wide1 = levels[k0, 2], levels[k0, 3], levels[k1, 2], levels[k1, 3]
            per_n0, per_e0 = np.float32(tall0 / frame[2]), np.float32(wide0 / frame[3])
            per_n1, per_e1 = np.float32(tall1 / frame[2]), np.float32(wide1 / frame[3])
            fold0, fold1 = np.float32(0.5) / wide0, np.float32(0.5) / wide1
            fold2, fold3 = np.float32(0.5) / tall0, np.float32(0.5) / tall1
            for u in range(first, end):
                rx, ry = rays[0, v, u], rays[1, v, u]
                w = inverse[v, u]
                depth = one / max(tiny, w)
                is_coarse = thresholds[v, u] < part
                up = lift * (down_m + depth * (r20 * rx + r21 * ry + r22))
                x = (east_m + up + depth * (r10 * rx + r11 * ry + r12)) * (per_e1 if is_coarse else per_e0)
                y = (north_m + up + depth * (r00 * rx + r01 * ry + r02)) * (per_n1 if is_coarse else per_n0)
                wide = wide1 if is_coarse else wide0
                tall = tall1 if is_coarse else tall0
                fold_x = fold1 if is_coarse else fold0
                fold_y = fold3 if is_coarse else fold2
                if repeats:
                    x -= np.floor(x * (fold_x + fold_x)) * wide
                    y -= np.floor(y * (fold_y + fold_y)) * tall
                else:
                    x -= np.floor(x * fold_x) * (wide + wide)
                    y -= np.floor(y * fold_y) * (tall + tall)
                    x = wide - abs(x - wide)
                    y = tall - abs(y - tall)
                x += (column1 if is_coarse else column0) - half
                y += (row1 if is_coarse else row0) - half
                columns[v, u] = x if w > zero else outside
                rows[v, u] = y if w > zero else outside
    return first_row, last_row
