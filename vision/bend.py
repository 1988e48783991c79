"""A bend in view: two spans of one line that meet at an angle support, each with a part of the frame.

Neither of them crosses the frame, so that neither would count for a line by itself; and a vehicle that sees only the
span below it learns of the next one when it has flown past the bend.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from vision.conductors import Conductor
from vision.line_group import choose_group, middle_offset_px
from vision.orientation import line_angle_distance_rad, mean_line_angle_rad

MIN_TURN_RAD = math.radians(8.0)
MAX_TURN_RAD = math.radians(70.0)  # angle supports turn by 60 degrees and little more
_MIN_SHARE = 0.15  # of its chord that a span has in the frame, for there to be something to judge
_OVERLAP = 0.04  # share of the diagonal by which a conductor may go on beyond the bend
_MOST_OVERLAP = 3.0  # times that, for the middle one
_MOST_DIRECTIONS = 3  # that are tried for the other span: a pole's shadow may be clearer
_LOOSE = 0.5  # of the support that a line across the frame must have: one that ends is often taken for longer


@dataclass(frozen=True, slots=True)
class Span:
    """The conductors of one span, their angle [rad], and the middle between the outermost (LineEstimate.offset_px).

    The conductors' `reach` is the share of what the frame can show of the span.
    """

    conductors: list[Conductor]
    angle_rad: float
    offset_px: float


@dataclass(frozen=True, slots=True)
class Bend:
    """Two spans that meet. `here` is the one abreast of the image centre."""

    here: Span
    beyond: Span


def find_bend(
    conductors: list[Conductor],
    shape: tuple[int, int],
    tolerance_rad: float,
    min_support: float,
    min_contrast: float,
) -> Bend | None:
    """Find two spans that meet among `conductors`; None where there are none.

    `shape` is the frame's (height, width), the last three are as for line_group.choose_group. As many conductors, but
    for one, have to be in both, and they have to end where the bend is: lines that cross go on.
    """
    group, _ = choose_group(conductors, tolerance_rad, _LOOSE * min_support, min_contrast)
    if not group:
        return None
    one = _span(group, shape)
    rest = _apart_from(conductors, one.angle_rad)
    for _ in range(_MOST_DIRECTIONS):
        others, _ = choose_group(rest, tolerance_rad, _LOOSE * min_support, min_contrast)
        if not others:
            return None
        other = _span(others, shape)
        if _may_go_on(others, group, min_contrast):
            found = _meeting_spans(one, other, shape)
            if found is not None:
                return found
        rest = _apart_from(rest, other.angle_rad)
    return None


def _apart_from(conductors: list[Conductor], angle_rad: float) -> list[Conductor]:
    """Those that run in another direction."""
    is_other = line_angle_distance_rad(np.array([c.angle_rad for c in conductors]), angle_rad) >= MIN_TURN_RAD
    return [conductor for conductor, keeps in zip(conductors, is_other, strict=True) if keeps]


def _may_go_on(others: list[Conductor], group: list[Conductor], min_contrast: float) -> bool:
    """Whether a group may be of the same conductors: as many, but for one, but not one alone; as clear."""
    is_as_many = abs(len(others) - len(group)) <= 1 and len(others) >= min(2, len(group))
    return is_as_many and max(c.contrast for c in others) >= min_contrast * max(c.contrast for c in group)


def _meeting_spans(one: Span, other: Span, shape: tuple[int, int]) -> Bend | None:
    """The bend of two spans, where they meet in the frame and end there."""
    meeting = _meet(one, other, shape)
    if meeting is None:
        return None
    ways = (_way_out(one, meeting), _way_out(other, meeting))
    turn_cosine = -(ways[0][0] * ways[1][0] + ways[0][1] * ways[1][1])
    if not math.cos(MAX_TURN_RAD) <= turn_cosine <= math.cos(MIN_TURN_RAD):
        return None
    slack_px = _OVERLAP * math.hypot(*shape)
    if not all(_ends_there(s, way, o, meeting, slack_px) for s, way, o in ((one, *ways), (other, *ways[::-1]))):
        return None
    spans = []
    for span, way in ((one, ways[0]), (other, ways[1])):
        share = _visible_share(meeting, way, shape)
        if share < _MIN_SHARE:
            return None
        fuller = [replace(c, reach=min(1.0, c.reach / share)) for c in span.conductors]
        spans.append(replace(span, conductors=fuller))
    # The image centre lies on that side of the line halfway between both spans.
    centre = ((shape[1] - 1) / 2 - meeting[0], (shape[0] - 1) / 2 - meeting[1])
    is_first = _dot(centre, ways[0]) >= _dot(centre, ways[1])
    return Bend(spans[0], spans[1]) if is_first else Bend(spans[1], spans[0])


def _span(conductors: list[Conductor], shape: tuple[int, int]) -> Span:
    angle_rad = mean_line_angle_rad(
        np.array([c.angle_rad for c in conductors]), np.array([c.length_px**2 for c in conductors])
    )
    return Span(conductors, angle_rad, middle_offset_px(conductors, angle_rad, shape))


def _meet(one: Span, other: Span, shape: tuple[int, int]) -> tuple[float, float] | None:
    """Where both middle lines cross [px]; None outside the frame."""
    a = np.array([[math.cos(s.angle_rad), math.sin(s.angle_rad)] for s in (one, other)])
    x, y = np.linalg.solve(a, np.array([one.offset_px, other.offset_px])).tolist()
    x, y = x + (shape[1] - 1) / 2, y + (shape[0] - 1) / 2
    return (x, y) if -0.5 <= x <= shape[1] - 0.5 and -0.5 <= y <= shape[0] - 0.5 else None


def _way_out(span: Span, meeting: tuple[float, float]) -> tuple[float, float]:
    """The direction in which the span leaves the bend."""
    along = (math.sin(span.angle_rad), -math.cos(span.angle_rad))
    middle = np.mean([c.axis for c in span.conductors], axis=0).reshape(2, 2).mean(axis=0)
    side = math.copysign(1.0, _dot((middle[0] - meeting[0], middle[1] - meeting[1]), along))
    return along[0] * side, along[1] * side


def _ends_there(
    span: Span,
    way: tuple[float, float],
    other_way: tuple[float, float],
    meeting: tuple[float, float],
    slack_px: float,
) -> bool:
    """Whether the span's conductors keep to their side of the line that halves the bend, where each of them bends.

    One must, and most of them nearly: edges may go on for a while along something else that the frame shows there.
    """
    across = (way[0] - other_way[0], way[1] - other_way[1])
    norm = math.hypot(*across)
    beyond_px = []
    for x1, y1, x2, y2 in (conductor.axis for conductor in span.conductors):
        sides = [_dot((x - meeting[0], y - meeting[1]), across) / norm for x, y in ((x1, y1), (x2, y2))]
        beyond_px.append(-min(sides))
    return min(beyond_px) <= slack_px and float(np.median(beyond_px)) <= _MOST_OVERLAP * slack_px


def _visible_share(meeting: tuple[float, float], way: tuple[float, float], shape: tuple[int, int]) -> float:
    """The share of the frame's chord through the bend that lies on the span's side."""
    ahead_px, behind_px = _to_border_px(meeting, way, shape), _to_border_px(meeting, (-way[0], -way[1]), shape)
    return ahead_px / max(ahead_px + behind_px, 1e-9)


def _to_border_px(start: tuple[float, float], way: tuple[float, float], shape: tuple[int, int]) -> float:
    """How far it is from a point in the frame to its border."""
    reaches = []
    for place, step, size in ((start[0], way[0], shape[1]), (start[1], way[1], shape[0])):
        if abs(step) > 1e-9:
            reaches.append(((size - 0.5 if step > 0 else -0.5) - place) / step)
    return max(0.0, min(reaches))


def _dot(a: tuple[float, float], b: tuple[float, float]) -> float:
    return a[0] * b[0] + a[1] * b[1]
