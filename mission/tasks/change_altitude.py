"""Ascend and descend: change the height on the spot."""

from mission.autopilot import Setpoint
from mission.guidance import GuidanceSettings, step_vertical
from mission.tasks.task import FlightMemory, Observation, Step, is_there


class ChangeAltitudeTask:
    """Moves the setpoint's height at the climb or descent speed; done when the vehicle has arrived."""

    needs_line = False
    needs_vision = False
    progress = 0.0

    def __init__(self, altitude_m: float, guidance: GuidanceSettings, memory: FlightMemory) -> None:
        self._down_m = memory.start.down_m - altitude_m
        self._guidance = guidance
        self._memory = memory

    def step(self, reference: Setpoint, seen: Observation) -> Step:
        """Move the height of the reference."""
        is_climb = self._down_m < reference.down_m
        speed_m_s = self._guidance.climb_m_s if is_climb else self._guidance.descend_m_s
        setpoint = step_vertical(reference, self._down_m, speed_m_s, seen.dt_s)
        if setpoint.down_m == self._down_m and is_there(seen.state, setpoint, self._guidance.arrival_m):
            if not self._memory.known_line.is_begun:
                self._memory.known_line.forget()  # what was seen from other heights tells little, and may mislead
            return Step(setpoint, done="reached the height")
        return Step(setpoint)
