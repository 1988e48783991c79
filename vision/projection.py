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
    for y in range(height):
        for x in range(width):
            first[y, height + x] = field[y, x]
    flat_first, flat_second = first.reshape(-1), second.reshape(-1)
    n_blocks = 1
    while n_blocks < height:
        n_blocks *= 2
    n_done = 0
    while n_blocks > 1:
        source, target = (flat_first, flat_second) if n_done % 2 == 0 else (flat_second, flat_first)
        for pair in range(n_blocks // 2):
            top = height * (2 * pair) // n_blocks
            middle = height * (2 * pair + 1) // n_blocks
            bottom = height * (2 * pair + 2) // n_blocks
            merge_blocks(source, target, top, middle, bottom, height, height + width)
        n_blocks //= 2
        n_done += 1
    return n_done % 2


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def merge_blocks(
    source: NDArray[np.int16], target: NDArray[np.int16], top: int, middle: int, bottom: int, begin: int, end: int
) -> None:
    """Merge the sums over two neighbouring blocks of rows: one line through both is the sum of a line through each.

    `source` holds rows of `end` sums each, as (n,); the blocks are its rows from `top` and from `middle` on, the merged
    one goes into the same rows of `target`. Column `begin` is that of the image's first.
    """
    n_upper, n_lower = middle - top, bottom - middle
    if n_upper == 0 or n_lower == 0:
        copy(source, target, np.uint64(top * end), np.uint64(top * end), np.uint64((bottom - top) * end))
        return
    for lean in range(n_upper + n_lower):
        share = lean / (n_upper + n_lower - 1)
        upper_lean = int(share * (n_upper - 1) + 0.5)
        lower_lean = int(share * (n_lower - 1) + 0.5)
        shift = lean - lower_lean
        # Left of `low` only the lower block has been entered, right of `high` the lower one is left already.
        left, low, high = begin - lean, begin - upper_lean, end - shift
        above, below, merged = (top + upper_lean) * end, (middle + lower_lean) * end, (top + lean) * end
        copy(source, target, np.uint64(below + left + shift), np.uint64(merged + left), np.uint64(low - left))
        add(
            source, target, np.uint64(above + low), np.uint64(below + low + shift), np.uint64(merged + low),
            np.uint64(high - low),
        )  # fmt: skip
        copy(source, target, np.uint64(above + high), np.uint64(merged + high), np.uint64(end - high))


# The two below stand on their own, with unsigned places instead of slices, so that the compiler sees loops that it can
# vectorise: counting references to slices takes three times as long as all the additions.


@njit(cache=True, nogil=True, inline="never")  # type: ignore[untyped-decorator]
def add(source: NDArray[np.int16], target: NDArray[np.int16], one: int, other: int, to: int, n: int) -> None:
    """Write the sum of `n` numbers of `source` from `one` and from `other` on into `target` from `to` on."""
    for i in range(n):
        target[to + i] = np.int16(source[one + i] + source[other + i])


@njit(cache=True, nogil=True, inline="never")  # type: ignore[untyped-decorator]
def copy(source: NDArray[np.int16], target: NDArray[np.int16], one: int, to: int, n: int) -> None:
    """Write `n` numbers of `source` from `one` on into `target` from `to` on."""
    for i in range(n):
        target[to + i] = source[one + i]
