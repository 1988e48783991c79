"""Projection: the sum of a field along every straight line through it, at once.

Sums along short lines are shared by all the long lines that run through them: the fast Hough or approximate discrete
Radon transform (Götz and Druckmüller 1996, Brady 1998), which takes h w log2 h additions where the plain way takes
h^2 w. Summed is the unit gradient across the line (vision.gradient): a conductor's edge adds up, texture cancels out.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def project(field: NDArray[np.int16], first: NDArray[np.int16], second: NDArray[np.int16]) -> int:
    """Sum `field`, (h, w) int16, along all lines that lean right by 0 to h - 1 columns from the first row to the last.

    The sum along the line from column x of the first row to column x + a of the last stands at [a, h + x], for x from
    -a to w - 1, in one of the two (h, h + w) int16 buffers: returns 0 for `first`, 1 for `second`. What stands
    elsewhere means nothing. The sums must fit into int16.
    """
    height, width = field.shape
    end = height + width
    for y in range(height):
        for x in range(width):
            first[y, height + x] = field[y, x]
    n_blocks = 1
    while n_blocks < height:
        n_blocks *= 2
    n_done = 0
    while n_blocks > 1:
        source, target = (first, second) if n_done % 2 == 0 else (second, first)
        for pair in range(n_blocks // 2):
            top = height * (2 * pair) // n_blocks
            middle = height * (2 * pair + 1) // n_blocks
            bottom = height * (2 * pair + 2) // n_blocks
            merge_blocks(source[top:middle], source[middle:bottom], target[top:bottom], height, end)
        n_blocks //= 2
        n_done += 1
    return n_done % 2


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def merge_blocks(
    upper: NDArray[np.int16], lower: NDArray[np.int16], merged: NDArray[np.int16], begin: int, end: int
) -> None:
    """Merge the sums over two neighbouring blocks of rows: one line through both is the sum of a line through each."""
    n_upper, n_lower = upper.shape[0], lower.shape[0]
    if n_upper == 0 or n_lower == 0:
        merged[:] = lower if n_upper == 0 else upper
        return
    for lean in range(n_upper + n_lower):
        share = lean / max(1, n_upper + n_lower - 1)
        upper_lean = int(share * (n_upper - 1) + 0.5)
        lower_lean = int(share * (n_lower - 1) + 0.5)
        shift = lean - lower_lean
        # Left of `low` only the lower block has been entered, right of `high` the lower one is left already.
        low, high = begin - upper_lean, end - shift
        sums, above, below = merged[lean], upper[upper_lean], lower[lower_lean]
        sums[begin - lean : low] = below[begin - lean + shift : low + shift]
        add(above[low:high], below[low + shift : end], sums[low:high])
        sums[high:end] = above[high:end]


@njit(cache=True, nogil=True, inline="never")  # type: ignore[untyped-decorator]
def add(one: NDArray[np.int16], other: NDArray[np.int16], total: NDArray[np.int16]) -> None:
    """Write one + other into `total`, all (n,): on its own, so that the compiler sees a loop that it can vectorise."""
    for i in range(total.shape[0]):
        total[i] = np.int16(one[i] + other[i])
