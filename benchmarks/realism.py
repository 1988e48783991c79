"""What a picture is like in figures that a photograph and a rendered picture have in common."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.page import table

Image = NDArray[np.uint8]

BLOCK_PX = 16
SPECTRUM_PX = 256  # the side of the square whose spectrum is taken
SPECTRUM_RANGE = (0.02, 0.3)  # cycles per pixel: below it the window counts, above it the lens
ACROSS_PX = 20  # a conductor's profile reaches so far to both sides,
BESIDE_PX = 12  # the ground counts from here on,
STEP_PX = 0.25
PIECE_PX = 32  # and it is the median over so much of its length
LEAST_LENGTH_PX = 100
BOTH_EDGES_PX = 13  # the labels of a conductor's two edges are at most so far apart


@dataclass(frozen=True, slots=True)
class Figures:
    """What one picture is like; grey levels are 0 to 255.

    `gradient` has the 50th, 90th and 99th percentile of the gradient's length [grey levels per pixel], `local_contrast`
    the median over blocks of standard deviation by mean, `slope` the exponent of the spectrum's power over frequency.
    `conductors` are (width [px] at half height, contrast [grey levels], contrast by the ground's standard deviation)
    of pieces of labelled conductors.
    """

    mean: float
    spread: float
    gradient: tuple[float, float, float]
    local_contrast: float
    slope: float
    saturation: float
    conductors: tuple[tuple[float, float, float], ...]


def measure(image: Image, labels: Image | None) -> Figures:
    """The figures of a picture (h, w, 3) BGR, and of the conductors that are labelled in it (h, w)."""
    grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY).astype(np.float64)
    dy, dx = np.gradient(grey)
    saturation = cv2.cvtColor(image, cv2.COLOR_BGR2HSV)[..., 1]
    p50, p90, p99 = np.percentile(np.hypot(dx, dy), (50, 90, 99)).tolist()
    return Figures(
        mean=float(grey.mean()),
        spread=float(grey.std()),
        gradient=(p50, p90, p99),
        local_contrast=local_contrast(grey),
        slope=spectrum_slope(grey),
        saturation=float(saturation.mean()) / 255.0,
        conductors=() if labels is None else tuple(conductor_pieces(grey, labels)),
    )


def local_contrast(grey: NDArray[np.float64]) -> float:
    """Median over blocks of the standard deviation by the mean."""
    h, w = (side // BLOCK_PX for side in grey.shape)
    blocks = grey[: h * BLOCK_PX, : w * BLOCK_PX].reshape(h, BLOCK_PX, w, BLOCK_PX)
    return float(np.median(blocks.std(axis=(1, 3)) / (blocks.mean(axis=(1, 3)) + 1.0)))


def spectrum_slope(grey: NDArray[np.float64]) -> float:
    """Exponent of the power over frequency in the picture's middle; about -2 for natural scenes (Field 1987)."""
    top, left = ((side - SPECTRUM_PX) // 2 for side in grey.shape)
    square = grey[top : top + SPECTRUM_PX, left : left + SPECTRUM_PX]
    window = np.outer(np.hanning(SPECTRUM_PX), np.hanning(SPECTRUM_PX))
    power = np.abs(np.fft.fft2((square - square.mean()) * window)) ** 2
    frequency = np.fft.fftfreq(SPECTRUM_PX)
    radius = np.hypot(*np.meshgrid(frequency, frequency))
    edges = np.geomspace(*SPECTRUM_RANGE, 16)
    band = np.digitize(radius, edges)
    middles = np.sqrt(edges[1:] * edges[:-1])
    means = [power[band == k].mean() for k in range(1, len(edges))]
    return float(np.polyfit(np.log(middles), np.log(np.array(means) + 1e-9), 1)[0])


def conductor_pieces(grey: NDArray[np.float64], labels: Image) -> Iterable[tuple[float, float, float]]:
    """Width [px], contrast [grey levels] and contrast in standard deviations of the ground, piece by piece."""
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (BOTH_EDGES_PX, BOTH_EDGES_PX))
    framed = cv2.copyMakeBorder(labels, *(BOTH_EDGES_PX,) * 4, cv2.BORDER_CONSTANT, value=0)
    whole = cv2.morphologyEx(framed, cv2.MORPH_CLOSE, kernel)[
        BOTH_EDGES_PX:-BOTH_EDGES_PX, BOTH_EDGES_PX:-BOTH_EDGES_PX
    ]
    n_parts, parts = cv2.connectedComponents((whole > 0).astype(np.uint8))
    for part in range(1, n_parts):
        y, x = np.nonzero(parts == part)
        if len(x) < LEAST_LENGTH_PX:
            continue
        variances, axes = np.linalg.eigh(np.cov(x, y))
        length_px = math.sqrt(12.0 * variances[1])
        if length_px < LEAST_LENGTH_PX or math.sqrt(12.0 * variances[0]) > BOTH_EDGES_PX:
            continue  # short, or two that cross or touch
        yield from _profiles(grey, x, y, axes[:, 1], length_px)


def _profiles(
    grey: NDArray[np.float64],
    x: NDArray[np.int64],
    y: NDArray[np.int64],
    axis: NDArray[np.float64],
    length_px: float,
) -> Iterable[tuple[float, float, float]]:
    """Cut the conductor of some labelled pixels out along its sagging middle, and measure its pieces."""
    along = (x - x.mean()) * axis[0] + (y - y.mean()) * axis[1]
    across = (y - y.mean()) * axis[0] - (x - x.mean()) * axis[1]
    sag = np.polyfit(along, across, 2)
    t = np.arange(-length_px / 2, length_px / 2)[:, None]
    offsets = np.arange(-ACROSS_PX, ACROSS_PX + STEP_PX, STEP_PX)
    a = np.polyval(sag, t) + offsets[None, :]
    map_x = (x.mean() + t * axis[0] - a * axis[1]).astype(np.float32)
    map_y = (y.mean() + t * axis[1] + a * axis[0]).astype(np.float32)
    strip = cv2.remap(grey.astype(np.float32), map_x, map_y, cv2.INTER_CUBIC, borderValue=math.nan)
    is_beside = np.abs(offsets) >= BESIDE_PX
    for first in range(0, len(strip) - PIECE_PX + 1, PIECE_PX):
        piece = strip[first : first + PIECE_PX]
        if not np.isfinite(piece).all():
            continue  # it reaches out of the picture
        profile = np.median(piece, axis=0)
        ground, sigma = float(np.median(profile[is_beside])), float(piece[:, is_beside].std())
        height = np.where(np.abs(offsets) < BESIDE_PX - 4, np.abs(profile - ground), 0.0)
        peak = int(np.argmax(height))
        is_high = np.abs(profile - ground) >= 0.5 * height[peak]
        left, right = peak, peak
        while left > 0 and is_high[left - 1]:
            left -= 1
        while right + 1 < len(is_high) and is_high[right + 1]:
            right += 1
        yield (right - left + 1) * STEP_PX, float(height[peak]), float(height[peak]) / max(sigma, 1.0)


def figures_table(groups: Iterable[tuple[str, Iterable[Figures]]]) -> str:
    """A table with a line for each named group of pictures: medians, and tenth to ninetieth percentile in brackets."""
    rows = []
    for name, members in groups:
        figures = list(members)
        conductors = np.array([piece for one in figures for piece in one.conductors]).reshape(-1, 3)
        gradient = np.median([one.gradient for one in figures], axis=0).tolist()
        rows.append(
            [
                name,
                _range([one.mean for one in figures], 0),
                _range([one.spread for one in figures], 0),
                " / ".join(f"{value:.1f}" for value in gradient),
                _range([one.local_contrast for one in figures], 2),
                _range([one.slope for one in figures], 1),
                _range([one.saturation for one in figures], 2),
                *(_range(column, digits) for column, digits in zip(conductors.T, (1, 0, 1), strict=True)),
            ]
        )
    columns = ["median (10 to 90 %)", "luminance", "its spread", "gradient p50 / p90 / p99", "local contrast"]
    columns += ["spectrum's slope", "saturation", "conductor's width [px]", "its contrast", "contrast / ground's sigma"]
    return table(columns, rows)


def _range(values: Iterable[float] | NDArray[np.float64], digits: int) -> str:
    known = np.array(list(values))
    if not known.size:
        return "-"
    low, middle, high = np.percentile(known, (10, 50, 90)).tolist()
    return f"{middle:.{digits}f} ({low:.{digits}f} to {high:.{digits}f})"
