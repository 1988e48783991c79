"""Conductors among parallel segments: what stands for one conductor, and how sure that is.

A conductor crosses the whole frame, and it is thin: it shows two edges of opposite polarity close to each other, where
a kerb or the border of a field shows one.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vision.linking import segment_lengths_px
from vision.orientation import segment_angles_rad
from vision.records import Segments

_ASIDE_PX = 2.0  # how far from a conductor's edge a piece of it may lie
_BEND_OVERLAP = 0.05  # share of the diagonal by which two pieces of one bent conductor may overlap
_MIN_SECOND_EDGE = 0.25  # share of a conductor's length where the weaker of its edges is seen


@dataclass(frozen=True, slots=True)
class Conductor:
    """A straight thing that may be a conductor.

    `axis` is x1, y1, x2, y2 [px]; `width_px` is the distance of its two edges, None where only one was found; `reach`
    is the share of the frame's chord along the axis that its edges cover, 0 to 1; `length_px` is how far apart its
    outermost ends lie; `members` index the segments.
    """

    axis: tuple[float, float, float, float]
    width_px: float | None
    reach: float
    length_px: float
    members: tuple[int, ...]

    @property
    def angle_rad(self) -> float:
        """The axis' line angle [rad]."""
        return float(segment_angles_rad(np.array([self.axis]))[0])


def frame_chord_px(axis: tuple[float, float, float, float], shape: tuple[int, int]) -> float:
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


def offset_px(conductor: Conductor, angle_rad: float, shape: tuple[int, int]) -> float:
    """Where the conductor passes the image centre [px], abreast of it seen along `angle_rad` (LineEstimate.offset_px).

    `shape` is the frame's (height, width).
    """
    x1, y1, x2, y2 = conductor.axis
    along_x, along_y = math.sin(angle_rad), -math.cos(angle_rad)
    from_x, from_y = x1 - (shape[1] - 1) / 2, y1 - (shape[0] - 1) / 2
    advance = (x2 - x1) * along_x + (y2 - y1) * along_y
    step = -(from_x * along_x + from_y * along_y) / advance
    abreast_x, abreast_y = from_x + step * (x2 - x1), from_y + step * (y2 - y1)
    return -abreast_x * along_y + abreast_y * along_x


def middle_offset_px(conductors: list[Conductor], angle_rad: float, shape: tuple[int, int]) -> float:
    """Offset [px] of the line halfway between the two outermost of `conductors`, at least one."""
    offsets_px = [offset_px(conductor, angle_rad, shape) for conductor in conductors]
    return 0.5 * (min(offsets_px) + max(offsets_px))


def n_abreast(conductors: list[Conductor], angle_rad: float, shape: tuple[int, int]) -> int:
    """The most conductors that a cut across the group meets, seen along `angle_rad`; `shape` is (height, width).

    Two pieces one behind the other are one conductor, bent where a pole holds it; and what lies between another one's
    edges, its bright middle, does not count.
    """
    distinct: list[tuple[float, float]] = []
    spans: list[tuple[float, float]] = []
    for conductor in sorted(conductors, key=lambda c: -(c.width_px or 0.0)):
        place_px = offset_px(conductor, angle_rad, shape)
        if any(abs(place_px - other_px) <= width_px / 2 for other_px, width_px in distinct):
            continue
        distinct.append((place_px, conductor.width_px or 0.0))
        x1, y1, x2, y2 = conductor.axis
        ends = (x * math.sin(angle_rad) - y * math.cos(angle_rad) for x, y in ((x1, y1), (x2, y2)))
        low, high = sorted(ends)
        spans.append((low, high))
    # The fullest cut is among those just behind a span's start.
    slack_px = _BEND_OVERLAP * math.hypot(*shape)
    return max((sum(low <= start + slack_px <= high for low, high in spans) for start, _ in spans), default=0)


def find_conductors(
    lines: Segments,
    covered_px: NDArray[np.float64],
    shape: tuple[int, int],
    max_width_px: float,
    max_turn_rad: float,
) -> list[Conductor]:
    """Pair the two edges of each conductor; an edge left over is a conductor of unknown width.

    `lines` is (n, 4) [px], longest first, directed with the brighter side on the right; `covered_px` (n,) [px] says how
    much of each is supported by edges; `shape` is the frame's (height, width). Two edges pair when they run in opposite
    directions within `max_turn_rad`, overlap by half of the shorter one and lie at most `max_width_px` apart. A pair
    takes in what continues one of its edges, of either direction: a grey conductor is bright over dark ground and dark
    over bright ground.
    """
    if len(lines) == 0:
        return []
    lengths_px = segment_lengths_px(lines)
    directions = (lines[:, 2:] - lines[:, :2]) / lengths_px[:, None]
    is_used = np.zeros(len(lines), dtype=bool)
    pairs = []
    for i in range(len(lines)):
        if is_used[i]:
            continue
        partner, width_px = _nearest_opposite(i, lines, lengths_px, directions, is_used, max_width_px, max_turn_rad)
        if partner is not None:
            is_used[[i, partner]] = True
            pairs.append((i, partner, width_px))
    conductors = []
    for i, partner, width_px in pairs:
        axis = _middle(lines[i], lines[partner], directions[i], directions[partner])
        pieces = [i, partner, *_pieces_along(axis, width_px / 2 + _ASIDE_PX, lines, is_used)]
        is_used[pieces] = True
        conductors.append(_as_conductor(axis, width_px, pieces, lines, covered_px / lengths_px, shape))
    for i in np.flatnonzero(~is_used).tolist():
        x1, y1, x2, y2 = lines[i].tolist()
        conductors.append(_as_conductor((x1, y1, x2, y2), None, [i], lines, covered_px / lengths_px, shape))
    return conductors


def _pieces_along(
    axis: tuple[float, float, float, float], max_aside_px: float, lines: Segments, is_used: NDArray[np.bool_]
) -> list[int]:
    """The free lines with both ends within `max_aside_px` of the axis' infinite line."""
    x1, y1, x2, y2 = axis
    length = math.hypot(x2 - x1, y2 - y1)
    dx, dy = (x2 - x1) / length, (y2 - y1) / length
    from_aside = np.abs((lines[:, 0] - x1) * dy - (lines[:, 1] - y1) * dx)
    to_aside = np.abs((lines[:, 2] - x1) * dy - (lines[:, 3] - y1) * dx)
    is_along: NDArray[np.bool_] = ~is_used & (np.maximum(from_aside, to_aside) <= max_aside_px)
    return [int(i) for i in np.flatnonzero(is_along)]


def _as_conductor(
    axis: tuple[float, float, float, float],
    width_px: float | None,
    pieces: list[int],
    lines: Segments,
    fill: NDArray[np.float64],
    shape: tuple[int, int],
) -> Conductor:
    """A conductor from its edges' pieces: its reach is the union of their intervals, as far as they are filled.

    A long edge beside which only some texture runs the other way is no conductor: its width is unknown, too.
    """
    x1, y1, x2, y2 = axis
    length_px = math.hypot(x2 - x1, y2 - y1)
    dx, dy = (x2 - x1) / length_px, (y2 - y1) / length_px
    start = (lines[pieces, 0] - x1) * dx + (lines[pieces, 1] - y1) * dy
    end = (lines[pieces, 2] - x1) * dx + (lines[pieces, 3] - y1) * dy
    low, high = np.minimum(start, end), np.maximum(start, end)
    is_forward = end > start
    both_px = _union_px(low, high, fill[pieces])
    side_px = min(
        _union_px(low[is_side], high[is_side], fill[pieces][is_side]) for is_side in (is_forward, ~is_forward)
    )
    return Conductor(
        axis=axis,
        width_px=width_px if side_px >= _MIN_SECOND_EDGE * both_px else None,
        reach=min(1.0, both_px / frame_chord_px(axis, shape)),
        length_px=float(high.max() - low.min()),
        members=tuple(pieces),
    )


def _union_px(low: NDArray[np.float64], high: NDArray[np.float64], fill: NDArray[np.float64]) -> float:
    """Length [px] of the union of intervals from `low` to `high` (n,) [px], each counted as far as it is filled."""
    total_px, reached = 0.0, -math.inf
    for i in np.argsort(low):
        total_px += max(0.0, float(high[i]) - max(float(low[i]), reached)) * float(fill[i])
        reached = max(reached, float(high[i]))
    return total_px


def _nearest_opposite(
    i: int,
    lines: Segments,
    lengths_px: NDArray[np.float64],
    directions: NDArray[np.float64],
    is_used: NDArray[np.bool_],
    max_width_px: float,
    max_turn_rad: float,
) -> tuple[int | None, float]:
    """The free line that is the other edge of line `i`, and its distance [px]; None, and any number, without one."""
    dx, dy = directions[i]
    from_x, from_y = lines[:, 0] - lines[i, 0], lines[:, 1] - lines[i, 1]
    to_x, to_y = lines[:, 2] - lines[i, 0], lines[:, 3] - lines[i, 1]
    start, end = to_x * dx + to_y * dy, from_x * dx + from_y * dy  # an opposite line ends where it starts
    overlap = np.minimum(end, lengths_px[i]) - np.maximum(start, 0.0)
    aside = 0.5 * np.abs((from_x + to_x) * dy - (from_y + to_y) * dx)
    is_other = (
        ~is_used
        & (directions @ directions[i] < -math.cos(max_turn_rad))
        & (overlap >= 0.5 * np.minimum(lengths_px, lengths_px[i]))
        & (aside <= max_width_px)
    )
    if not is_other.any():
        return None, math.inf
    j = int(np.argmin(np.where(is_other, aside, np.inf)))
    return j, float(aside[j])


def _middle(
    first: NDArray[np.float64],
    second: NDArray[np.float64],
    first_direction: NDArray[np.float64],
    second_direction: NDArray[np.float64],
) -> tuple[float, float, float, float]:
    """The middle line of two opposite edges, as long as both together reach."""
    direction = first_direction - second_direction
    direction /= math.hypot(direction[0], direction[1])
    points = np.array([first[:2], first[2:], second[:2], second[2:]])
    middle = points.mean(axis=0)
    along = (points - middle) @ direction
    tail, head = middle + along.min() * direction, middle + along.max() * direction
    return float(tail[0]), float(tail[1]), float(head[0]), float(head[1])
