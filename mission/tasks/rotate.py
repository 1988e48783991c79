"""Rotate: turn on the spot by an angle."""

import math
from dataclasses import replace

from mission.autopilot import Setpoint
from mission.guidance import GuidanceSettings, wrap_angle_rad
from mission.tasks.task import Observation, Step

_REACHED_RAD = math.radians(3.0)


class RotateTask:
    """Turns the setpoint's yaw at the yaw rate, the way the sign says; done when the vehicle has followed."""

    needs_line = False
    needs_vision = False

    def __init__(self, angle_rad: float, guidance: GuidanceSettings) -> None:
        self._left_rad = angle_rad
        self.progress = 0.0
        self._guidance = guidance

    def step(self, reference: Setpoint, seen: Observation) -> Step:
        """Turn the reference by what is left, at most by the rate."""
        limit_rad = self._guidance.yaw_rate_rad_s * seen.dt_s
        turn_rad = max(-limit_rad, min(limit_rad, self._left_rad))
        self._left_rad -= turn_rad
        self.progress += turn_rad
        setpoint = replace(reference, yaw_rad=wrap_angle_rad(reference.yaw_rad + turn_rad))
        error_rad = abs(wrap_angle_rad(setpoint.yaw_rad - seen.state.yaw_rad))
        if self._left_rad == 0.0 and error_rad <= _REACHED_RAD:
            return Step(setpoint, done=f"turned to {math.degrees(setpoint.yaw_rad) % 360:.0f} degrees")
        return Step(setpoint)
