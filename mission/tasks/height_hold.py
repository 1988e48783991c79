"""Holding a height over the conductors, where their spacing tells how high the vehicle is above them."""

import statistics
from collections import deque

from mission.autopilot import Setpoint
from mission.guidance import GuidanceSettings, step_vertical
from mission.tasks.task import Observation

_N_HEIGHTS = 15  # sights whose median is believed
_FORGET_S = 2.0  # without new ones
_CLIMB_M_S = 0.7


class HeightHold:
    """Follows the conductors' height, as it was seen lately; never sinks below where it began.

    It keeps the height of the line itself, not the vehicle's over it: what is wrong with that does not add up while the
    vehicle moves. With nothing new seen, the setpoint stays at its height.
    """

    def __init__(self, guidance: GuidanceSettings) -> None:
        self._wanted_m = guidance.height_over_line_m
        self._line_downs_m: deque[float] = deque(maxlen=_N_HEIGHTS)
        self._unseen_s = 0.0
        self._lowest_down_m: float | None = None

    def step(self, setpoint: Setpoint, seen: Observation) -> Setpoint:
        """The setpoint, at the height where it should be, or on its way there."""
        if self._lowest_down_m is None:
            self._lowest_down_m = setpoint.down_m
        self._unseen_s += seen.dt_s
        found = None if seen.sight is None else seen.sight.found
        if seen.sight is not None and found is not None and found.height_m is not None:
            self._line_downs_m.append(seen.sight.down_m + found.height_m)
            self._unseen_s = 0.0
        if self._unseen_s > _FORGET_S:
            self._line_downs_m.clear()
        if len(self._line_downs_m) < _N_HEIGHTS:
            return setpoint
        down_m = min(statistics.median(self._line_downs_m) - self._wanted_m, self._lowest_down_m)
        return step_vertical(setpoint, down_m, _CLIMB_M_S, seen.dt_s)
