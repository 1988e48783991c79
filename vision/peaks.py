"""Peaks: the lines whose projected sum no texture would reach.

Sums and lengths are (h, h + w), laid out as vision.projection.project leaves them; lengths are in rows.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

_CHUNK = 64  # sums that are looked over at once
_LARGEST = 32767
_TEXTURE_SIGMAS = 4.4  # a sum of n unit gradients of texture is below this times sqrt(n), nearly always


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def line_lengths(height: int, width: int, at_least: int) -> NDArray[np.int16]:
    """How many rows of an image each line of vision.projection.project crosses, (h, h + w) int16.

    Shorter ones count as `at_least`, so that they have to agree all the more.
    """
    lengths = np.full((height, height + width), at_least, dtype=np.int16)
    for lean in range(height):
        for x in range(-lean, width):
            first, last = 0.0, height - 1.0
            if lean > 0:
                first = max(first, -x * (height - 1) / lean)
                last = min(last, (width - 1 - x) * (height - 1) / lean)
            lengths[lean, height + x] = max(at_least, int(last - first + 1))
    return lengths


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def least_sums(lengths: NDArray[np.int16], min_mean: float, unit: float) -> NDArray[np.int16]:
    """How large the sum of each line of line_lengths must be, (h, h + w) int16.

    That is `min_mean` times `unit` for each row, and more than texture gives.
    """
    least = np.empty(lengths.shape, dtype=np.int16)
    for lean in range(lengths.shape[0]):
        for i in range(lengths.shape[1]):
            length = float(lengths[lean, i])
            wanted = math.ceil(unit * max(min_mean * length, _TEXTURE_SIGMAS * math.sqrt(length)))
            least[lean, i] = np.int16(min(wanted, _LARGEST))
    return least


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def find_peaks(
    sums: NDArray[np.int16], least: NDArray[np.int16], lengths: NDArray[np.int16], peaks: NDArray[np.float64]
) -> int:
    """Find the lines whose sum reaches `least` (least_sums) and is locally the largest of its sign.

    Writes to `peaks`, (n, 4): slope [columns per row], the column abreast of the image's middle row, the sum's sign and
    how sure it is. Returns how many lines there are; more than n are left out.
    """
    height, end = sums.shape
    n_peaks = 0
    flat_sums, flat_least = sums.reshape(-1), least.reshape(-1)
    for lean in range(height):
        for chunk in range(height - lean, end, _CHUNK):
            chunk_end = min(chunk + _CHUNK, end)
            at, n = np.uint64(lean * end + chunk), np.uint64(chunk_end - chunk)
            if not holds_any(flat_sums, flat_least, at, n):
                continue
            for i in range(chunk, chunk_end):
                if abs(np.int32(sums[lean, i])) < least[lean, i] or not _is_peak(sums, lean, i):
                    continue
                if n_peaks < peaks.shape[0]:
                    peaks[n_peaks, 0] = lean / (height - 1)
                    peaks[n_peaks, 1] = i - height + 0.5 * lean
                    peaks[n_peaks, 2] = 1.0 if sums[lean, i] > 0 else -1.0
                    peaks[n_peaks, 3] = abs(np.int32(sums[lean, i])) / math.sqrt(lengths[lean, i])
                    n_peaks += 1
    return n_peaks


@njit(cache=True, nogil=True, inline="never")  # type: ignore[untyped-decorator]
def holds_any(sums: NDArray[np.int16], least: NDArray[np.int16], begin: int, n: int) -> bool:
    """Whether any of the `n` sums from `begin` on reaches its least size, both (m,).

    On its own, with unsigned places instead of slices, so that the compiler can vectorise it (vision.projection).
    """
    best = np.int16(-_LARGEST)
    for i in range(n):
        size = np.int16(abs(sums[begin + i]))
        above = np.int16(size - least[begin + i])
        best = above if above > best else best
    return bool(best >= 0)


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _is_peak(sums: NDArray[np.int16], lean: int, i: int) -> bool:
    """Whether no sum of the same sign within two places is larger; of equal ones the first is the peak."""
    height, end = sums.shape
    value = np.int32(sums[lean, i])
    size = abs(value)
    for other_lean in range(max(0, lean - 2), min(height, lean + 3)):
        for j in range(max(height - other_lean, i - 2), min(end, i + 3)):
            other = np.int32(sums[other_lean, j]) if value > 0 else -np.int32(sums[other_lean, j])
            is_before = other_lean < lean or (other_lean == lean and j < i)
            if other > size or (other == size and is_before):
                return False
    return True
