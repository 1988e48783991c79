"""Where a signal is beyond a limit. Pure."""

import numpy as np
from numpy.typing import NDArray

from drivers.clock import NS_PER_S

Times = NDArray[np.int64]
Flags = NDArray[np.bool_]

_MERGE_S = 1.5
"""Two excursions that are less far apart are one: it went away and came back."""


def spans(t_ns: Times, is_beyond: Flags, least_s: float) -> list[tuple[int, int]]:
    """First and last time [ns] of each stretch of samples that are beyond, which lasts at least `least_s`.

    `t_ns` (n,) rising, `is_beyond` (n,). Stretches less than 1.5 s apart count as one.
    """
    if not is_beyond.any():
        return []
    at = np.flatnonzero(is_beyond)
    ends = np.flatnonzero(np.diff(t_ns[at]) > _MERGE_S * NS_PER_S)
    firsts = [int(at[0]), *(int(at[k + 1]) for k in ends)]
    lasts = [*(int(at[k]) for k in ends), int(at[-1])]
    found = []
    for first, last in zip(firsts, lasts, strict=True):
        if _longest_s(t_ns[first : last + 1], is_beyond[first : last + 1]) >= least_s:
            found.append((int(t_ns[first]), int(t_ns[last])))
    return found


def _longest_s(t_ns: Times, is_beyond: Flags) -> float:
    """How long the longest stretch without a gap lasts [s]."""
    longest_ns, since_ns = 0, None
    for t, beyond in zip(t_ns.tolist(), is_beyond.tolist(), strict=True):
        if not beyond:
            since_ns = None
            continue
        since_ns = t if since_ns is None else since_ns
        longest_ns = max(longest_ns, t - since_ns)
    return longest_ns / NS_PER_S
