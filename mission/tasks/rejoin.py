"""Rejoin: on the way to where an interrupted mission is taken up again."""

from dataclasses import replace

from mission.autopilot import Setpoint
from mission.guidance import GuidanceSettings
from mission.tasks.task import Observation, Step
from mission.tasks.walk import Walk


class RejoinTask:
    """Goes there high: up first, then across, then down. What is right above and right below the ends must be free.

    It crosses at `transit_down_m` NED, or higher where it is higher already.
    """

    needs_line = False
    needs_vision = False
    progress = 0.0

    def __init__(self, goal: Setpoint, transit_down_m: float, guidance: GuidanceSettings) -> None:
        self._goal = goal
        self._transit_down_m = transit_down_m
        self._guidance = guidance
        self._walk: Walk | None = None

    def step(self, reference: Setpoint, seen: Observation) -> Step:
        """Walk; done at the goal."""
        if self._walk is None:
            goal = self._goal
            up = replace(reference, down_m=min(reference.down_m, self._transit_down_m))
            above = replace(goal, down_m=up.down_m, yaw_rad=up.yaw_rad)
            self._walk = Walk([up, above, goal], self._guidance)
        setpoint = self._walk.step(reference, seen)
        return Step(setpoint, done="back where the mission was interrupted" if self._walk.is_done else None)
