"""Follow the line: [Ceron] Algorithm 6.3, and its centred variant."""

import math
import statistics
from collections import deque
from dataclasses import dataclass, replace

from mission.autopilot import Setpoint
from mission.guidance import (
    GuidanceSettings,
    WorldLine,
    nearest_heading_rad,
    step_along,
    step_sideways,
    step_vertical,
    turn_towards_rad,
    wrap_angle_rad,
)
from mission.tasks.odometer import NEARLY_M, Odometer
from mission.tasks.task import FlightMemory, Observation, Sight, Step, is_there
from vision.records import wrap_line_angle_rad

_SLOWEST = 0.25  # of r
_STRAIGHT_RAD = math.radians(5.0)  # a turn that is left and takes no speed away
_TURN_RAD = math.radians(25.0)  # and over which it does
_PICK_UP_S = 1.5
_SAME_RAD = math.radians(12.0)  # two sights of one span differ by less
_IN_SIGHT_M = 12.0  # so far behind a bend, the span before it is out of sight
_N_HEIGHTS = 15  # sights whose median is believed
_CLIMB_M_S = 0.7
_PASSED_M = 1.0  # so far behind the vehicle, a bend in view is still one to turn at


@dataclass(frozen=True, slots=True)
class _LeftSpan:
    """The span before the last bend: its heading, and until which way flown [m] what runs so is taken for it."""

    heading_rad: float
    tolerance_rad: float
    until_m: float


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
        self._target_rad: float | None = None
        self._line: WorldLine | None = None
        self._unseen_s = 0.0
        self._course_rad = 0.0
        self._heights_m: deque[float] = deque(maxlen=_N_HEIGHTS)
        self._lowest_down_m: float | None = None
        self._pace = 1.0
        self._bend_m: float | None = None  # how far ahead of the setpoint the line bends
        self._left: _LeftSpan | None = None

    @property
    def progress(self) -> float:
        """The way flown so far [m]."""
        return self._odometer.moved_m

    def step(self, reference: Setpoint, seen: Observation) -> Step:
        """Turn, go ahead, and (centred) go sideways."""
        guidance = self._guidance
        self._unseen_s += seen.dt_s
        if seen.sight is not None and seen.sight.line is not None:
            self._see(reference, seen.sight, seen.sight.line)
        setpoint = reference
        turn_rad = 0.0
        if self._target_rad is not None:
            turn_rad = wrap_angle_rad(self._target_rad - reference.yaw_rad)
            yaw_rad = turn_towards_rad(
                reference.yaw_rad, self._target_rad, guidance.P_per_s, guidance.yaw_rate_rad_s, seen.dt_s
            )
            setpoint = replace(reference, yaw_rad=yaw_rad)
        is_blind = self._unseen_s > guidance.max_estimate_age_s  # then wait for the line, or for the line_lost event
        if self._target_rad is None:
            self._course_rad = reference.yaw_rad
        left_m = self._distance_m - self._odometer.update(reference, self._course_rad)
        speed_m_s = guidance.r_m_s * self._wanted_pace(turn_rad, seen.dt_s) if guidance.is_centred else guidance.r_m_s
        step_m = 0.0 if is_blind else min(speed_m_s * seen.dt_s, max(0.0, left_m))
        course_rad = setpoint.yaw_rad
        if guidance.is_centred and self._target_rad is not None:
            course_rad = self._target_rad  # along the line at once; the nose follows
        self._course_rad = course_rad
        setpoint = step_along(setpoint, course_rad, step_m)
        if guidance.is_centred and self._line is not None:
            vehicle_off_m = self._line.offset_m(seen.state.north_m, seen.state.east_m, course_rad)
            setpoint = step_sideways(
                setpoint,
                self._line,
                course_rad,
                guidance.lateral_per_s,
                guidance.r_m_s if self._is_turning else guidance.lateral_max_m_s,
                seen.dt_s,
                beyond_m=guidance.lateral_lead * vehicle_off_m,
            )
        setpoint = self._hold_height(setpoint, seen)
        if left_m <= NEARLY_M and is_there(seen.state, setpoint, guidance.arrival_m):
            return Step(setpoint, done=f"followed the line for {self._distance_m:g} m")
        return Step(setpoint)

    def _hold_height(self, setpoint: Setpoint, seen: Observation) -> Setpoint:
        """Climb and sink with the conductors, where the height over them is known; never below where the task began."""
        if self._lowest_down_m is None:
            self._lowest_down_m = setpoint.down_m
        if seen.sight is not None and seen.sight.height_m is not None:
            self._heights_m.append(seen.sight.height_m)
        if len(self._heights_m) < _N_HEIGHTS or not self._guidance.is_centred:
            return setpoint
        too_low_m = self._guidance.height_over_line_m - statistics.median(self._heights_m)
        down_m = min(seen.state.down_m - too_low_m, self._lowest_down_m)
        return step_vertical(setpoint, down_m, _CLIMB_M_S, seen.dt_s)

    @property
    def _is_turning(self) -> bool:
        """Whether a bend has just been left behind."""
        return self._left is not None and self._odometer.moved_m <= self._left.until_m

    def _see(self, reference: Setpoint, sight: Sight, line: WorldLine) -> None:
        """Choose between the spans in sight: on the one that is followed, until the setpoint is at the bend."""
        self._unseen_s = 0.0
        if sight.is_whole:
            self._memory.known_line.begin(line, sight.t_capture_ns)
        if self._target_rad is None or not self._guidance.is_centred:
            self._take(line, reference.yaw_rad if self._target_rad is None else self._target_rad, sight)
            return
        target_rad = self._target_rad
        spans = [span for span in (line, sight.next_line) if span is not None and not self._has_left(span)]
        if not spans:
            return  # the vehicle is still over the span that the setpoint has left
        spans.sort(key=lambda span: abs(wrap_line_angle_rad(span.heading_rad - target_rad)))
        self._take(spans[0], target_rad, sight)
        self._bend_m = None
        if len(spans) == 1:
            return
        from_vehicle_m = spans[1].crossing_m(sight.north_m, sight.east_m, target_rad)
        bend_m = spans[1].crossing_m(reference.north_m, reference.east_m, target_rad)
        is_passed = spans[0] is not line  # the vehicle is over the other one already
        if bend_m is not None and from_vehicle_m is not None and (is_passed or from_vehicle_m > -_PASSED_M):
            self._bend_m = bend_m
            if bend_m <= 0.0 or is_passed:
                self._leave(spans[0], spans[1])
                self._take(spans[1], target_rad, sight)

    def _leave(self, span: WorldLine, beyond: WorldLine) -> None:
        """From here on `span` is not looked at any more, as long as its end may be in sight."""
        turn_rad = abs(wrap_line_angle_rad(beyond.heading_rad - span.heading_rad))
        self._left = _LeftSpan(span.heading_rad, min(_SAME_RAD, turn_rad / 2), self._odometer.moved_m + _IN_SIGHT_M)

    def _has_left(self, span: WorldLine) -> bool:
        left = self._left
        if left is None or self._odometer.moved_m > left.until_m:
            return False
        return abs(wrap_line_angle_rad(span.heading_rad - left.heading_rad)) < left.tolerance_rad

    def _take(self, line: WorldLine, heading_rad: float, sight: Sight) -> None:
        self._target_rad = nearest_heading_rad(line.heading_rad, heading_rad)
        self._line = line if sight.is_whole or sight.next_line is not None else self._line

    def _wanted_pace(self, turn_rad: float, dt_s: float) -> float:
        """The share of r to fly at: less while the line is not seen, and while there is still a way to turn."""
        unseen = self._unseen_s / self._guidance.max_estimate_age_s
        turning = (abs(turn_rad) - _STRAIGHT_RAD) / _TURN_RAD
        near_bend = 0.0 if self._bend_m is None else 0.5
        goal = max(_SLOWEST, min(1.0 - unseen, 1.0 - turning, 1.0 - near_bend))
        # Slower at once, faster again over a second or so.
        self._pace = min(goal, self._pace + dt_s / _PICK_UP_S)
        return min(1.0, self._pace)
