"""Where a line's supports stand on the map, and which way the line runs there."""

import itertools
import math
from dataclasses import dataclass

from sitl.world.errors import WrongKey
from sitl.world.line_models import LineModel, RouteModel
from sitl.world.records import PointNe, PointNed

_SHARPEST_TURN_RAD = math.radians(120.0)


@dataclass(frozen=True, slots=True)
class Stand:
    """A support's place [m]; the line's direction, which at an angle is the bisector; and the turn there [rad].

    `up_m` is the ground's height at its foot.
    """

    place_ne_m: PointNe
    heading_rad: float
    turn_rad: float
    up_m: float = 0.0

    def at(self, ahead_m: float, right_m: float, height_m: float) -> PointNed:
        """NED [m] of a point given along the line, to its right, and above the support's foot."""
        cos, sin = math.cos(self.heading_rad), math.sin(self.heading_rad)
        return (
            self.place_ne_m[0] + ahead_m * cos - right_m * sin,
            self.place_ne_m[1] + ahead_m * sin + right_m * cos,
            -(self.up_m + height_m),
        )


def stands(line: LineModel, key: str, start_yaw_rad: float) -> tuple[Stand, ...]:
    """Where the supports of a line stand, on level ground. `key` is the line's in the file, for the error.

    Raises WrongKey for points that fall together or turn too sharply.
    """
    if line.route is not None:
        places = _along(line.route, start_yaw_rad)
    else:
        places = [(float(north_m), float(east_m)) for north_m, east_m in line.points_ne_m or ()]
    headings = []
    for i, (here, there) in enumerate(itertools.pairwise(places), start=1):
        if math.dist(here, there) < 1.0:
            raise WrongKey(f"{key}.points_ne_m.{i}", "the support stands less than 1 m from the one before")
        headings.append(math.atan2(there[1] - here[1], there[0] - here[0]))
    turns = [0.0, *(_wrap(after - before) for before, after in itertools.pairwise(headings)), 0.0]
    for i, turn_rad in enumerate(turns):
        if abs(turn_rad) > _SHARPEST_TURN_RAD:
            raise WrongKey(
                f"{key}.points_ne_m.{i}",
                f"the line turns by {abs(math.degrees(turn_rad)):.0f} degrees there; end it and begin another one",
            )
    return tuple(
        Stand(place, _wrap(heading + turn / 2.0), turn)
        for place, heading, turn in zip(places, [headings[0], *headings], turns, strict=True)
    )


def _along(route: RouteModel, start_yaw_rad: float) -> list[PointNe]:
    """The supports of a route, one after the other."""
    turns = [math.radians(turn) for turn in route.turns_deg] or [0.0] * (len(route.spans_m) - 1)
    meets = route.meets_start
    if meets is None:
        return _walk(route.first_ne_m or (0.0, 0.0), math.radians(route.heading_deg or 0.0), route.spans_m, turns)
    heading_rad = start_yaw_rad + math.pi / 2.0
    ahead = (meets.distance_m * math.cos(start_yaw_rad), meets.distance_m * math.sin(start_yaw_rad))
    k = meets.span - 1
    before = _step(ahead, heading_rad, -meets.after_m)
    after = _walk(before, heading_rad, route.spans_m[k:], turns[k:])
    back = _walk(
        before, heading_rad + math.pi - (turns[k - 1] if k else 0.0), route.spans_m[:k][::-1],
        [-turn for turn in turns[: max(0, k - 1)][::-1]],
    )  # fmt: skip
    return [*back[:0:-1], *after]


def _walk(place: PointNe, heading_rad: float, spans_m: list[float], turns: list[float]) -> list[PointNe]:
    places = [place]
    for span_m, turn_rad in itertools.zip_longest(spans_m, turns, fillvalue=0.0):
        places.append(_step(places[-1], heading_rad, span_m))
        heading_rad += turn_rad
    return places


def _step(place: PointNe, heading_rad: float, step_m: float) -> PointNe:
    return place[0] + step_m * math.cos(heading_rad), place[1] + step_m * math.sin(heading_rad)


def _wrap(angle_rad: float) -> float:
    return math.remainder(angle_rad, 2.0 * math.pi)
