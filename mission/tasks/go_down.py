"""Land and return: leave the way down to the autopilot's own modes, and see it disarm."""

from mission.autopilot import LandedState, Setpoint
from mission.tasks.task import Command, Observation, Step

_TELEMETRY_LAG_S = 3.0
"""A vehicle that was armed a moment ago still says disarmed: the heartbeat comes once a second."""


class GoDownTask:
    """Commands LAND or RETURN once, after a pause; done when the vehicle stands on the ground, disarmed."""

    needs_line = False
    needs_vision = False

    def __init__(self, command: Command, pause_s: float = 0.0) -> None:
        self.command = command
        self._pause_s = pause_s
        self._age_s = 0.0
        self._is_commanded = False

    def step(self, reference: Setpoint, seen: Observation) -> Step:
        """Command once, then wait."""
        self._age_s += seen.dt_s
        if not self._is_commanded:
            if self._age_s < self._pause_s:
                return Step()
            self._is_commanded = True
            self._age_s = 0.0
            return Step(command=self.command)
        is_down = seen.state.landed is LandedState.ON_GROUND and not seen.state.is_armed
        if is_down and self._age_s >= _TELEMETRY_LAG_S:
            return Step(done="landed and disarmed")
        return Step()
