"""Peaks: the lines whose projected sum no texture would reach.

Sums and lengths are (h, h + w), laid out as vision.projection.project leaves them; lengths are in rows.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

_CHUNK = 64  # sums that are looked over at once
_TEXTURE_SIGMAS = 4.4  # a sum of n unit gradients of texture is below this times sqrt(n), nearly always


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
def find_peaks(
    sums: NDArray[np.int16],
    lengths: NDArray[np.int16],
    min_mean: float,
    unit: float,
    min_length: float,
    peaks: NDArray[np.float64],
) -> int:
    """Find the lines whose sum is locally the largest of its sign, and large enough.

    That is `min_mean` times `unit` for each row, of which `min_length` count at least, and more than texture gives.
    Writes to `peaks`, (n, 4): slope [columns per row], the column abreast of the image's middle row, the sum's sign and
    how sure it is. Returns how many lines there are; more than n are left out.
    """
    height = sums.shape[0]
    width = sums.shape[1] - height
    n_peaks = 0
    least = unit * max(min_mean * min_length, _TEXTURE_SIGMAS * math.sqrt(min_length))
    least_sum = np.int16(least)
    end = height + width
    for lean in range(height):
        for chunk in range(height - lean, end, _CHUNK):
            chunk_end = min(chunk + _CHUNK, end)
            if not holds_any(sums[lean, chunk:chunk_end], least_sum):
                continue
            n_peaks = _peaks_of_chunk(
                sums, lengths, lean, chunk, chunk_end, least, min_mean, unit, min_length, peaks, n_peaks
            )
    return n_peaks


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def holds_any(sums: NDArray[np.int16], least: np.int16) -> bool:
    """Whether any of (n,) sums is at least `least` in size: on its own, so that the compiler can vectorise it."""
    n_large = 0
    for i in range(sums.shape[0]):
        n_large += (sums[i] >= least) | (sums[i] <= -least)
    return n_large > 0


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _peaks_of_chunk(
    sums: NDArray[np.int16],
    lengths: NDArray[np.int16],
    lean: int,
    begin: int,
    end: int,
    least: float,
    min_mean: float,
    unit: float,
    min_length: float,
    peaks: NDArray[np.float64],
    n_peaks: int,
) -> int:
    """Append to `peaks` those of one lean between the columns `begin` and `end`; see find_peaks."""
    height = sums.shape[0]
    width = sums.shape[1] - height
    for i in range(begin, end):
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
