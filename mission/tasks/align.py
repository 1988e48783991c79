"""Align with the line: [Ceron] Algorithm 6.2."""

import math
from dataclasses import replace
from typing import Literal

from mission.autopilot import Setpoint
from mission.guidance import (
    GuidanceSettings,
    WorldLine,
    nearest_heading_rad,
    step_sideways,
    turn_towards_rad,
    wrap_angle_rad,
)
from mission.tasks.task import FlightMemory, Observation, Step

_WRONG_WAY_RAD = math.radians(30.0)
"""A line this little off the wanted side is taken as ahead, not turned to the long way round."""


class AlignTask:
    """Turns by the image angle until |error| < epsilon in n frames in a row; the centred law also goes to the line."""

    needs_line = True
    needs_vision = True
    progress = 0.0

    def __init__(
        self,
        turn: Literal["nearest", "right", "left"],
        n_detections: int,
        guidance: GuidanceSettings,
        memory: FlightMemory,
    ) -> None:
        self._turn = turn
        self._n_detections = n_detections
        self._guidance = guidance
        self._memory = memory
        self._target_rad: float | None = None
        self._line: WorldLine | None = None
        self._n_in_a_row = 0

    def step(self, reference: Setpoint, seen: Observation) -> Step:
        """Turn the reference towards the line's heading."""
        self._look(seen)
        if self._target_rad is None:
            return Step(reference)
        guidance = self._guidance
        yaw_rad = turn_towards_rad(
            reference.yaw_rad, self._target_rad, guidance.P_per_s, guidance.yaw_rate_rad_s, seen.dt_s
        )
        setpoint = replace(reference, yaw_rad=yaw_rad)
        if guidance.is_centred and self._line is not None:
            setpoint = step_sideways(
                setpoint, self._line, self._target_rad, guidance.lateral_per_s, guidance.lateral_max_m_s, seen.dt_s
            )
        if self._n_in_a_row >= self._n_detections:
            return Step(setpoint, done=f"aligned at {math.degrees(self._target_rad) % 360:.0f} degrees")
        return Step(setpoint)

    def _look(self, seen: Observation) -> None:
        sight = seen.sight
        if sight is None or sight.found is None:
            return
        line = sight.found.line
        heading_rad = line.heading_rad
        if self._target_rad is None:
            self._target_rad = self._choose(heading_rad, sight.yaw_at_capture_rad)
        else:
            self._target_rad = nearest_heading_rad(heading_rad, self._target_rad)
        if sight.found.is_placed:
            self._line = line
            self._memory.known_line.begin()
        error_rad = wrap_angle_rad(self._target_rad - sight.yaw_at_capture_rad)
        self._n_in_a_row = self._n_in_a_row + 1 if abs(error_rad) < self._guidance.epsilon_rad else 0

    def _choose(self, heading_rad: float, yaw_rad: float) -> float:
        """Of the line's two headings, the one on the wanted side."""
        nearest_rad = nearest_heading_rad(heading_rad, yaw_rad)
        turn_rad = wrap_angle_rad(nearest_rad - yaw_rad)
        is_wrong = (self._turn == "right" and turn_rad < -_WRONG_WAY_RAD) or (
            self._turn == "left" and turn_rad > _WRONG_WAY_RAD
        )
        return wrap_angle_rad(nearest_rad + math.pi) if is_wrong else nearest_rad
