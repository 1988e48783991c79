"""Follow the line: [Ceron] Algorithm 6.3, and its centred variant."""

from dataclasses import replace

from mission.autopilot import Setpoint
from mission.guidance import (
    GuidanceSettings,
    WorldLine,
    nearest_heading_rad,
    step_along,
    step_sideways,
    turn_towards_rad,
)
from mission.tasks.odometer import NEARLY_M, Odometer
from mission.tasks.task import Observation, Step, is_there


class FollowLinesTask:
    """Moves the setpoint along its own yaw at r, and turns that yaw by P times the image angle.

    The centred law also moves it sideways, onto the line: yaw alone keeps the direction but not the place, and an error
    of one degree is 0.7 m after 40 m.
    """

    needs_line = True
    needs_vision = True

    def __init__(self, distance_m: float, guidance: GuidanceSettings) -> None:
        self._distance_m = distance_m
        self._guidance = guidance
        self._odometer = Odometer()
        self._target_rad: float | None = None
        self._line: WorldLine | None = None
        self._unseen_s = 0.0

    @property
    def progress(self) -> float:
        """The way flown so far [m]."""
        return self._odometer.moved_m

    def step(self, reference: Setpoint, seen: Observation) -> Step:
        """Turn, go ahead, and (centred) go sideways."""
        guidance = self._guidance
        self._unseen_s += seen.dt_s
        if seen.sight is not None and seen.sight.line is not None:
            heading_rad = reference.yaw_rad if self._target_rad is None else self._target_rad
            self._target_rad = nearest_heading_rad(seen.sight.line.heading_rad, heading_rad)
            self._line = seen.sight.line if seen.sight.is_whole else self._line
            self._unseen_s = 0.0
        setpoint = reference
        if self._target_rad is not None:
            yaw_rad = turn_towards_rad(
                reference.yaw_rad, self._target_rad, guidance.P_per_s, guidance.yaw_rate_rad_s, seen.dt_s
            )
            setpoint = replace(reference, yaw_rad=yaw_rad)
        is_blind = self._unseen_s > guidance.max_estimate_age_s  # then wait for the line, or for the line_lost event
        left_m = self._distance_m - self._odometer.update(reference, reference.yaw_rad)
        step_m = 0.0 if is_blind else min(guidance.r_m_s * seen.dt_s, max(0.0, left_m))
        setpoint = step_along(setpoint, setpoint.yaw_rad, step_m)
        if guidance.is_centred and self._line is not None:
            setpoint = step_sideways(
                setpoint, self._line, setpoint.yaw_rad, guidance.lateral_per_s, guidance.lateral_max_m_s, seen.dt_s
            )
        if left_m <= NEARLY_M and is_there(seen.state, setpoint, guidance.arrival_m):
            return Step(setpoint, done=f"followed the line for {self._distance_m:g} m")
        return Step(setpoint)
