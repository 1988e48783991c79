"""Follow the line: [Ceron] Algorithm 6.3, and its centred variant."""

import math
from dataclasses import replace

from mission.autopilot import Setpoint
from mission.guidance import (
    GuidanceSettings,
    step_along,
    step_sideways,
    turn_towards_rad,
    wrap_angle_rad,
)
from mission.known_line import Found
from mission.tasks.height_hold import HeightHold
from mission.tasks.odometer import NEARLY_M, Odometer
from mission.tasks.span_choice import SpanChoice
from mission.tasks.task import FlightMemory, Observation, Sight, Step, is_there

_SLOWEST = 0.25  # of r
_STRAIGHT_RAD = math.radians(5.0)  # a turn that is left and takes no speed away
_TURN_RAD = math.radians(25.0)  # and over which it does
_PICK_UP_S = 1.5
_ONTO_SPAN = 2.0  # of r: how fast the setpoint goes sideways onto the span beyond a bend
_FRAME_S = 0.15  # between the frames of a slow camera the line is not unseen


class FollowLinesTask:
    """Moves the setpoint along its own yaw at r, and turns that yaw by P times the image angle.

    The centred law also moves it sideways, onto the line: yaw alone keeps the direction but not the place, and an error
    of one degree is 0.7 m after 40 m. Where wind has carried the vehicle aside, the setpoint goes beyond the line, so
    that the autopilot brings it back sooner. It goes slower while the frames do not show the line, and while it turns.
    """

    needs_line = True
    needs_vision = True

    def __init__(self, distance_m: float, guidance: GuidanceSettings, memory: FlightMemory) -> None:
        self._distance_m = distance_m
        self._guidance = guidance
        self._memory = memory
        self._odometer = Odometer()
        self._unseen_s = 0.0
        self._course_rad = 0.0
        self._spans = SpanChoice()
        self._height = HeightHold(guidance)
        self._pace = 1.0

    @property
    def progress(self) -> float:
        """The way flown so far [m]."""
        return self._odometer.moved_m

    def step(self, reference: Setpoint, seen: Observation) -> Step:
        """Turn, go ahead, and (centred) go sideways."""
        guidance = self._guidance
        self._unseen_s += seen.dt_s
        if seen.sight is not None and seen.sight.found is not None:
            self._see(reference, seen.sight, seen.sight.found)
        setpoint = reference
        turn_rad = 0.0
        if self._spans.target_rad is not None:
            turn_rad = wrap_angle_rad(self._spans.target_rad - reference.yaw_rad)
            yaw_rad = turn_towards_rad(
                reference.yaw_rad, self._spans.target_rad, guidance.P_per_s, guidance.yaw_rate_rad_s, seen.dt_s
            )
            setpoint = replace(reference, yaw_rad=yaw_rad)
        is_blind = self._unseen_s > guidance.max_estimate_age_s  # then wait for the line, or for the line_lost event
        if self._spans.target_rad is None:
            self._course_rad = reference.yaw_rad
        left_m = self._distance_m - self._odometer.update(reference, self._course_rad)
        speed_m_s = guidance.r_m_s * self._wanted_pace(turn_rad, seen.dt_s) if guidance.is_centred else guidance.r_m_s
        step_m = 0.0 if is_blind else min(speed_m_s * seen.dt_s, max(0.0, left_m))
        course_rad = setpoint.yaw_rad
        if guidance.is_centred and self._spans.target_rad is not None:
            course_rad = self._spans.target_rad  # along the line at once; the nose follows
        self._course_rad = course_rad
        setpoint = step_along(setpoint, course_rad, step_m)
        if guidance.is_centred and self._spans.line is not None:
            vehicle_off_m = self._spans.line.offset_m(seen.state.north_m, seen.state.east_m, course_rad)
            setpoint = step_sideways(
                setpoint,
                self._spans.line,
                course_rad,
                guidance.lateral_per_s,
                _ONTO_SPAN * guidance.r_m_s
                if self._spans.is_turning(self._odometer.moved_m)
                else guidance.lateral_max_m_s,
                seen.dt_s,
                beyond_m=guidance.lateral_lead * vehicle_off_m,
            )
        if guidance.is_centred:
            setpoint = self._height.step(setpoint, seen)
        if left_m <= NEARLY_M and is_there(seen.state, setpoint, guidance.arrival_m):
            return Step(setpoint, done=f"followed the line for {self._distance_m:g} m")
        return Step(setpoint)

    def _see(self, reference: Setpoint, sight: Sight, found: Found) -> None:
        if found.is_placed:
            self._memory.known_line.begin()
        if not self._guidance.is_centred:
            target_rad = self._spans.target_rad
            self._spans.take(found.line, reference.yaw_rad if target_rad is None else target_rad, is_place_sure=True)
            self._unseen_s = 0.0
        elif self._spans.see(reference, sight, self._odometer.moved_m, self._unseen_s):
            self._unseen_s = 0.0

    def _wanted_pace(self, turn_rad: float, dt_s: float) -> float:
        """The share of r to fly at: less while the line is not seen, and while there is still a way to turn."""
        late_s = self._guidance.max_estimate_age_s
        unseen = max(0.0, self._unseen_s - _FRAME_S) / max(late_s - _FRAME_S, _FRAME_S)
        turning = (abs(turn_rad) - _STRAIGHT_RAD) / _TURN_RAD
        near_bend = 0.0 if self._spans.bend_m is None else 0.5
        goal = max(_SLOWEST, min(1.0 - unseen, 1.0 - turning, 1.0 - near_bend))
        # Slower at once, faster again over a second or so.
        self._pace = min(goal, self._pace + dt_s / _PICK_UP_S)
        return min(1.0, self._pace)
