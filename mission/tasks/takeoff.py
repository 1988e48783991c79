"""Take off: arm and climb in the autopilot's own take-off mode, then stand over the take-off point."""

from mission.autopilot import FlightMode, LandedState, Setpoint
from mission.guidance import GuidanceSettings, step_level_towards, step_vertical
from mission.tasks.task import Command, FlightMemory, Observation, Step, is_there

_REACHED_SHARE = 0.8
"""PX4 ends its take-off within its own acceptance radius: 9.4 m of 10 were seen, and less of a low take-off."""

_CORRECTION_M_S = 1.0


class TakeoffTask:
    """Climbs in the autopilot's take-off mode; when that has gone to hold, takes over with setpoints.

    Wind blows the vehicle aside while it leaves the ground. What follows measures its ways from the take-off point, so
    the task ends over it, at the height asked for.
    """

    needs_line = False
    needs_vision = False

    def __init__(self, altitude_m: float, guidance: GuidanceSettings, memory: FlightMemory) -> None:
        self._altitude_m = altitude_m
        self._guidance = guidance
        self._memory = memory
        self._is_commanded = False
        self._was_climbing = False
        self._is_up = False

    def step(self, reference: Setpoint, seen: Observation) -> Step:
        """Command the take-off once, wait, then move the reference over the take-off point."""
        if not self._is_commanded:
            self._is_commanded = True
            return Step(command=Command.TAKEOFF, altitude_m=self._altitude_m)
        state, start = seen.state, self._memory.start
        self._was_climbing = self._was_climbing or (state.is_armed and state.mode is FlightMode.TAKEOFF)
        if self._was_climbing and not state.is_armed:
            return Step(failed="the vehicle disarmed during take-off")
        if not self._is_up:
            is_high = start.down_m - state.down_m >= _REACHED_SHARE * self._altitude_m
            has_ended = state.landed is LandedState.IN_AIR and state.mode is FlightMode.HOLD
            if not (self._was_climbing and has_ended and is_high):
                return Step()
            self._is_up = True
        setpoint = step_level_towards(reference, start, _CORRECTION_M_S, seen.dt_s)
        down_m = start.down_m - self._altitude_m
        setpoint = step_vertical(setpoint, down_m, self._guidance.climb_m_s, seen.dt_s)
        is_over_start = (setpoint.north_m, setpoint.east_m) == (start.north_m, start.east_m)
        if is_over_start and is_there(state, setpoint, self._guidance.arrival_m):
            return Step(setpoint, done=f"in the air at {start.down_m - state.down_m:.1f} m")
        return Step(setpoint)
