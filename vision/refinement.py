"""Refinement: where exactly an edge line runs, from where to where, and how sure it is, judged block by block."""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vision.gradient import UNIT

BLOCK = 16  # rows that are judged together
_REACH = 3  # how many columns from where it was found an edge is looked for
_MIN_BLOCK_COHERENCE = 0.3
_N_TURNS = 3
_TAIL = 0.25  # share of a line's coherence that the blocks beyond its end show at most
_MIN_TAIL = 0.25  # share of its blocks: shorter ones may as well be a gap
_PLATEAU = 0.5  # share of the best column's coherence that its neighbours need to belong to the same edge


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
    n_max = height // BLOCK + 1
    row, place, weight = np.empty(n_max), np.empty(n_max), np.empty(n_max)
    columns = np.empty(2 * _REACH + 1)
    sums = np.empty((2, 2 * _REACH + 1), dtype=np.int64)
    flat_x, flat_y = unit_x.reshape(-1), unit_y.reshape(-1)
    beside = np.empty((n_max, 3))  # coherence one column left of the line, on it, one column right
    nothing = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    first, last = 0, height - 1
    for turn in range(_N_TURNS):
        first, last = 0, height - 1
        if abs(slope) > 1e-9:
            at_left, at_right = centre + (1.0 - middle) / slope, centre + (width - 2.0 - middle) / slope
            first = max(first, math.ceil(min(at_left, at_right)))
            last = min(last, math.floor(max(at_left, at_right)))
        elif middle < 1.0 or middle > width - 2.0:
            return nothing
        n_rows = last - first + 1
        n_blocks = n_rows // BLOCK
        if n_blocks < 2:
            return nothing
        norm = sign / (UNIT * math.sqrt(1.0 + slope * slope))
        n_good = 0
        for block in range(n_blocks):
            begin, end = first + n_rows * block // n_blocks, first + n_rows * (block + 1) // n_blocks
            drift = sum_columns(flat_x, flat_y, width, begin, end, middle - slope * centre, slope, sums)
            for k in range(2 * _REACH + 1):
                columns[k] = (sums[0, k] - slope * sums[1, k]) * norm / (end - begin)
            best = _REACH
            reach = _REACH if turn == 0 else 2 if turn < _N_TURNS - 1 else 1
            for k in range(_REACH - reach, _REACH + reach + 1):
                if columns[k] > columns[best]:
                    best = k
            row[block] = 0.5 * (begin + end - 1) - centre
            weight[block] = max(0.0, columns[best])
            # The centre of gravity of the edge's columns: a thick edge has a plateau and no peak.
            low = high = best
            while low > 0 and columns[low - 1] > _PLATEAU * columns[best]:
                low -= 1
            while high < 2 * _REACH and columns[high + 1] > _PLATEAU * columns[best]:
                high += 1
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
        if turn == _N_TURNS - 1:
            break
        step, turn_slope = _robust_line(row[:n_blocks], place[:n_blocks], weight[:n_blocks])
        middle += step
        slope += turn_slope
        if abs(step) > _REACH + 1 or abs(slope) > 1.2:
            return nothing
    good_first, good_last = -1, -1
    for block in range(n_blocks):
        if weight[block] >= _MIN_BLOCK_COHERENCE:
            if good_first < 0:
                good_first = block
            good_last = block
    # Along the whole line at once, so that texture cannot choose its best place in each block.
    good_first, good_last, coherence = _surest_run(beside, good_first, good_last)
    covered = 0
    for block in range(good_first, good_last + 1):
        covered += weight[block] >= _MIN_BLOCK_COHERENCE
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
def _surest_run(beside: NDArray[np.float64], first: int, last: int) -> tuple[int, int, float]:
    """The blocks from where to where the line is, within `first` to `last`, and its mean coherence there.

    `beside` (n, 3) holds the blocks' coherence in three columns. A line that ends in the frame, at a bend or a pole,
    leaves blocks of mere texture beyond its end: they are cut off where they have much less coherence than the rest.
    """
    column, coherence = 0, 0.0
    for k in range(3):
        mean = beside[first : last + 1, k].mean()
        if mean > coherence:
            column, coherence = k, mean
    # The run that stands out most from half of what the better half of the blocks has (Kadane's maximal sum).
    ranked = np.sort(beside[first : last + 1, column])
    level = 0.5 * ranked[len(ranked) // 2 :].mean()
    best, begin, total, run_first, run_last = 0.0, first, 0.0, first, last
    for block in range(first, last + 1):
        if total <= 0.0:
            begin, total = block, 0.0
        total += beside[block, column] - level
        if total > best:
            best, run_first, run_last = total, begin, block
    n_run, n_rest = run_last - run_first + 1, last - first - run_last + run_first
    if n_run < 2 or n_rest < _MIN_TAIL * (n_run + n_rest):
        return first, last, coherence
    inside = beside[run_first : run_last + 1, column].mean()
    outside = (coherence * (last - first + 1) - inside * n_run) / n_rest
    if outside >= _TAIL * inside:
        return first, last, coherence
    return run_first, run_last, inside


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def sum_columns(
    unit_x: NDArray[np.int8],
    unit_y: NDArray[np.int8],
    width: int,
    begin: int,
    end: int,
    at_top: float,
    slope: float,
    sums: NDArray[np.int64],
) -> float:
    """Sum the unit gradient along the line x = at_top + slope y from row `begin` to `end`, and along its neighbours.

    `unit_x` and `unit_y` are the rows of `width` one after the other, (n,). Writes `sums`, (2, 2 _REACH + 1): both
    components, column by column from left of the line to right of it. Returns by how much the columns that were taken
    lie right of the line, added up over the rows.
    """
    sums[:] = 0
    drift = 0.0
    for y in range(begin, end):
        x_line = at_top + slope * y
        x = math.floor(x_line + 0.5)
        drift += x - x_line
        if x >= _REACH and x < width - _REACH:
            at = np.uint64(y * width + x - _REACH)  # unsigned: no check of every place for negative ones
            for k in range(np.uint64(2 * _REACH + 1)):
                sums[0, k] += unit_x[at + k]
                sums[1, k] += unit_y[at + k]
        else:
            for k in range(max(0, _REACH - x), min(2 * _REACH + 1, width - x + _REACH)):
                sums[0, k] += unit_x[y * width + x - _REACH + k]
                sums[1, k] += unit_y[y * width + x - _REACH + k]
    return drift


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
