"""Hand over: leave the vehicle hovering in the autopilot's own hold mode."""

from mission.autopilot import FlightMode, Setpoint
from mission.tasks.task import Command, Observation, Step

_TELEMETRY_LAG_S = 3.0
"""The heartbeat tells the mode once a second, and a command takes its time."""


class HandOverTask:
    """Commands HOLD, again whenever the autopilot is not in it; done when it is seen there.

    Where the pilot chose another mode meanwhile, our control ends before the command is repeated: safety says so.
    """

    needs_line = False
    needs_vision = False
    progress = 0.0

    def __init__(self) -> None:
        self._wait_s = 0.0
        self._is_commanded = False

    def step(self, reference: Setpoint, seen: Observation) -> Step:
        """Command, wait, command again if need be."""
        if self._is_commanded and seen.state.mode is FlightMode.HOLD:
            return Step(done="the vehicle hovers in hold mode, and waits for its pilot")
        self._wait_s -= seen.dt_s
        if self._wait_s > 0.0:
            return Step()
        self._is_commanded = True
        self._wait_s = _TELEMETRY_LAG_S
        return Step(command=Command.HOLD)
