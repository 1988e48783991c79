"""The helm: does what a task wants of the autopilot, and keeps what was commanded."""

from collections.abc import Coroutine
from typing import Any

from drivers.clock import Clock
from mission.autopilot import Autopilot, AutopilotError, FlightMode, NoAnswerError, Setpoint, VehicleState
from mission.guidance import leash
from mission.limits import LOWEST_M, SetpointLimits, unsafe
from mission.mode_watch import ModeWatch
from mission.preflight_checks import not_at_rest
from mission.reporting import FlightLog
from mission.tasks.task import Command, Step
from mission.watchers import TargetWatch

MAX_MISSED_SETPOINTS = 2
"""In a row; each takes its time limit of half a second."""


class UnsafeSetpointError(Exception):
    """A task wanted a setpoint that must not be sent; the message is a sentence."""


class TakenOverError(Exception):
    """The vehicle is in a mode that is not ours: a command now would take it from somebody."""


class Helm:
    """Sends setpoints and commands. `reference` is the last setpoint, `modes` what our commands explain.

    Its coroutines raise AutopilotError when the autopilot refuses or does not answer, UnsafeSetpointError, and
    TakenOverError: between a decision and its command may lie a journal's disk, and a pilot is quicker.
    """

    def __init__(self, autopilot: Autopilot, log: FlightLog, clock: Clock, limits: SetpointLimits) -> None:
        self._autopilot = autopilot
        self._log = log
        self._clock = clock
        self._limits = limits
        self._n_missed_setpoints = 0
        self.reference = Setpoint(0.0, 0.0, 0.0, 0.0)
        self.start = self.reference
        """The take-off point."""
        self.floor_m = LOWEST_M
        """What setpoints must stay above, from the take-off point."""
        self.modes = ModeWatch()
        self.targets = TargetWatch()
        self.was_told_to_arm = False
        """Whether the vehicle was told to arm and did not refuse."""

    async def do(self, step: Step, state: VehicleState) -> None:
        """Send what the task wants."""
        if step.next_mode is not None:
            self.modes.announce(step.next_mode)
        if step.command is Command.ARM:
            await self._arm(state)
        elif step.command is Command.TAKEOFF:
            # ArduCopter takes off in its guided mode, which is offboard to us.
            await self._command(self._autopilot.takeoff(step.altitude_m), FlightMode.TAKEOFF, *self._takeoff_modes())
        elif step.command is Command.RETURN:
            # Its end, the landing, may be shown as LAND.
            await self._command(self._autopilot.return_home(), FlightMode.RETURN, FlightMode.LAND)
        elif step.command is Command.HOLD:
            await self.hold()
        elif step.command is Command.LAND:
            await self._command(self._autopilot.land(), FlightMode.LAND)
        if step.setpoint is not None:
            await self._steer(step.setpoint, state)

    def _takeoff_modes(self) -> tuple[FlightMode, ...]:
        return (FlightMode.OFFBOARD,) if self._autopilot.takes_off_in_offboard else ()

    async def hold(self) -> None:
        """Hold position in the autopilot's own mode."""
        await self._command(self._autopilot.hold(), FlightMode.HOLD)

    async def _steer(self, setpoint: Setpoint, state: VehicleState) -> None:
        """Send a setpoint on its leash; the first of an offboard phase is where the vehicle is."""
        if self.modes.is_offboard:
            wanted = leash(setpoint, state, self._limits.leash_m)
            words = unsafe(wanted, self.start, self.floor_m, self._limits)
            if words is not None:
                raise UnsafeSetpointError(words)
            self.reference = wanted
            await self._send_setpoint()
        else:
            # Entering offboard must not move the vehicle.
            self.reference = Setpoint(state.north_m, state.east_m, state.down_m, self.reference.yaw_rad)
            await self._command(self._autopilot.start_offboard(self.reference), FlightMode.OFFBOARD)
        now_ns = self._clock.now_ns()
        self.targets.sent(now_ns, self.reference)
        self._log.record_setpoint(now_ns, self.reference)

    async def _send_setpoint(self) -> None:
        """Send the reference; one that is not taken in time may be missed, as the one before it is repeated."""
        try:
            await self._autopilot.set_setpoint(self.reference)
            self._n_missed_setpoints = 0
        except NoAnswerError:
            self._n_missed_setpoints += 1
            if self._n_missed_setpoints > MAX_MISSED_SETPOINTS:
                raise

    async def _command(self, call: Coroutine[Any, Any, None], *modes: FlightMode) -> None:
        """Send a command that leads to one of `modes`."""
        state = self._autopilot.state
        now_ns = self._clock.now_ns()
        if state is not None and state.mode not in self.modes.explained(now_ns, state):
            call.close()
            raise TakenOverError
        self.modes.announce(*modes)
        await call
        self.modes.accept(self._clock.now_ns(), *modes)

    async def _arm(self, state: VehicleState) -> None:
        rest = not_at_rest(state)
        if rest is not None:
            raise AutopilotError(f"not armed: we wait for {rest}")
        try:
            self.was_told_to_arm = True
            await self._autopilot.arm()
        except NoAnswerError:
            raise  # it may have armed all the same
        except AutopilotError:
            self.was_told_to_arm = False
            raise
