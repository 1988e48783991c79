"""The unit gradient: which way each pixel's edge faces, hardly how strong it is.

A leaf's edge is as strong as a conductor's. What tells them apart is that along a conductor all gradients face the
same way, and among leaves they face anywhere: with their strength taken away they cancel out.
"""

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

UNIT = 63
"""What a clear edge's unit gradient is stored as: int8, and sums of some hundreds of them fit into int16."""

_FULL_SCALE_MAX_PX = 260  # an image with no longer side than this is too small to give away resolution


def working_scale(shape: tuple[int, int]) -> int:
    """By how much an image of `shape` (height, width) is shrunk before projection: 1 or 2."""
    return 1 if max(shape) <= _FULL_SCALE_MAX_PX else 2


def unit_gradient(
    grey: NDArray[np.uint8], scale: int, min_contrast: float
) -> tuple[NDArray[np.int8], NDArray[np.int8]]:
    """Unit gradient of `grey`, (h, w) uint8, shrunk by `scale` (1 or 2) with area averaging.

    Returns its x and y components, (h // scale, w // scale) int8 in units of 1 / 63: g / sqrt(|g|^2 + min_contrast^2),
    with `min_contrast` in grey levels per pixel of the shrunk image; the outermost pixels are 0.
    """
    height, width = grey.shape[0] // scale, grey.shape[1] // scale
    small = grey
    if scale != 1 and min(height, width) > 0:
        small = np.asarray(
            cv2.resize(grey[: height * scale, : width * scale], (width, height), interpolation=cv2.INTER_AREA),
            dtype=np.uint8,
        )
    unit_x = np.zeros((height, width), dtype=np.int8)
    unit_y = np.zeros((height, width), dtype=np.int8)
    if min(height, width) > 2:
        normalise(np.ascontiguousarray(small), np.float32(min_contrast), unit_x, unit_y)
    return unit_x, unit_y


@njit(cache=True, nogil=True, fastmath=True)  # type: ignore[untyped-decorator]
def normalise(
    grey: NDArray[np.uint8], min_contrast: np.float32, unit_x: NDArray[np.int8], unit_y: NDArray[np.int8]
) -> None:
    """Write the unit gradient of `grey` by Sobel's kernels into `unit_x` and `unit_y`, all (h, w), but the border."""
    height, width = grey.shape
    floor = np.float32(8.0) * min_contrast
    floor_2 = floor * floor
    for y in range(1, height - 1):
        for x in range(1, width - 1):
            north_west, north, north_east = (
                np.int32(grey[y - 1, x - 1]),
                np.int32(grey[y - 1, x]),
                np.int32(grey[y - 1, x + 1]),
            )
            west, east = np.int32(grey[y, x - 1]), np.int32(grey[y, x + 1])
            south_west, south, south_east = (
                np.int32(grey[y + 1, x - 1]),
                np.int32(grey[y + 1, x]),
                np.int32(grey[y + 1, x + 1]),
            )
            along_x = np.float32(north_east - north_west + 2 * (east - west) + south_east - south_west)
            along_y = np.float32(south_west - north_west + 2 * (south - north) + south_east - north_east)
            factor = np.float32(UNIT) / np.sqrt(along_x * along_x + along_y * along_y + floor_2)
            unit_x[y, x] = np.int8(np.rint(along_x * factor))
            unit_y[y, x] = np.int8(np.rint(along_y * factor))
