"""How far a task has brought the setpoint."""

import math

from mission.autopilot import Setpoint

NEARLY_M = 1e-6
"""Less than this is arithmetic, not distance."""


class Odometer:
    """Adds up the way of the reference along a heading.

    It looks at what became of the setpoint, not at what was asked for: the leash may have held it back.
    """

    def __init__(self) -> None:
        self.moved_m = 0.0
        self._last: Setpoint | None = None

    def update(self, reference: Setpoint, heading_rad: float) -> float:
        """Take the reference of this tick; returns the way so far along the headings given [m]."""
        if self._last is not None:
            north_m, east_m = reference.north_m - self._last.north_m, reference.east_m - self._last.east_m
            self.moved_m += north_m * math.cos(heading_rad) + east_m * math.sin(heading_rad)
        self._last = reference
        return self.moved_m
