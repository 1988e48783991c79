"""Linking: pieces of one straight line become one long segment ([Ceron] 3.3.2)."""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vision.records import Segments


def segment_lengths_px(segments: Segments) -> NDArray[np.float64]:
    """Lengths [px], (n,) float64, of (n, 4) segments."""
    return np.hypot(segments[:, 2] - segments[:, 0], segments[:, 3] - segments[:, 1])


def link_segments(
    segments: Segments, max_turn_rad: float, max_aside_px: float, max_gap_px: float
) -> tuple[Segments, NDArray[np.float64]]:
    """Join the segments that continue one another, the longest first.

    A segment joins a line of the same direction (within `max_turn_rad`: similarity) when its end points lie within
    `max_aside_px` of it and the gap between them is at most `max_gap_px` and the length of both together (proximity;
    a long line may look further than a short one). The joined line is the total least squares fit of its pieces.

    `segments` is (n, 4) [px], directed as vision.cbs does it: the two edges of a conductor stay apart. Returns the
    lines, (m, 4) float64 [px], longest first and read-only, and how much of each line's length its pieces cover,
    (m,) float64 [px].
    """
    lengths_px = segment_lengths_px(segments)
    order = np.argsort(-lengths_px, kind="stable")
    lines = np.empty((len(segments), 4), dtype=np.float64)
    covered_px = np.empty(len(segments), dtype=np.float64)
    n_lines = link(
        np.ascontiguousarray(segments[order]), math.cos(max_turn_rad), max_aside_px, max_gap_px, lines, covered_px
    )
    lines = lines[:n_lines]
    order = np.argsort(-segment_lengths_px(lines), kind="stable")
    lines = lines[order]
    lines.setflags(write=False)
    return lines, covered_px[:n_lines][order]


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _add_piece(moments: NDArray[np.float64], segment: NDArray[np.float64]) -> None:
    """Add a segment's length and its first and second moments along that length to `moments`."""
    dx, dy = segment[2] - segment[0], segment[3] - segment[1]
    mid_x, mid_y = 0.5 * (segment[0] + segment[2]), 0.5 * (segment[1] + segment[3])
    length = math.hypot(dx, dy)
    moments[0] += length
    moments[1] += length * mid_x
    moments[2] += length * mid_y
    moments[3] += length * (mid_x * mid_x + dx * dx / 12.0)
    moments[4] += length * (mid_x * mid_y + dx * dy / 12.0)
    moments[5] += length * (mid_y * mid_y + dy * dy / 12.0)


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def link(
    segments: NDArray[np.float64],
    min_cosine: float,
    max_aside_px: float,
    max_gap_px: float,
    lines: NDArray[np.float64],
    covered_px: NDArray[np.float64],
) -> int:
    """Link `segments`, sorted longest first; writes `lines` and `covered_px`, returns how many there are."""
    n = segments.shape[0]
    is_used = np.zeros(n, dtype=np.bool_)
    moments = np.empty(6, dtype=np.float64)
    n_lines = 0
    for seed in range(n):
        if is_used[seed]:
            continue
        is_used[seed] = True
        moments[:] = 0.0
        _add_piece(moments, segments[seed])
        dx, dy = segments[seed, 2] - segments[seed, 0], segments[seed, 3] - segments[seed, 1]
        length = math.hypot(dx, dy)
        dx, dy = dx / length, dy / length
        mean_x, mean_y = 0.5 * (segments[seed, 0] + segments[seed, 2]), 0.5 * (segments[seed, 1] + segments[seed, 3])
        tail, head = -0.5 * length, 0.5 * length
        is_growing = True
        while is_growing:
            is_growing = False
            for j in range(seed + 1, n):
                if is_used[j]:
                    continue
                turn_x, turn_y = segments[j, 2] - segments[j, 0], segments[j, 3] - segments[j, 1]
                piece = math.hypot(turn_x, turn_y)
                if turn_x * dx + turn_y * dy < min_cosine * piece:
                    continue
                from_x, from_y = segments[j, 0] - mean_x, segments[j, 1] - mean_y
                to_x, to_y = segments[j, 2] - mean_x, segments[j, 3] - mean_y
                if max(abs(from_x * dy - from_y * dx), abs(to_x * dy - to_y * dx)) > max_aside_px:
                    continue
                start, end = from_x * dx + from_y * dy, to_x * dx + to_y * dy
                if max(start - head, tail - end) > min(max_gap_px, head - tail + piece):
                    continue
                is_used[j] = True
                is_growing = True
                tail_x, tail_y = mean_x + min(tail, start) * dx, mean_y + min(tail, start) * dy
                head_x, head_y = mean_x + max(head, end) * dx, mean_y + max(head, end) * dy
                _add_piece(moments, segments[j])
                mean_x, mean_y = moments[1] / moments[0], moments[2] / moments[0]
                angle = 0.5 * math.atan2(
                    2.0 * (moments[4] / moments[0] - mean_x * mean_y),
                    moments[3] / moments[0] - mean_x * mean_x - moments[5] / moments[0] + mean_y * mean_y,
                )
                new_x, new_y = math.cos(angle), math.sin(angle)
                if new_x * dx + new_y * dy < 0.0:
                    new_x, new_y = -new_x, -new_y
                dx, dy = new_x, new_y
                tail = (tail_x - mean_x) * dx + (tail_y - mean_y) * dy
                head = (head_x - mean_x) * dx + (head_y - mean_y) * dy
        lines[n_lines, 0], lines[n_lines, 1] = mean_x + tail * dx, mean_y + tail * dy
        lines[n_lines, 2], lines[n_lines, 3] = mean_x + head * dx, mean_y + head * dy
        covered_px[n_lines] = min(moments[0], head - tail)
        n_lines += 1
    return n_lines
