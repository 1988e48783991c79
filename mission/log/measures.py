"""How well a line was followed and setpoints were sent: pure arithmetic on positions and times."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from drivers.clock import NS_PER_S
from mission.records import TrueLine

Floats = NDArray[np.float64]


def line_fit_distances_m(positions_m: Floats) -> Floats:
    """Fit a straight line to positions by SVD and return the distance of each from it.

    `positions_m` is (n, 3) float64 [m]; returns (n,) [m]. [Ceron] 6.5.2, equations 6.3 and 6.4.
    """
    centred = positions_m - positions_m.mean(axis=0)
    direction = np.linalg.svd(centred, full_matrices=False)[2][0]
    along = centred @ direction
    return np.asarray(np.linalg.norm(centred - along[:, None] * direction, axis=1))


def nearest_on_axis(points_ne_m: Floats, axis_ne_m: Floats) -> tuple[Floats, Floats]:
    """Find the axis's nearest piece to each point, seen from above.

    `points_ne_m` is (n, 2) and `axis_ne_m` a polyline (m, 2) of north, east [m], m at least 2. Returns the distance
    (n,) [m], positive to the right of the axis's direction, and the nearest piece's direction (n,) [rad from north].
    """
    starts, steps = axis_ne_m[:-1], np.diff(axis_ne_m, axis=0)
    offsets = points_ne_m[:, None] - starts
    along = np.clip((offsets * steps).sum(-1) / (steps**2).sum(-1), 0.0, 1.0)
    misses = offsets - along[..., None] * steps
    distances = np.linalg.norm(misses, axis=-1)
    piece = distances.argmin(axis=1)
    each = np.arange(len(points_ne_m))
    side = np.sign(steps[piece, 0] * offsets[each, piece, 1] - steps[piece, 1] * offsets[each, piece, 0])
    return side * distances[each, piece], np.arctan2(steps[:, 1], steps[:, 0])[piece]


def offboard_gaps_s(
    times_ns: NDArray[np.int64], windows: list[tuple[int, int]], holes_ns: Sequence[tuple[int, int]] = ()
) -> Floats:
    """Measure the gaps [s] between consecutive setpoints, sent at `times_ns` (n,) int64, while offboard runs.

    Offboard runs through consecutive tasks, `windows` [ns] in the order flown, that each sent setpoints; a task that
    sent none was flown by the autopilot itself, and the pause it makes is no gap. What was sent in `holes_ns` is not
    known, and no gap either.
    """
    gaps_s = [np.empty(0)]
    phase: list[NDArray[np.int64]] = []
    for start_ns, end_ns in [*windows, (0, -1)]:  # the last is empty, and ends what still runs
        sent_ns = times_ns[(times_ns >= start_ns) & (times_ns < end_ns)]
        if sent_ns.size:
            phase.append(sent_ns)
        elif phase:
            gaps_s.append(_gaps_s(np.concatenate(phase), holes_ns))
            phase = []
    return np.concatenate(gaps_s)


def _gaps_s(sent_ns: NDArray[np.int64], holes_ns: Sequence[tuple[int, int]]) -> Floats:
    is_known = np.ones(len(sent_ns) - 1, dtype=np.bool_)
    for begin_ns, end_ns in holes_ns:
        is_known &= (sent_ns[1:] < begin_ns) | (sent_ns[:-1] > end_ns)
    return np.asarray(np.diff(sent_ns).astype(np.float64)[is_known] / NS_PER_S)


def true_axis(line: TrueLine) -> Floats:
    """Return the line's axis as an array (m, 2) of north, east [m]."""
    return np.array(line.axis_ne_m, dtype=np.float64).reshape(-1, 2)
