"""Edge lines: straight edges across a whole frame, found by projection and measured block by block.

Projecting the unit gradient finds lines that no local search can see, because a line of some hundred pixels is tens of
standard deviations above any texture. What it finds is refined below the pixel, and asked where it begins and ends.
"""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vision.gradient import UNIT, unit_gradient, working_scale
from vision.projection import project
from vision.records import Segments

_NORMAL_X, _NORMAL_Y = math.cos(math.pi / 8), math.sin(math.pi / 8)  # of the middle line of an octant
_MAX_PEAKS = 4096
_MAX_LINES = 24  # of each octant
_TEXTURE_SIGMAS = 4.4  # a sum of n unit gradients of texture is below this times sqrt(n), nearly always
_BLOCK = 16  # rows that are judged together
_REACH = 3  # how many columns from where it was found an edge is looked for
_MIN_BLOCK_COHERENCE = 0.3
_STEP_ASIDE_PX = 1.0  # of the shrunk image
_STEP_SPACING_PX = 3.0  # along the edge
_MERGE_ASIDE_PX = 1.5  # of the shrunk image: two findings of one edge lie this close at one end and in the middle


@dataclass(frozen=True, slots=True, eq=False)  # arrays have no single answer to ==
class EdgeLines:
    """Straight edges, the surest first, n of them.

    `segments` is (n, 4) float64 [px], from where an edge begins to where it ends, its brighter side on its right.
    `coherence` is (n,) float64 in 0 to 1: the mean share of the unit gradient that faces across the line; texture has
    0. `step` (n,) float64 [grey levels] is how much brighter its right side is, in the mean. `covered_px` is (n,)
    float64 [px]: the length of those blocks of the segment that show the edge.
    """

    segments: Segments
    coherence: NDArray[np.float64]
    step: NDArray[np.float64]
    covered_px: NDArray[np.float64]


class ProjectionFinder:
    """Finds edge lines by projection; keeps buffers for the last image's shape.

    `min_coherence` is what a line needs over the frame's whole chord, or over `min_length_share` of the frame's
    diagonal where the chord is shorter.
    """

    def __init__(self, min_coherence: float, min_length_share: float, min_contrast: float) -> None:
        self._min_coherence = min_coherence
        self._min_length_share = min_length_share
        self._min_contrast = min_contrast
        self._buffers: dict[tuple[int, int], tuple[NDArray[np.int16], NDArray[np.int16], NDArray[np.int16]]] = {}

    def find(self, grey: NDArray[np.uint8]) -> EdgeLines:
        """Find the edge lines of `grey`, (h, w) uint8 of any size."""
        scale = working_scale((grey.shape[0], grey.shape[1]))
        unit_x, unit_y = unit_gradient(grey, scale, self._min_contrast)
        found = [np.empty((0, 6))]
        if min(unit_x.shape) >= 2 * _BLOCK:
            found.append(self._steep_lines(unit_x, unit_y))
            flat = self._steep_lines(np.ascontiguousarray(unit_y.T), np.ascontiguousarray(unit_x.T))
            # Transposed back, the right-hand side of a line becomes its left-hand side.
            found.append(flat[:, [3, 2, 1, 0, 4, 5]])
        lines = np.concatenate(found)
        lines = lines[np.argsort(-lines[:, 4] * lines[:, 5], kind="stable")]
        lines = lines[keep_distinct(lines, _MERGE_ASIDE_PX)]
        segments = lines[:, :4] * scale + (scale - 1) / 2
        segments.setflags(write=False)
        return EdgeLines(
            segments, lines[:, 4], measure_steps(grey, segments, _STEP_ASIDE_PX * scale), lines[:, 5] * scale
        )

    def _steep_lines(self, unit_x: NDArray[np.int8], unit_y: NDArray[np.int8]) -> NDArray[np.float64]:
        """Refined lines within 45 degrees of the columns: (n, 6) segment, coherence, covered length."""
        height, width = unit_x.shape
        if (height, width) not in self._buffers:
            if len(self._buffers) == 2:  # one for the image, one for the transposed image
                self._buffers.clear()
            buffer = (height, height + width)
            self._buffers[height, width] = (
                np.zeros(buffer, dtype=np.int16),
                np.zeros(buffer, dtype=np.int16),
                line_lengths(height, width),
            )
        first, second, lengths = self._buffers[height, width]
        gain = min(1.0, 32000 / (UNIT * height))
        min_length = self._min_length_share * math.hypot(height, width)
        field = np.empty((height, width), dtype=np.int16)
        peaks = np.empty((_MAX_PEAKS, 4))
        lines = []
        for lean in (1, -1):
            across(unit_x, unit_y, lean, gain, field)
            sums = (first, second)[project(field, first, second)]
            n_peaks = find_peaks(sums, lengths, self._min_coherence, gain * UNIT * _NORMAL_X, min_length, peaks)
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
    lengths_px = np.hypot(segments[:, 2] - segments[:, 0], segments[:, 3] - segments[:, 1])
    coherence = covered_px / np.maximum(lengths_px, 1e-9)
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
def line_lengths(height: int, width: int) -> NDArray[np.int16]:
    """How many rows of an image each line of vision.projection.project crosses, (h, h + w) int16."""
    lengths = np.zeros((height, height + width), dtype=np.int16)
    for lean in range(height):
        for x in range(-lean, width):
            first, last = 0.0, height - 1.0
            if lean > 0:
                first = max(first, -x * (height - 1) / lean)
                last = min(last, (width - 1 - x) * (height - 1) / lean)
            lengths[lean, height + x] = max(0, int(last - first + 1))
    return lengths


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


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def find_peaks(
    sums: NDArray[np.int16],
    lengths: NDArray[np.int16],
    min_mean: float,
    unit: float,
    min_length: float,
    peaks: NDArray[np.float64],
) -> int:
    """Find the lines whose sum is locally the largest of its sign, and large enough.

    That is `min_mean` times `unit` for each row, and more than texture would give. Writes slope [columns per row], the
    column abreast of the image's middle row, the sum's sign and how sure it is; returns how many lines there are.
    """
    height = sums.shape[0]
    width = sums.shape[1] - height
    n_peaks = 0
    least = unit * max(min_mean * min_length, _TEXTURE_SIGMAS * math.sqrt(min_length))
    for lean in range(height):
        for i in range(height - lean, height + width):
            value = np.int32(sums[lean, i])
            size = abs(value)
            if size < least:
                continue
            length = max(float(lengths[lean, i]), min_length)
            if size < unit * max(min_mean * length, _TEXTURE_SIGMAS * math.sqrt(length)):
                continue
            is_peak = True
            for other_lean in range(max(0, lean - 2), min(height, lean + 3)):
                for j in range(max(height - other_lean, i - 2), min(height + width, i + 3)):
                    other = np.int32(sums[other_lean, j])
                    if value < 0:
                        other = -other
                    is_before = other_lean < lean or (other_lean == lean and j < i)
                    if other > size or (other == size and is_before):
                        is_peak = False
                        break
                if not is_peak:
                    break
            if is_peak and n_peaks < peaks.shape[0]:
                peaks[n_peaks, 0] = lean / (height - 1)
                peaks[n_peaks, 1] = i - height + 0.5 * lean
                peaks[n_peaks, 2] = 1.0 if value > 0 else -1.0
                peaks[n_peaks, 3] = size / math.sqrt(length)
                n_peaks += 1
    return n_peaks


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def refine(
    unit_x: NDArray[np.int8], unit_y: NDArray[np.int8], slope: float, middle: float, sign: float
) -> tuple[float, float, float, float, float, float]:
    """Refine the line x = middle + slope (y - (h - 1) / 2) and measure it.

    Each block of rows tells where across the line its edge is; a robust straight line through them is the answer, twice
    over. Returns x1, y1, x2, y2 with the brighter side on the right, the coherence over that length, and how much of it
    shows the edge [px]: 0 where there is no such line.
    """
    height, width = unit_x.shape
    centre = 0.5 * (height - 1)
    n_max = height // _BLOCK + 1
    row, place, weight = np.empty(n_max), np.empty(n_max), np.empty(n_max)
    columns = np.empty(2 * _REACH + 1)
    beside = np.empty((n_max, 3))  # coherence one column left of the line, on it, one column right
    nothing = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    first, last = 0, height - 1
    for turn in range(3):
        first, last = 0, height - 1
        if abs(slope) > 1e-9:
            at_left, at_right = centre + (1.0 - middle) / slope, centre + (width - 2.0 - middle) / slope
            first = max(first, math.ceil(min(at_left, at_right)))
            last = min(last, math.floor(max(at_left, at_right)))
        elif middle < 1.0 or middle > width - 2.0:
            return nothing
        n_rows = last - first + 1
        n_blocks = n_rows // _BLOCK
        if n_blocks < 2:
            return nothing
        norm = sign / (UNIT * math.sqrt(1.0 + slope * slope))
        n_good = 0
        for block in range(n_blocks):
            begin, end = first + n_rows * block // n_blocks, first + n_rows * (block + 1) // n_blocks
            columns[:] = 0.0
            drift = 0.0
            for y in range(begin, end):
                x_line = middle + slope * (y - centre)
                x = math.floor(x_line + 0.5)
                drift += x - x_line
                for k in range(-_REACH, _REACH + 1):
                    if 0 <= x + k < width:
                        columns[k + _REACH] += unit_x[y, x + k] - slope * unit_y[y, x + k]
            columns *= norm / (end - begin)
            best = _REACH
            reach = _REACH if turn == 0 else 2 if turn == 1 else 1
            for k in range(_REACH - reach, _REACH + reach + 1):
                if columns[k] > columns[best]:
                    best = k
            row[block] = 0.5 * (begin + end - 1) - centre
            weight[block] = max(0.0, columns[best])
            # The centre of gravity of the edge's columns: a thick edge has a plateau and no peak.
            low, high = max(0, best - 1), min(2 * _REACH, best + 1)
            total, moment = 1e-9, 0.0
            for k in range(low, high + 1):
                part = max(0.0, columns[k]) ** 2
                total += part
                moment += part * (k - _REACH)
            place[block] = moment / total + drift / (end - begin)
            beside[block] = columns[_REACH - 1 : _REACH + 2]
            n_good += weight[block] >= _MIN_BLOCK_COHERENCE
        if n_good < 2:
            return nothing
        if turn == 2:
            break
        step, turn_slope = _robust_line(row[:n_blocks], place[:n_blocks], weight[:n_blocks])
        middle += step
        slope += turn_slope
        if abs(step) > _REACH + 1 or abs(slope) > 1.2:
            return nothing
    good_first, good_last, covered, coherence = -1, -1, 0, 0.0
    for block in range(n_blocks):
        if weight[block] >= _MIN_BLOCK_COHERENCE:
            if good_first < 0:
                good_first = block
            good_last = block
            covered += 1
    # Along the whole line at once, so that texture cannot choose its best place in each block.
    for k in range(3):
        coherence = max(coherence, beside[good_first : good_last + 1, k].mean())
    # A block that is supported is supported to its end; the frame's outermost pixels have no gradient.
    begin_y = 0.0 if good_first == 0 and first <= 1 else first + n_rows * good_first / n_blocks
    end_y = (
        height - 1.0
        if good_last == n_blocks - 1 and last >= height - 2
        else first + n_rows * (good_last + 1) / n_blocks - 1
    )
    begin_x, end_x = middle + slope * (begin_y - centre), middle + slope * (end_y - centre)
    length = math.hypot(end_x - begin_x, end_y - begin_y)
    covered_length = length * covered / (good_last - good_first + 1)
    if sign > 0:  # brighter towards larger x, which is on the right of one who goes up
        return end_x, end_y, begin_x, begin_y, coherence, covered_length
    return begin_x, begin_y, end_x, end_y, coherence, covered_length


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _robust_line(
    row: NDArray[np.float64], place: NDArray[np.float64], weight: NDArray[np.float64]
) -> tuple[float, float]:
    """Offset and slope of place over row by least squares, reweighted three times by Cauchy's weights at 1 px."""
    offset, slope = 0.0, 0.0
    for turn in range(4):
        n, s_r, s_p, s_rr, s_rp = 1e-9, 0.0, 0.0, 0.0, 0.0
        for i in range(row.shape[0]):
            w = weight[i] if weight[i] >= _MIN_BLOCK_COHERENCE else 0.0
            if turn > 0:
                residual = place[i] - offset - slope * row[i]
                w /= 1.0 + residual * residual
            n += w
            s_r += w * row[i]
            s_p += w * place[i]
            s_rr += w * row[i] * row[i]
            s_rp += w * row[i] * place[i]
        spread = s_rr - s_r * s_r / n
        slope = (s_rp - s_r * s_p / n) / spread if spread > 1e-6 else 0.0
        offset = (s_p - slope * s_r) / n
    return offset, slope


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def keep_distinct(lines: NDArray[np.float64], max_aside: float) -> NDArray[np.int64]:
    """Which of the lines, (n, 6) surest first, are no second finding of a surer one.

    That is one of its polarity that meets it at one end, within `max_aside` [px], and stays near it to the other.
    """
    kept = np.empty(lines.shape[0], dtype=np.int64)
    n_kept = 0
    for i in range(lines.shape[0]):
        is_new = True
        for k in range(n_kept):
            x1, y1, x2, y2 = lines[kept[k], :4]
            length = math.hypot(x2 - x1, y2 - y1)
            dx, dy = (x2 - x1) / length, (y2 - y1) / length
            turn_x, turn_y = lines[i, 2] - lines[i, 0], lines[i, 3] - lines[i, 1]
            if turn_x * dx + turn_y * dy < 0.98 * math.hypot(turn_x, turn_y):
                continue
            start = abs((lines[i, 0] - x1) * dy - (lines[i, 1] - y1) * dx)
            end = abs((lines[i, 2] - x1) * dy - (lines[i, 3] - y1) * dx)
            if min(start, end) <= max_aside and start + end <= 8 * max_aside:
                is_new = False
                break
        if is_new:
            kept[n_kept] = i
            n_kept += 1
    return kept[:n_kept]
