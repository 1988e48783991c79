"""Edges: noise reduction and Canny, with thresholds that follow the image, and each edge pixel's direction.

An edge pixel keeps the direction of its gradient, because the line search then sees only pixels that can belong to the
line it follows, and the two edges of a thin conductor, 2 px apart, stay two lines.
"""

import math

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

N_DIRECTIONS = 64
"""How many directions an edge pixel's code tells apart, over the whole turn."""

GRADIENT_GAIN = 8.0
"""What a gradient's whole numbers hold for one grey level per pixel, as a 3x3 Sobel kernel answers."""

_N_SAMPLES = 8000  # pixels that the gradient's quantile is taken from


def is_image(image: NDArray[np.generic]) -> bool:
    """Whether it is what the line finder reads: (h, w) grey or (h, w, 3) BGR uint8, not empty."""
    has_shape = image.ndim == 2 or (image.ndim == 3 and image.shape[2] == 3)
    return image.dtype == np.uint8 and has_shape and image.size > 0


def to_grey(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return `image`, (h, w) grey or (h, w, 3) BGR uint8, as (h, w) grey.

    Raises ValueError for any other shape, for an empty image, and for any other dtype.
    """
    if image.dtype != np.uint8:
        raise ValueError(f"The image is {image.dtype}, but the line finder reads uint8: convert it first.")
    if not is_image(image):
        raise ValueError(
            f"The image has the shape {image.shape}, but the line finder reads (height, width) grey or "
            "(height, width, 3) BGR: convert it first."
        )
    if image.ndim == 2:
        return np.ascontiguousarray(image)
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), dtype=np.uint8)


def find_edges(
    grey: NDArray[np.uint8], blur_sigma_px: float, edge_quantile: float, low_ratio: float, min_contrast: float
) -> NDArray[np.uint8]:
    """Edge pixels of a grey image by Canny's detector ([Ceron] 3.2.1), coded with their direction.

    The upper hysteresis threshold is the gradient that a share `edge_quantile` of the pixels stays below, so a textured
    ground raises it and a plain one lowers it, but never below `min_contrast` [grey levels per pixel]; the lower one is
    `low_ratio` of it.

    `grey` is (h, w) uint8. Returns (h, w) uint8: 0 where there is no edge, else 1 + the gradient's direction in 64ths
    of a turn, from image right (x) towards image down (y).
    """
    blurred = cv2.GaussianBlur(grey, (0, 0), blur_sigma_px) if blur_sigma_px > 0 else grey
    gradient_x, gradient_y = cv2.spatialGradient(blurred)
    return link_edges(
        np.asarray(gradient_x, dtype=np.int16),
        np.asarray(gradient_y, dtype=np.int16),
        edge_quantile,
        low_ratio,
        GRADIENT_GAIN * min_contrast,
    )


def link_edges(
    gradient_x: NDArray[np.int16], gradient_y: NDArray[np.int16], edge_quantile: float, low_ratio: float, floor: float
) -> NDArray[np.uint8]:
    """Canny's second half: maxima across the gradient, hysteresis with find_edges' thresholds, and codes.

    The gradient is (h, w) int16 in any unit, the one of `floor`, which the upper threshold does not go below. Returns
    (h, w) uint8 codes as find_edges does.
    """
    stride = max(1, math.isqrt(gradient_x.size // _N_SAMPLES))
    sample_x = gradient_x[::stride, ::stride].astype(np.float32)
    sample_y = gradient_y[::stride, ::stride].astype(np.float32)
    magnitudes = np.hypot(sample_x, sample_y).ravel()
    rank = min(magnitudes.size - 1, int(edge_quantile * magnitudes.size))
    high = max(floor, float(np.partition(magnitudes, rank)[rank]))
    edges = cv2.Canny(gradient_x, gradient_y, low_ratio * high, high, L2gradient=True)
    codes = np.zeros(gradient_x.shape, dtype=np.uint8)
    encode_directions(np.asarray(edges, dtype=np.uint8), gradient_x, gradient_y, codes)
    return codes


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def agrees(code: int, wanted: int) -> bool:
    """Whether a pixel is an edge, and its direction within 3 steps (17 degrees, and half a step) of the wanted one.

    `code` is 0 to 64 as find_edges gives it, `wanted` a direction 0 to 63.
    """
    return code != 0 and ((code - 1 - wanted + 3) & (N_DIRECTIONS - 1)) <= 6


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def encode_directions(
    edges: NDArray[np.uint8],
    gradient_x: NDArray[np.int16],
    gradient_y: NDArray[np.int16],
    codes: NDArray[np.uint8],
) -> None:
    """Write the code of each edge pixel into `codes`; all arrays are (h, w)."""
    height, width = edges.shape
    eighth = N_DIRECTIONS // 8
    for y in range(height):
        for x in range(width):
            if edges[y, x] == 0:
                continue
            along_x, along_y = float(gradient_x[y, x]), float(gradient_y[y, x])
            size_x, size_y = abs(along_x), abs(along_y)
            # atan(t) = t (pi / 4 + 0.273 (1 - t)) on [0, 1] is right to 0.3 degrees, and much faster than atan2.
            t = min(size_x, size_y) / max(size_x, size_y)
            turn = t * (eighth + 0.273 / (2.0 * math.pi) * N_DIRECTIONS * (1.0 - t))
            if size_y > size_x:
                turn = 2 * eighth - turn
            if along_x < 0:
                turn = 4 * eighth - turn
            if along_y < 0:
                turn = N_DIRECTIONS - turn
            codes[y, x] = 1 + int(turn + 0.5) % N_DIRECTIONS
