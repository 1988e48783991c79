"""Land and return: leave the way down to the autopilot's own modes, and see it disarm."""

import math

from mission.autopilot import FlightMode, LandedState, Setpoint, VehicleState
from mission.tasks.task import Command, FlightMemory, Observation, Step

_TELEMETRY_LAG_S = 3.0
"""A vehicle that was armed a moment ago still says disarmed, and an old mode: the heartbeat comes once a second."""

_HOME_M = 5.0

_MODES = {
    Command.LAND: frozenset({FlightMode.LAND}),
    Command.RETURN: frozenset({FlightMode.RETURN, FlightMode.LAND}),
}


class GoDownTask:
    """Commands LAND or RETURN after a pause, again whenever the autopilot is not on that way; done when disarmed.

    A command that was refused, or whose answer got lost, must not leave the vehicle hovering. What looks like a pilot's
    choice of another mode ends our control before the command is repeated: that is for safety to say.
    """

    needs_line = False
    needs_vision = False
    progress = 0.0

    def __init__(self, command: Command, memory: FlightMemory, pause_s: float = 0.0) -> None:
        self.command = command
        self._memory = memory
        self._wait_s = pause_s
        self._is_commanded = False

    def step(self, reference: Setpoint, seen: Observation) -> Step:
        """Command, wait, command again if need be."""
        self._wait_s -= seen.dt_s
        if self._wait_s > 0.0:
            return Step()
        state = seen.state
        if self._is_commanded and not state.is_armed and state.landed is LandedState.ON_GROUND:
            return Step(done=self._landed_words(state))
        is_on_its_way = state.mode in _MODES[self.command]
        if is_on_its_way and (self._is_commanded or state.landed is LandedState.ON_GROUND):
            self._is_commanded = True
            return Step()
        self._is_commanded = True
        self._wait_s = _TELEMETRY_LAG_S
        return Step(command=self.command)

    def _landed_words(self, state: VehicleState) -> str:
        """A return that ended somewhere else, by a failsafe of the autopilot's, must not read as one that came home."""
        start = self._memory.start
        away_m = math.hypot(state.north_m - start.north_m, state.east_m - start.east_m)
        if self.command is Command.LAND or away_m < _HOME_M:
            return "landed and disarmed"
        return f"landed and disarmed {away_m:.0f} m from the take-off point"
