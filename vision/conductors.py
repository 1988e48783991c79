"""Conductors among straight edges: which two edges bound one, and what a person would look at to tell.

A conductor crosses the whole frame, it is thin, and it is the same all along while the ground below it changes: its two
edges face each other, where a kerb or the border of a field shows one. A thick one is round, and shows further edges
inside, where its bright middle begins and ends.
"""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vision.edge_lines import EdgeLines
from vision.linking import segment_lengths_px
from vision.profile import measure_profile
from vision.records import wrap_line_angle_rad

_MIN_OVERLAP = 0.5  # share of the shorter edge that two edges of one conductor run side by side
_RIM_STEP = 0.35  # share of the inner edges' step; what a camera's sharpening adds beside an edge is less
_MIN_NEIGHBOUR_CONTRAST = 0.7  # share of the contrast between two conductors that they have themselves
_RIM_COHERENCE = 0.6  # share of the inner edges' coherence that a thick conductor's outer edges show at least


Line = tuple[float, float, float, float]
"""x1, y1, x2, y2 [px]."""


@dataclass(frozen=True, slots=True)
class Conductor:
    """A straight thin thing that may be a conductor.

    `axis` is x1, y1, x2, y2 [px]; `width_px` is the distance of its two edges; `reach` is the share of the frame's
    chord along the axis that its edges cover, 0 to 1; `length_px` is how far apart its outermost ends lie; `coherence`
    is that of its edges (EdgeLines), `contrast` [grey levels] how far its body stands out from the ground on both
    sides; `edges` are its left and its right edge, directed as in EdgeLines. `has_gap` says that columns of its
    body look like the ground (vision.profile); `members` index the edges that it was made of.
    """

    axis: Line
    edges: tuple[Line, Line]
    width_px: float
    reach: float
    length_px: float
    coherence: float
    contrast: float
    has_gap: bool
    members: tuple[int, int]

    @property
    def angle_rad(self) -> float:
        """The axis' line angle [rad]."""
        x1, y1, x2, y2 = self.axis
        return wrap_line_angle_rad(math.atan2(x2 - x1, -(y2 - y1)))

    @property
    def support(self) -> float:
        """The share of the frame's chord that is surely a conductor, 0 to 1."""
        return self.coherence * self.reach


def frame_chord_px(axis: Line, shape: tuple[int, int]) -> float:
    """Length [px] of the part of the axis' infinite line inside a frame of `shape` (height, width)."""
    x1, y1, x2, y2 = axis
    length = math.hypot(x2 - x1, y2 - y1)
    dx, dy = (x2 - x1) / length, (y2 - y1) / length
    low, high = -math.inf, math.inf
    for start, step, size in ((x1, dx, shape[1]), (y1, dy, shape[0])):
        if abs(step) < 1e-9:
            continue
        ends = sorted(((-0.5 - start) / step, (size - 0.5 - start) / step))
        low, high = max(low, ends[0]), min(high, ends[1])
    return max(high - low, length)


@dataclass(frozen=True, slots=True, eq=False)  # arrays have no single answer to ==
class _Pairs:
    """Two edges each that may bound one conductor: all arrays (n,). `step` [grey levels] is the lower of the two."""

    first: NDArray[np.int64]
    second: NDArray[np.int64]
    coherence: NDArray[np.float64]
    step: NDArray[np.float64]
    quality: NDArray[np.float64]


def find_conductors(
    edges: EdgeLines, grey: NDArray[np.uint8], max_width_px: float, max_turn_rad: float, min_coherence: float
) -> list[Conductor]:
    """Pair the edges of each conductor, the surest first; an edge belongs to one conductor at most.

    Two edges pair when they run in opposite directions within `max_turn_rad`, overlap by half of the shorter one, lie
    at most `max_width_px` apart, and have the coherence `min_coherence` in the geometric mean. Two edges more that
    enclose a pair make it wider when all between them is one body, else they make it two conductors side by side.
    `grey` is the (h, w) uint8 image that the edges were found in.
    """
    pairs = _opposite_pairs(edges, max_width_px, max_turn_rad, min_coherence)
    is_used = np.zeros(len(edges.segments), dtype=bool)
    conductors: list[Conductor] = []
    for k in np.argsort(-pairs.quality, kind="stable").tolist():
        if is_used[pairs.first[k]] or is_used[pairs.second[k]]:
            continue
        outer = _neighbours(k, pairs, is_used, edges)
        first, second = int(pairs.first[k]), int(pairs.second[k])
        found = [_conductor(first, second, edges, grey, max_width_px)]
        if outer is not None:
            found = _four_edges(found[0], (outer[0], first, second, outer[1]), edges, grey, max_width_px)
            is_used[[first, second]] = True
        # Around a conductor that is found already lie the edges that the camera's sharpening drew: no second one.
        axes = np.array([conductor.axis for conductor in conductors]).reshape(-1, 4)
        found = [conductor for conductor in found if not _is_around_any(conductor, axes)]
        for conductor in found:
            is_used |= _lies_within(edges.segments, conductor.axis, conductor.width_px / 2 + 1.0)
            is_used[list(conductor.members)] = True
        conductors += found
    return conductors


def _is_around_any(conductor: Conductor, axes: NDArray[np.float64]) -> bool:
    """Whether any of the axes (n, 4) runs inside the conductor."""
    return bool(_lies_within(axes, conductor.axis, conductor.width_px / 2).any())


def _four_edges(
    inner: Conductor, row: tuple[int, int, int, int], edges: EdgeLines, grey: NDArray[np.uint8], max_width_px: float
) -> list[Conductor]:
    """What four edges in a row are: a thick conductor with a bright middle, two side by side, or the inner one alone.

    The inner one is alone when its neighbours stand out much less: a camera's sharpening draws such edges.
    """
    left, first, second, right = row
    outer = _conductor(left, right, edges, grey, max_width_px)
    if outer.width_px <= max_width_px and not outer.has_gap:
        return [outer]
    beside = [_conductor(i, j, edges, grey, max_width_px, may_grow=False) for i, j in ((left, first), (second, right))]
    if min(conductor.contrast for conductor in beside) >= _MIN_NEIGHBOUR_CONTRAST * inner.contrast:
        return beside
    return [inner]


def _conductor(
    i: int, j: int, edges: EdgeLines, grey: NDArray[np.uint8], max_width_px: float, may_grow: bool = True
) -> Conductor:
    """The conductor that the edges `i` and `j` bound."""
    one, other = _as_line(edges.segments[i]), _as_line(edges.segments[j])
    axis = _middle(one, other)
    if _aside_px(one, axis) > 0:  # the left edge first
        i, j, one, other = j, i, other, one
    width_px = _aside_px(other, axis) - _aside_px(one, axis)
    profile = measure_profile(axis, width_px, max_width_px, grey)
    left_px, right_px = profile.grows_left_px, profile.grows_right_px
    if not may_grow or width_px + left_px + right_px > max_width_px:
        left_px, right_px = 0.0, 0.0
    covered_px = max(edges.covered_px[i], edges.covered_px[j])
    return Conductor(
        axis=_shifted(axis, axis, 0.5 * (right_px - left_px)),
        edges=(
            _shifted(one, axis, -left_px),
            _shifted(other, axis, right_px),
        ),
        width_px=width_px + left_px + right_px,
        reach=float(min(1.0, covered_px / frame_chord_px(axis, (grey.shape[0], grey.shape[1])))),
        length_px=math.hypot(axis[2] - axis[0], axis[3] - axis[1]),
        coherence=math.sqrt(edges.coherence[i] * edges.coherence[j]),
        contrast=profile.contrast,
        has_gap=profile.has_gap,
        members=(i, j),
    )


def _shifted(line: Line, axis: Line, right_px: float) -> Line:
    """The line, moved to the right of the axis' direction."""
    length = math.hypot(axis[2] - axis[0], axis[3] - axis[1])
    x, y = -right_px * (axis[3] - axis[1]) / length, right_px * (axis[2] - axis[0]) / length
    return line[0] + x, line[1] + y, line[2] + x, line[3] + y


def _opposite_pairs(edges: EdgeLines, max_width_px: float, max_turn_rad: float, min_coherence: float) -> _Pairs:
    """All pairs of edges that face each other."""
    segments = edges.segments
    lengths_px = segment_lengths_px(segments)
    along = (segments[:, 2:] - segments[:, :2]) / lengths_px[:, None]
    left, right = np.nonzero(np.triu(along @ along.T < -math.cos(max_turn_rad)))
    dx, dy = along[left].T
    from_x, from_y = (segments[right, :2] - segments[left, :2]).T
    to_x, to_y = (segments[right, 2:] - segments[left, :2]).T
    overlap_px = np.minimum(from_x * dx + from_y * dy, lengths_px[left]) - np.maximum(to_x * dx + to_y * dy, 0.0)
    # The distance in the middle of what both share.
    width_px = 0.5 * np.abs((from_x + to_x) * dy - (from_y + to_y) * dx)
    coherence = np.sqrt(edges.coherence[left] * edges.coherence[right])
    is_pair = (
        (coherence >= min_coherence)
        & (width_px <= max_width_px)
        & (overlap_px >= _MIN_OVERLAP * np.minimum(lengths_px[left], lengths_px[right]))
    )
    left, right, overlap_px, width_px = left[is_pair], right[is_pair], overlap_px[is_pair], width_px[is_pair]
    coherence = coherence[is_pair]
    step = np.maximum(0.0, np.minimum(edges.step[left], edges.step[right]))
    return _Pairs(
        left, right, coherence, step, coherence * overlap_px * np.sqrt(step) * (1 - width_px / (2 * max_width_px))
    )


def _neighbours(k: int, pairs: _Pairs, is_used: NDArray[np.bool_], edges: EdgeLines) -> tuple[int, int] | None:
    """The edges on both sides of pair `k` that pair with its edges as well as these do with each other, or None."""
    first, second = int(pairs.first[k]), int(pairs.second[k])
    axis = _middle(_as_line(edges.segments[first]), _as_line(edges.segments[second]))
    asides_px = end_asides_px(edges.segments, axis).mean(axis=1)
    is_candidate = (pairs.step >= _RIM_STEP * pairs.step[k]) & (pairs.coherence >= _RIM_COHERENCE * pairs.coherence[k])
    outer = []
    for inner in (first, second):
        is_mine = is_candidate & ((pairs.first == inner) | (pairs.second == inner))
        others = np.where(pairs.first == inner, pairs.second, pairs.first)
        is_outside = asides_px[others] * np.sign(asides_px[inner]) > abs(asides_px[inner]) + 0.5
        found = np.flatnonzero(is_mine & is_outside & ~is_used[others])
        if len(found) == 0:
            return None
        outer.append(int(others[found[np.argmax(pairs.quality[found])]]))
    return outer[0], outer[1]


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def end_asides_px(segments: NDArray[np.float64], axis: Line) -> NDArray[np.float64]:
    """How far (n, 2) [px] the first and the last point of (n, 4) segments lie right of the axis' infinite line."""
    x1, y1, x2, y2 = axis
    length = math.hypot(x2 - x1, y2 - y1)
    dx, dy = (x2 - x1) / length, (y2 - y1) / length
    asides_px = np.empty((segments.shape[0], 2))
    for i in range(segments.shape[0]):
        for end in range(2):
            x, y = segments[i, 2 * end] - x1, segments[i, 2 * end + 1] - y1
            asides_px[i, end] = y * dx - x * dy
    return asides_px


def _lies_within(segments: NDArray[np.float64], axis: Line, max_aside_px: float) -> NDArray[np.bool_]:
    """Which of (n, 4) segments have both ends within `max_aside_px` of the axis' infinite line."""
    is_within: NDArray[np.bool_] = np.abs(end_asides_px(segments, axis)).max(axis=1, initial=0.0) <= max_aside_px
    return is_within


def _as_line(segment: NDArray[np.float64]) -> Line:
    """A segment (4,) as plain numbers."""
    x1, y1, x2, y2 = segment.tolist()
    return x1, y1, x2, y2


def _middle(first: Line, second: Line) -> Line:
    """The middle line of two opposite edges, as long as both together reach, along the first."""
    first_px = math.hypot(first[2] - first[0], first[3] - first[1])
    second_px = math.hypot(second[2] - second[0], second[3] - second[1])
    dx = (first[2] - first[0]) / first_px - (second[2] - second[0]) / second_px
    dy = (first[3] - first[1]) / first_px - (second[3] - second[1]) / second_px
    length = math.hypot(dx, dy)
    dx, dy = dx / length, dy / length
    x = 0.25 * (first[0] + first[2] + second[0] + second[2])
    y = 0.25 * (first[1] + first[3] + second[1] + second[3])
    ends = (first[:2], first[2:], second[:2], second[2:])
    along = [(end[0] - x) * dx + (end[1] - y) * dy for end in ends]
    tail, head = min(along), max(along)
    return x + tail * dx, y + tail * dy, x + head * dx, y + head * dy


def _aside_px(line: Line, axis: Line) -> float:
    """How far the middle of a line lies right of the axis' infinite line."""
    dx, dy = axis[2] - axis[0], axis[3] - axis[1]
    mid_x, mid_y = 0.5 * (line[0] + line[2]) - axis[0], 0.5 * (line[1] + line[3]) - axis[1]
    return (mid_y * dx - mid_x * dy) / math.hypot(dx, dy)
