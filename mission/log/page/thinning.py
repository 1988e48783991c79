"""Fewer points for the eye: a curve of thousands of points drawn with some hundreds. Pure."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]


def evenly(n: int, most: int) -> Indices:
    """At most `most` of n indices, evenly spread, the first and the last among them."""
    if n <= most:
        return np.arange(n)
    return np.unique(np.round(np.linspace(0, n - 1, most)).astype(np.intp))


def extremes(values: Floats, most: int) -> Indices:
    """At most 1.5 times `most` indices of a rough signal (n,): of each stretch the lowest and the highest.

    NaN counts as nothing; of a stretch that has one the first is kept, too, so that a gap stays one.
    """
    n = len(values)
    if n <= most:
        return np.arange(n)
    edges = np.linspace(0, n, max(1, most // 2) + 1).astype(np.intp)
    kept: list[int] = []
    for first, last in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        part = values[first:last]
        if not part.size:
            continue
        gaps = np.flatnonzero(np.isnan(part))
        if gaps.size:
            kept.append(first + int(gaps[0]))
        if gaps.size < part.size:
            kept.extend((first + int(np.nanargmin(part)), first + int(np.nanargmax(part))))
    return np.unique(np.array(kept, dtype=np.intp))
