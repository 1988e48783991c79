"""Take off: arm and climb in the autopilot's own take-off mode, then stand over the take-off point."""

from mission.autopilot import FlightMode, LandedState, Setpoint
from mission.guidance import GuidanceSettings, step_level_towards, step_vertical
from mission.tasks.task import Command, FlightMemory, Observation, Step, is_there

_SHORT_M = 1.2
_SHORT_SHARE = 0.2
"""How far below the height PX4 may end its take-off: its acceptance radius, 9.4 m of 10 were seen, and a margin."""

_CORRECTION_M_S = 1.0
_STOPPED_M_S = 0.3


class TakeoffTask:
    """Climbs in the autopilot's take-off mode; when that has gone to hold, takes over with setpoints.

    Wind blows the vehicle aside while it leaves the ground. What follows measures its ways from the take-off point, so
    the task ends over it, at the height asked for.
    """

    needs_line = False
    needs_vision = False
    progress = 0.0

    def __init__(self, altitude_m: float, guidance: GuidanceSettings, memory: FlightMemory) -> None:
        self._altitude_m = altitude_m
        self._guidance = guidance
        self._memory = memory
        self._commands = [Command.ARM, Command.TAKEOFF]
        self._is_up = False

    def step(self, reference: Setpoint, seen: Observation) -> Step:
        """Command, wait until the autopilot has done its part, then move the reference over the take-off point."""
        if self._commands:
            return Step(command=self._commands.pop(0), altitude_m=self._altitude_m)
        state, start = seen.state, self._memory.pad or self._memory.start
        if not self._is_up:
            short_m = state.down_m - (start.down_m - self._altitude_m)
            if short_m > max(_SHORT_M, _SHORT_SHARE * self._altitude_m):
                return Step()  # a change to hold so far below is not the autopilot's own
            # PX4 goes to hold when it is up; ArduCopter stays in its guided mode, taking off as it says, and stops.
            is_holding = state.mode is FlightMode.HOLD and state.landed is LandedState.IN_AIR
            is_stopped = state.mode is FlightMode.OFFBOARD and abs(state.v_down_m_s) < _STOPPED_M_S
            if not (is_holding or is_stopped):
                return Step(next_mode=FlightMode.HOLD)
            self._is_up = True
        setpoint = step_level_towards(reference, start, _CORRECTION_M_S, seen.dt_s)
        down_m = start.down_m - self._altitude_m
        setpoint = step_vertical(setpoint, down_m, self._guidance.climb_m_s, seen.dt_s)
        is_over_start = (setpoint.north_m, setpoint.east_m) == (start.north_m, start.east_m)
        if is_over_start and is_there(state, setpoint, self._guidance.arrival_m):
            return Step(setpoint, done=f"in the air at {start.down_m - state.down_m:.1f} m")
        return Step(setpoint)
