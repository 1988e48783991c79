"""Who decides what the autopilot does: arming checks, flight modes, takeovers and the reasons to disarm.

It knows nothing of motion: each step gets an `Observation`, and what it decides is read from its attributes.
"""

from dataclasses import replace

from sitl.failsafes import BatteryWarning, Failsafe, Failsafes, Observation, Say
from sitl.modes import Answer, Mode, Severity
from sitl.parameters import Parameters

_PARKING = (Mode.LAND, Mode.RTL, Mode.TAKEOFF)  # modes that end with a landing, or that no disarmed vehicle keeps


class Commander:
    """The autopilot's decisions. `mode` is flown, `intended` was commanded; they differ in a failsafe."""

    def __init__(self, parameters: Parameters, say: Say, *, speed: float = 1.0) -> None:
        """Start disarmed in Hold. Like PX4, scale COM_OF_LOSS_T by the simulation's `speed`: it stays wall time."""
        self._parameters = parameters
        self._say = say
        self._speed = speed
        self._seen = Observation()
        self._failsafes = Failsafes(parameters, say)
        self.intended = Mode.LOITER
        self.mode = Mode.LOITER
        self.is_armed = False
        self.armed_s = 0.0
        self.failsafe: Failsafe | None = None
        self._last_parking_mode = Mode.LOITER
        self._was_mode_chosen = False

    @property
    def is_offboard_available(self) -> bool:
        """Whether setpoints come in a fresh stream."""
        age_s = self._seen.setpoint_age_s
        return age_s is not None and age_s < self._parameters.get("COM_OF_LOSS_T") * self._speed

    @property
    def is_armable(self) -> bool:
        """PX4's arming checks; a mode that cannot be flown, or not be taken off in, fails them too."""
        seen = self._seen
        if not seen.is_position_valid or self._failsafes.told_warning >= BatteryWarning.CRITICAL:
            return False
        if self.mode is Mode.OFFBOARD:
            return self.is_offboard_available
        if self.mode.needs_sticks:
            return seen.has_sticks
        return self.is_armed or self.mode in (Mode.LOITER, Mode.TAKEOFF)

    @property
    def warning(self) -> BatteryWarning:
        """How low the battery is."""
        return self._failsafes.warning

    def can_fly(self, mode: Mode) -> bool:
        """Whether an armed vehicle could enter a mode now."""
        if mode is Mode.OFFBOARD and not self.is_offboard_available:
            return False
        if mode.needs_sticks and not self._seen.has_sticks:
            return False
        return self._seen.is_position_valid or not mode.needs_position or mode is Mode.LAND

    def arm(self) -> Answer:
        """Arm; also accepted when already armed."""
        if self.is_armed:
            return Answer.ACCEPTED
        if not self.is_armable:
            self._say(Severity.CRITICAL, "Arming denied: Resolve system health failures first")
            return Answer.TEMPORARILY_REJECTED
        self.is_armed = True
        self.armed_s = self._seen.boot_s
        self._say(Severity.INFO, "Armed by external command")
        return Answer.ACCEPTED

    def disarm(self, *, is_forced: bool = False) -> Answer:
        """Disarm; refused in the air unless forced (MAV_CMD_COMPONENT_ARM_DISARM, param2 21196)."""
        if not self.is_armed:
            return Answer.ACCEPTED
        if not self._seen.is_landed and not is_forced:
            self._say(Severity.CRITICAL, "Disarming denied: not landed")
            return Answer.TEMPORARILY_REJECTED
        self._disarm("external command")
        return Answer.ACCEPTED

    def request(self, mode: Mode) -> Answer:
        """Change the intended mode. Disarmed anything goes, and a bad mode only keeps from arming."""
        if self.is_armed and not self.can_fly(mode):
            self._say(Severity.CRITICAL, f"Switching to {mode.title} is currently not available")
            return Answer.TEMPORARILY_REJECTED
        self._choose(mode)
        return Answer.ACCEPTED

    def see_setpoint(self) -> None:
        """An offboard setpoint has just come."""
        self._seen = replace(self._seen, setpoint_age_s=0.0)

    def finish_takeoff(self) -> None:
        """The take-off is done: go on in Hold."""
        if self.intended is Mode.TAKEOFF:
            self.intended = self._last_parking_mode = Mode.LOITER
        if self.mode is Mode.TAKEOFF:
            self.mode = Mode.LOITER

    def step(self, seen: Observation) -> None:
        """Look at the vehicle, and react."""
        self._seen = seen
        if not self.is_armed and seen.has_sticks and not self._was_mode_chosen:
            self._choose(Mode.POSCTL)  # PX4: who holds the sticks starts in Position, unless a mode was chosen
        if self.is_armed and seen.is_landed and self._should_disarm():
            return
        if self.is_armed and seen.is_stick_moving and self._may_take_over:
            self._say(Severity.INFO, "Pilot took over using sticks")
            self._choose(Mode.POSCTL if seen.is_position_valid else Mode.ALTCTL)
        reaction = self._failsafes.step(
            seen,
            self.intended,
            is_flying=self.is_armed and (not seen.is_landed or seen.has_taken_off),
            is_offboard_available=self.is_offboard_available,
        )
        self.mode, self.failsafe = (reaction.mode, reaction.cause) if reaction else (self.intended, None)

    @property
    def _may_take_over(self) -> bool:
        """Whether moved sticks end the flown mode (COM_RC_OVERRIDE: bit 0 automatic modes, bit 1 offboard)."""
        bit = 2 if self.mode is Mode.OFFBOARD else 1 if self.mode.is_auto else 0
        return bool(int(self._parameters.get("COM_RC_OVERRIDE")) & bit)

    def _choose(self, mode: Mode) -> None:
        self.intended = mode
        self._was_mode_chosen = True
        if mode not in _PARKING:
            self._last_parking_mode = mode
        # A person's decision ends a failsafe's reaction: it is theirs to fly on.
        self._failsafes.release()
        self.mode, self.failsafe = mode, None

    def _should_disarm(self) -> bool:
        get, seen = self._parameters.get, self._seen
        if seen.has_taken_off:
            if 0 < get("COM_DISARM_LAND") <= seen.landed_s:
                self._disarm("landing")
                return True
        elif 0 < get("COM_DISARM_PRFLT") <= seen.boot_s - self.armed_s - get("COM_SPOOLUP_TIME"):
            self._disarm("auto preflight disarming")
            return True
        return False

    def _disarm(self, reason: str) -> None:
        self.is_armed = False
        self.failsafe = None
        self._failsafes.release()
        if self.intended in _PARKING:
            self.intended = self._last_parking_mode
        self.mode = self.intended
        self._say(Severity.INFO, f"Disarmed by {reason}")
