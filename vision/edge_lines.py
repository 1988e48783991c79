"""Edge lines: straight edges across a whole frame, found by projection and measured block by block.

Projecting the unit gradient finds lines that no local search can see, because a line of some hundred pixels is tens of
standard deviations above any texture. What it finds is refined below the pixel, and asked where it begins and ends.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vision.checks import check_shares
from vision.gradient import UNIT, unit_gradient, working_scale
from vision.linking import segment_lengths_px
from vision.peaks import find_peaks, least_sums, line_lengths
from vision.projection import project
from vision.records import Segments
from vision.refinement import BLOCK, keep_distinct, refine

_NORMAL_X, _NORMAL_Y = math.cos(math.pi / 8), math.sin(math.pi / 8)  # of the middle line of an octant
_MAX_PEAKS = 4096
_MAX_LINES = 32  # of each octant
_STEP_ASIDE_PX = 1.0  # of the shrunk image
_STEP_SPACING_PX = 3.0  # along the edge
_STEP_PREFERENCE = 4e-4  # per grey level: a tie-break of a tenth at most
_MERGE_ASIDE_PX = 1.5  # of the shrunk image: two findings of one edge lie this close at one end and in the middle


@dataclass(frozen=True, slots=True, eq=False)  # arrays have no single answer to ==
class EdgeLines:
    """Straight edges, the surest first, n of them.

    `segments` is (n, 4) float64 [px], from where an edge begins to where it ends, its brighter side on its right.
    `coherence` is (n,) float64 in 0 to 1: the mean share of the unit gradient that faces across the line; texture has
    0. `step` (n,) float64 [grey levels] is how much brighter its right side is, in the mean. `covered_px` is (n,)
    float64 [px]: the length of those blocks of the segment that show the edge. All are made read-only.
    """

    segments: Segments
    coherence: NDArray[np.float64]
    step: NDArray[np.float64]
    covered_px: NDArray[np.float64]

    def __post_init__(self) -> None:
        for array in (self.segments, self.coherence, self.step, self.covered_px):
            array.setflags(write=False)


@dataclass(frozen=True, slots=True)
class ProjectionSettings:
    """What a line needs.

    That is `min_coherence` in the mean over the frame's chord, or over `min_length_share` of the frame's diagonal where
    the chord is shorter. A gradient below `min_contrast` [grey levels per pixel of the shrunk image]
    counts less. Raises ValueError for what cannot work.
    """

    min_coherence: float = 0.3
    min_length_share: float = 0.25
    min_contrast: float = 2.5

    def __post_init__(self) -> None:
        check_shares(self, "min_coherence", "min_length_share")


class _Buffers(NamedTuple):
    """What the projection of images of one shape needs, all (h, h + w) int16: see vision.projection, vision.peaks."""

    first: NDArray[np.int16]
    second: NDArray[np.int16]
    lengths: NDArray[np.int16]
    least: NDArray[np.int16]


class ProjectionFinder:
    """Finds edge lines by projection; keeps buffers for the last image's shape."""

    def __init__(self, settings: ProjectionSettings) -> None:
        self._settings = settings
        self._buffers: dict[tuple[int, int], _Buffers] = {}

    def find(self, grey: NDArray[np.uint8]) -> EdgeLines:
        """Find the edge lines of `grey`, (h, w) uint8 of any size."""
        scale = working_scale((grey.shape[0], grey.shape[1]))
        unit_x, unit_y = unit_gradient(grey, scale, self._settings.min_contrast)
        found = [np.empty((0, 6))]
        if min(unit_x.shape) >= 2 * BLOCK:
            found.append(self._steep_lines(unit_x, unit_y))
            flat = self._steep_lines(np.ascontiguousarray(unit_y.T), np.ascontiguousarray(unit_x.T))
            # Transposed back, the right-hand side of a line becomes its left-hand side.
            found.append(flat[:, [3, 2, 1, 0, 4, 5]])
        lines = np.concatenate(found)
        segments = lines[:, :4] * scale + (scale - 1) / 2
        steps = measure_steps(grey, segments, _STEP_ASIDE_PX * scale)
        # Of several findings of one edge, all but equally long and even, the one with the highest step lies on it.
        best_first = np.argsort(-lines[:, 4] * lines[:, 5] * (1.0 + _STEP_PREFERENCE * steps), kind="stable")
        kept = best_first[keep_distinct(lines[best_first], _MERGE_ASIDE_PX)]
        kept = kept[np.argsort(-lines[kept, 4] * lines[kept, 5], kind="stable")]
        return EdgeLines(segments[kept], lines[kept, 4], steps[kept], lines[kept, 5] * scale)

    def _steep_lines(self, unit_x: NDArray[np.int8], unit_y: NDArray[np.int8]) -> NDArray[np.float64]:
        """Refined lines within 45 degrees of the columns: (n, 6) segment, coherence, covered length."""
        height, width = unit_x.shape
        gain = min(1.0, 32000 / (UNIT * height))
        if (height, width) not in self._buffers:
            if len(self._buffers) == 2:  # one for the image, one for the transposed image
                self._buffers.clear()
            buffer = (height, height + width)
            min_length = math.ceil(self._settings.min_length_share * math.hypot(height, width))
            lengths = line_lengths(height, width, min_length)
            unit = gain * UNIT * _NORMAL_X
            least = least_sums(lengths, self._settings.min_coherence, unit)
            self._buffers[height, width] = _Buffers(
                np.zeros(buffer, dtype=np.int16), np.zeros(buffer, dtype=np.int16), lengths, least
            )
        buffers = self._buffers[height, width]
        field = np.empty((height, width), dtype=np.int16)
        peaks = np.empty((_MAX_PEAKS, 4))
        lines = []
        for lean in (1, -1):
            across(unit_x, unit_y, lean, gain, field)
            sums = (buffers.first, buffers.second)[project(field, buffers.first, buffers.second)]
            n_peaks = find_peaks(sums, buffers.least, buffers.lengths, peaks)
            surest = np.argsort(-peaks[:n_peaks, 3], kind="stable")[:_MAX_LINES]
            for slope, middle, sign, _ in peaks[surest].tolist():
                at = middle if lean == 1 else width - 1 - middle
                line = refine(unit_x, unit_y, lean * slope, at, sign)
                if line[5] > 0:
                    lines.append(line)
        return np.array(lines, dtype=np.float64).reshape(-1, 6)


def edge_lines(grey: NDArray[np.uint8], segments: Segments, covered_px: NDArray[np.float64]) -> EdgeLines:
    """What another detector found, (n, 4) segments covered for (n,) `covered_px` [px], as edge lines.

    The share that is covered stands for the coherence.
    """
    coherence = covered_px / np.maximum(segment_lengths_px(segments), 1e-9)
    order = np.argsort(-covered_px, kind="stable")
    steps = measure_steps(grey, segments, _STEP_ASIDE_PX)
    return EdgeLines(segments[order], coherence[order], steps[order], covered_px[order])


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def measure_steps(grey: NDArray[np.uint8], segments: NDArray[np.float64], aside_px: float) -> NDArray[np.float64]:
    """How much brighter (n,) [grey levels] an image is `aside_px` right of each of (n, 4) segments than left of it."""
    height, width = grey.shape
    steps = np.zeros(segments.shape[0])
    for i in range(segments.shape[0]):
        x1, y1, x2, y2 = segments[i]
        length = math.hypot(x2 - x1, y2 - y1)
        aside_x, aside_y = -aside_px * (y2 - y1) / length, aside_px * (x2 - x1) / length
        n_steps = int(length / _STEP_SPACING_PX) + 1
        total = 0.0
        for k in range(n_steps):
            x, y = x1 + (k + 0.5) / n_steps * (x2 - x1), y1 + (k + 0.5) / n_steps * (y2 - y1)
            right_x = min(max(int(x + aside_x + 0.5), 0), width - 1)
            right_y = min(max(int(y + aside_y + 0.5), 0), height - 1)
            left_x = min(max(int(x - aside_x + 0.5), 0), width - 1)
            left_y = min(max(int(y - aside_y + 0.5), 0), height - 1)
            total += np.float64(grey[right_y, right_x]) - np.float64(grey[left_y, left_x])
        steps[i] = total / n_steps
    return steps


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def across(
    unit_x: NDArray[np.int8], unit_y: NDArray[np.int8], lean: int, gain: float, field: NDArray[np.int16]
) -> None:
    """Write the unit gradient's part across an octant's middle line into `field`, all (h, w).

    It is mirrored for the octant that leans left (`lean` -1), so that its lines, too, lean right.
    """
    height, width = field.shape
    gain_x, gain_y = np.float32(gain * _NORMAL_X), np.float32(-lean * gain * _NORMAL_Y)
    for y in range(height):
        if lean == 1:
            for x in range(width):
                field[y, x] = np.int16(np.rint(gain_x * unit_x[y, x] + gain_y * unit_y[y, x]))
        else:
            for x in range(width):
                field[y, width - 1 - x] = np.int16(np.rint(gain_x * unit_x[y, x] + gain_y * unit_y[y, x]))
