"""Hold on: a pause in a task, on the spot or a little higher, until what caused it is over."""

from dataclasses import replace

from mission.autopilot import Setpoint
from mission.guidance import GuidanceSettings
from mission.tasks.task import Observation, Step
from mission.tasks.walk import Walk


class HoldOnTask:
    """Keeps the setpoint, after a climb by `climb_m`. It never ends by itself: the executive ends it."""

    needs_line = False
    needs_vision = False
    progress = 0.0

    def __init__(self, climb_m: float, guidance: GuidanceSettings) -> None:
        self._climb_m = climb_m
        self._guidance = guidance
        self._walk: Walk | None = None

    def step(self, reference: Setpoint, seen: Observation) -> Step:
        """Climb, then stay."""
        if self._walk is None:
            self._walk = Walk([replace(reference, down_m=reference.down_m - self._climb_m)], self._guidance)
        return Step(self._walk.step(reference, seen))
