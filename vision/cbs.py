"""Circle based search (CBS): straight segments in an edge image ([Ceron] 3.3, algorithm 3.1).

Around an edge pixel lies a raster circle. Where two opposite points of the circle and nearly all of the chord between
them are edge pixels, the centre is a valid point of a line: from there the search walks both ways, refits the line as
it goes, and erases what it took. Beyond the thesis, a pixel counts only where its gradient stands across the line.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vision.circle import Circle
from vision.edges import N_DIRECTIONS, agrees
from vision.records import Segments

_MAX_SEGMENTS = 4096


def find_segments(
    edge_codes: NDArray[np.uint8],
    circles: tuple[Circle, ...],
    min_fill: float,
    min_walk_fill: float,
    skip_px: int,
    seed_grid_px: int,
) -> Segments:
    """Find straight segments in edges coded as vision.edges does, (h, w) uint8.

    One pass for each of `circles`, in their order: the large circle takes what is surely straight, the smaller one
    what is left. A chord is valid with a share `min_fill` of its points set; the walk goes on while a share
    `min_walk_fill` of the next `skip_px` points is set. Centres are tried on the rows and columns of a grid of
    `seed_grid_px` only: no line longer than that avoids it.

    Returns (n, 4) float64 [px], fitted by total least squares, read-only. A segment is directed: the brighter side
    lies on its right.
    """
    margin = max(circle.radius_px for circle in circles)  # no chord of a centre inside the image leaves the array
    codes = np.pad(edge_codes, margin)
    found = np.empty((_MAX_SEGMENTS, 4), dtype=np.float64)
    n_found = 0
    for circle in circles:
        n_found = search(
            codes,
            margin,
            circle.chords,
            circle.wanted,
            circle.candidates,
            max(2, math.ceil(min_fill * (2 * circle.radius_px + 1))),
            min_walk_fill,
            skip_px,
            seed_grid_px,
            found,
            n_found,
        )
    segments = found[:n_found].copy()
    segments.setflags(write=False)
    return segments


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _is_set(flat: NDArray[np.uint8], pixel: int, beside: int, wanted: int) -> bool:
    """Whether a pixel, or the one `beside` it on either hand, is an edge of the wanted direction."""
    is_set: bool = (
        agrees(flat[pixel], wanted) or agrees(flat[pixel - beside], wanted) or agrees(flat[pixel + beside], wanted)
    )
    return is_set


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _valid_chord(
    flat: NDArray[np.uint8],
    centre: int,
    steps: NDArray[np.int64],
    beside: NDArray[np.int64],
    wanted: NDArray[np.int64],
    candidates: NDArray[np.int64],
    min_set: int,
) -> int:
    """The chord with the most points set around the pixel `centre` of the flat image, -1 where none has `min_set`.

    A chord is up to 3 degrees and half a pixel off the line that it finds, and a raster line can slip diagonally
    between two pixels of a raster circle: a point counts as set, too, where the pixel `beside` it is.
    """
    n_points = steps.shape[1]
    best = -1
    best_set = min_set - 1
    for k in candidates[flat[centre] - 1]:
        if k < 0:
            break
        if not _is_set(flat, centre + steps[k, 0], beside[k], wanted[k]):
            continue
        if not _is_set(flat, centre - steps[k, 0], beside[k], wanted[k]):
            continue
        n_set = 0
        for i in range(n_points):
            if _is_set(flat, centre + steps[k, i], beside[k], wanted[k]):
                n_set += 1
            elif n_set + n_points - 1 - i <= best_set:
                break
        if n_set > best_set:
            best, best_set = k, n_set
    return best


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _fit(sums: NDArray[np.float64]) -> tuple[float, float, float, float]:
    """Total least squares: mean x, y and unit direction of pixels given by the sums n, x, y, xx, xy, yy."""
    n = sums[0]
    mean_x, mean_y = sums[1] / n, sums[2] / n
    cov_xx = sums[3] / n - mean_x * mean_x
    cov_xy = sums[4] / n - mean_x * mean_y
    cov_yy = sums[5] / n - mean_y * mean_y
    angle = 0.5 * math.atan2(2.0 * cov_xy, cov_xx - cov_yy)
    return mean_x, mean_y, math.cos(angle), math.sin(angle)


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _add(sums: NDArray[np.float64], x: float, y: float) -> None:
    """Add a pixel to the sums of _fit."""
    sums[0] += 1.0
    sums[1] += x
    sums[2] += y
    sums[3] += x * x
    sums[4] += x * y
    sums[5] += y * y


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _walk(
    codes: NDArray[np.uint8],
    sums: NDArray[np.float64],
    start_x: float,
    start_y: float,
    sign: float,
    heading_x: float,
    heading_y: float,
    skip_px: int,
    min_hits: int,
    window: NDArray[np.int64],
) -> tuple[float, float]:
    """Walk from a line's pixel along (`sign` = 1) or against its heading; returns the last pixel that belongs to it.

    The pixels taken are erased and added to `sums`. Each window of `skip_px` steps decides as a whole: a line over
    texture loses single pixels, texture beside a line's end gives single pixels.
    """
    height, width = codes.shape
    last_x, last_y = start_x, start_y
    while True:
        mean_x, mean_y, dx, dy = _fit(sums)
        if dx * heading_x + dy * heading_y < 0.0:
            dx, dy = -dx, -dy
        turn = math.atan2(dx, -dy) / (2.0 * math.pi)
        wanted = math.floor(turn * N_DIRECTIONS + 0.5) % N_DIRECTIONS
        scale = sign / max(abs(dx), abs(dy))
        step_x, step_y = dx * scale, dy * scale
        is_steep = abs(dy) > abs(dx)
        # The point of the fitted line abreast of the last pixel, on the major axis' grid.
        along = (last_y - mean_y) / step_y if is_steep else (last_x - mean_x) / step_x
        n_hits = 0
        n_before_hole = -1
        hole = 0
        for i in range(1, skip_px + 1):
            px = mean_x + (along + i) * step_x
            py = mean_y + (along + i) * step_y
            x, y = math.floor(px + 0.5), math.floor(py + 0.5)
            # The nearest pixel across first, then the one on the side where the line truly passes, then the other.
            offset = py - y if not is_steep else px - x
            side = 1 if offset >= 0 else -1
            is_hit = False
            for shift in (0, side, -side):
                xx = x + shift if is_steep else x
                yy = y if is_steep else y + shift
                if xx < 0 or yy < 0 or xx >= width or yy >= height:
                    continue
                if agrees(codes[yy, xx], wanted):
                    window[n_hits, 0], window[n_hits, 1] = xx, yy
                    n_hits += 1
                    is_hit = True
                    break
            hole = 0 if is_hit else hole + 1
            if hole == 2 and n_before_hole < 0:
                n_before_hole = n_hits
        is_over = n_hits < min_hits
        n_taken = n_before_hole if is_over and n_before_hole >= 0 else n_hits
        for i in range(n_taken):
            _add(sums, float(window[i, 0]), float(window[i, 1]))
            codes[window[i, 1], window[i, 0]] = 0
            last_x, last_y = float(window[i, 0]), float(window[i, 1])
        if is_over:
            return last_x, last_y


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def search(
    codes: NDArray[np.uint8],
    margin: int,
    chords: NDArray[np.int64],
    wanted: NDArray[np.int64],
    candidates: NDArray[np.int64],
    min_set: int,
    min_walk_fill: float,
    skip_px: int,
    seed_grid_px: int,
    found: NDArray[np.float64],
    n_found: int,
) -> int:
    """One pass over the padded `codes`, which lose what is found; writes to `found` from `n_found` on, returns the end.

    Stops early when `found` is full.
    """
    height, width = codes.shape
    n_points = chords.shape[1]
    min_hits = math.ceil(min_walk_fill * skip_px)
    window = np.empty((skip_px, 2), dtype=np.int64)
    sums = np.zeros(6, dtype=np.float64)
    flat = codes.ravel()  # a view: `codes` is contiguous
    steps = chords[:, :, 1] * width + chords[:, :, 0]
    beside = np.where(np.abs(chords[:, 0, 1]) >= np.abs(chords[:, 0, 0]), 1, width)
    for y in range(margin, height - margin):
        is_grid_row = y % seed_grid_px == 0
        for x in range(margin, width - margin):
            if codes[y, x] == 0 or not (is_grid_row or x % seed_grid_px == 0):
                continue
            k = _valid_chord(flat, y * width + x, steps, beside, wanted, candidates, min_set)
            if k < 0:
                continue
            if n_found == found.shape[0]:
                return n_found
            sums[:] = 0.0
            for i in range(n_points):
                for aside in (0, -beside[k], beside[k]):
                    pixel = y * width + x + steps[k, i] + aside
                    if agrees(flat[pixel], wanted[k]):
                        _add(sums, float(pixel % width), float(pixel // width))
                        flat[pixel] = 0
                        break
            tip_x, tip_y = float(chords[k, n_points - 1, 0]), float(chords[k, n_points - 1, 1])
            head_x, head_y = _walk(codes, sums, x + tip_x, y + tip_y, 1.0, tip_x, tip_y, skip_px, min_hits, window)
            tail_x, tail_y = _walk(codes, sums, x - tip_x, y - tip_y, -1.0, tip_x, tip_y, skip_px, min_hits, window)
            mean_x, mean_y, dx, dy = _fit(sums)
            if dx * tip_x + dy * tip_y < 0.0:
                dx, dy = -dx, -dy
            tail = (tail_x - mean_x) * dx + (tail_y - mean_y) * dy
            head = (head_x - mean_x) * dx + (head_y - mean_y) * dy
            found[n_found, 0] = mean_x + tail * dx - margin
            found[n_found, 1] = mean_y + tail * dy - margin
            found[n_found, 2] = mean_x + head * dx - margin
            found[n_found, 3] = mean_y + head * dy - margin
            n_found += 1
    return n_found
