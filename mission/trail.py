"""The way that was flown, so that it can be flown back."""

import math
from collections import deque

from mission.autopilot import Setpoint, VehicleState

_SPACING_M = 1.0
_MAX_POINTS = 500


class Trail:
    """Places of the vehicle, a metre apart, the newest last; it remembers the last half kilometre."""

    def __init__(self) -> None:
        self._places: deque[Setpoint] = deque(maxlen=_MAX_POINTS)

    def add(self, state: VehicleState) -> None:
        """Keep where the vehicle is, if it has moved."""
        place = Setpoint(state.north_m, state.east_m, state.down_m, state.yaw_rad)
        if not self._places or _apart_m(self._places[-1], place) >= _SPACING_M:
            self._places.append(place)

    def back_to(self, goal: Setpoint, max_m: float) -> list[Setpoint]:
        """The way from the newest place back until one near `goal`, at most `max_m` of it, newest first."""
        way: list[Setpoint] = []
        length_m = 0.0
        for place in reversed(self._places):
            length_m += _apart_m(way[-1], place) if way else 0.0
            if length_m > max_m:
                break
            way.append(place)
            if _apart_m(place, goal) <= _SPACING_M:
                break
        return way


def _apart_m(a: Setpoint, b: Setpoint) -> float:
    return math.hypot(a.north_m - b.north_m, a.east_m - b.east_m)
