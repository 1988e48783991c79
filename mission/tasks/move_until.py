"""Move until the line: [Ceron] Algorithm 6.1, with the n detections in a row of section 6.4.3."""

import math

from mission.autopilot import Setpoint
from mission.guidance import GuidanceSettings, step_along
from mission.tasks.odometer import NEARLY_M, Odometer
from mission.tasks.task import FlightMemory, Observation, Step, is_there

_BEFORE_M = 3.0  # a search may begin over its line
_GONE_S = 2.0  # a line that was to be here, and is not seen for so long, is none


class MoveUntilTask:
    """Flies along theta_0 until n frames in a row show the line.

    The thesis stops there. By default we go on until the line is right below, because a vehicle beside the line would
    follow it from the side, and the way home, which is as long as the way here, would miss the take-off point. And we
    go on until the way flown has told how far below the line is (mission/wire.py): what lies on the ground may look
    like one.
    """

    needs_line = False
    needs_vision = True

    def __init__(
        self,
        max_distance_m: float,
        n_detections: int,
        guidance: GuidanceSettings,
        memory: FlightMemory,
        *,
        is_overhead: bool,
    ) -> None:
        self._max_distance_m = max_distance_m
        self._n_detections = n_detections
        self._is_overhead = is_overhead
        self._guidance = guidance
        self._memory = memory
        self._odometer = Odometer()
        self._n_in_a_row = 0
        self._blind_s = 0.0
        self._unseen_s = 0.0
        self._goal_m: float | None = None
        memory.known_line.forget()

    @property
    def progress(self) -> float:
        """The way flown so far [m]."""
        return self._odometer.moved_m

    def step(self, reference: Setpoint, seen: Observation) -> Step:
        """Move the reference along theta_0, or to where the line crosses the way once that is known."""
        heading_rad = self._memory.theta_0_rad
        moved_m = self._odometer.update(reference, heading_rad)
        self._look(reference, seen, heading_rad)
        # Without frames the line could pass below unseen: then wait for them, or for the vision_dead event.
        self._blind_s = 0.0 if seen.sight is not None else self._blind_s + seen.dt_s
        is_blind = self._blind_s > self._guidance.max_estimate_age_s
        self._unseen_s += 0.0 if is_blind else seen.dt_s
        limit_m = 0.0 if is_blind else self._guidance.r_m_s * seen.dt_s
        goal_m = self._max_distance_m if self._goal_m is None else self._goal_m
        step_m = max(-limit_m, min(limit_m, goal_m - moved_m))
        setpoint = step_along(reference, heading_rad, step_m)
        if self._goal_m is None:
            if moved_m >= self._max_distance_m - NEARLY_M and is_there(seen.state, setpoint, self._guidance.arrival_m):
                return Step(setpoint, failed=f"no line within {self._max_distance_m:g} m")
            return Step(setpoint)
        if abs(self._goal_m - moved_m) < self._guidance.r_m_s * seen.dt_s and is_there(
            seen.state, setpoint, self._guidance.arrival_m
        ):
            if self._is_overhead and self._unseen_s > self._guidance.max_estimate_age_s:
                if self._unseen_s > _GONE_S:  # what seemed to be here is not: look on
                    self._memory.known_line.forget()
                    self._goal_m = None
                return Step(setpoint)
            self._memory.move_until_m = self._from_start_m(setpoint, heading_rad)
            where = "over the line" if self._is_overhead else "the line is in sight"
            return Step(setpoint, done=f"{where} after {moved_m:.1f} m")
        return Step(setpoint)

    def _from_start_m(self, setpoint: Setpoint, heading_rad: float) -> float:
        """The distance from the take-off point along the heading, which the way home will need [m].

        It is not the distance flown: wind and the autopilot's take-off leave the vehicle beside its take-off point.
        """
        start = self._memory.start
        north_m, east_m = setpoint.north_m - start.north_m, setpoint.east_m - start.east_m
        return max(0.0, north_m * math.cos(heading_rad) + east_m * math.sin(heading_rad))

    def _look(self, reference: Setpoint, seen: Observation, heading_rad: float) -> None:
        """Count the detections; from the n-th on, set the goal."""
        sight = seen.sight
        if sight is None:
            return
        found = sight.found
        if found is None or (self._is_overhead and found.line.crossing_m(0.0, 0.0, heading_rad) is None):
            self._n_in_a_row, self._goal_m = 0, self._goal_m if self._is_overhead else None
            return
        self._unseen_s = 0.0
        self._n_in_a_row += 1
        if self._n_in_a_row < self._n_detections:
            return
        if not self._is_overhead:
            if self._goal_m is None:  # where the vehicle is: the setpoint runs ahead of it
                lag_north_m, lag_east_m = seen.state.north_m - reference.north_m, seen.state.east_m - reference.east_m
                lag_m = lag_north_m * math.cos(heading_rad) + lag_east_m * math.sin(heading_rad)
                self._goal_m = self._odometer.moved_m + min(0.0, lag_m)
            return
        crossing_m = found.line.crossing_m(reference.north_m, reference.east_m, heading_rad)
        self._goal_m = None
        if found.depth_m is not None and crossing_m is not None:  # else it may lie on the ground: go on, and see
            goal_m = self._odometer.moved_m + crossing_m
            self._goal_m = min(goal_m, self._max_distance_m) if goal_m > -_BEFORE_M else None
