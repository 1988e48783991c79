"""Who decides what the autopilot does: arming checks, flight modes, failsafes and the reasons to disarm.

It knows nothing of motion: each step gets an `Observation`, and what it decides is read from its attributes.
"""

import enum
from collections.abc import Callable
from dataclasses import dataclass, replace

from sitl.modes import Answer, Mode, Severity
from sitl.parameters import Parameters

READY_S = 4.0  # flight time after boot until PX4's estimator and GPS let it arm

Say = Callable[[Severity, str], None]


class Failsafe(enum.Enum):
    """Why the autopilot acts against the intended mode."""

    OFFBOARD_LOSS = "offboard loss"
    BATTERY = "battery"


class BatteryWarning(enum.IntEnum):
    """PX4's battery_status.warning."""

    NONE = 0
    LOW = 1
    CRITICAL = 2
    EMERGENCY = 3


@dataclass(frozen=True, slots=True)
class Observation:
    """What the commander looks at: boot time [s], age of the newest offboard setpoint [s] (None: never one), and so on.

    `is_landed` is the land detector's word, `landed_s` for how long, `has_taken_off` since arming; `battery` is 0 to 1.
    """

    boot_s: float
    setpoint_age_s: float | None
    is_landed: bool
    landed_s: float
    has_taken_off: bool
    battery: float


class Commander:
    """The autopilot's decisions. `mode` is flown, `intended` was commanded; they differ in a failsafe."""

    def __init__(self, parameters: Parameters, say: Say, *, speed: float = 1.0) -> None:
        """Start disarmed in Hold. Like PX4, scale COM_OF_LOSS_T by the simulation's `speed`: it stays wall time."""
        self._parameters = parameters
        self._say = say
        self._speed = speed
        self._seen = Observation(0.0, None, True, 0.0, False, 1.0)
        self.intended = Mode.LOITER
        self.mode = Mode.LOITER
        self.is_armed = False
        self.armed_s = 0.0
        self.failsafe: Failsafe | None = None
        self.is_descending_without_sticks = False
        self._last_parking_mode = Mode.LOITER
        self._warning = BatteryWarning.NONE
        self._hold_until_s: float | None = None
        self._battery_mode: Mode | None = None

    @property
    def is_offboard_available(self) -> bool:
        """Whether setpoints come in a fresh stream."""
        age_s = self._seen.setpoint_age_s
        return age_s is not None and age_s < self._parameters.get("COM_OF_LOSS_T") * self._speed

    @property
    def is_ready(self) -> bool:
        """Whether the estimator and GPS are good enough to fly."""
        return self._seen.boot_s >= READY_S

    @property
    def is_armable(self) -> bool:
        """PX4's arming checks; on the ground a mode that cannot take off fails them too."""
        if not self.is_ready or self._seen.battery < self._parameters.get("BAT_CRIT_THR"):
            return False
        if self.intended is Mode.OFFBOARD:
            return self.is_offboard_available
        return self.is_armed or self.intended in (Mode.LOITER, Mode.TAKEOFF)

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
        if self.is_armed:
            is_available = self.is_offboard_available if mode is Mode.OFFBOARD else not mode.needs_sticks
            if not is_available:
                self._say(Severity.CRITICAL, f"Switching to {mode.title} is currently not available")
                return Answer.TEMPORARILY_REJECTED
        self.intended = mode
        if mode not in (Mode.LAND, Mode.RTL, Mode.TAKEOFF):
            self._last_parking_mode = mode
        # A person's decision ends a failsafe's reaction: it is theirs to fly on.
        self._hold_until_s = self._battery_mode = None
        self._enter(mode, None)
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
        self._watch_battery()
        if not self.is_armed:
            self.mode = self.intended
            return
        if seen.is_landed and self._should_disarm():
            return
        if not seen.is_landed or seen.has_taken_off:
            self._fly_failsafes()

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
        self.is_descending_without_sticks = False
        self._hold_until_s = self._battery_mode = None
        if self.intended in (Mode.LAND, Mode.RTL, Mode.TAKEOFF):
            self.intended = self._last_parking_mode
        self.mode = self.intended
        self._say(Severity.INFO, f"Disarmed by {reason}")

    def _enter(self, mode: Mode, failsafe: Failsafe | None) -> None:
        self.mode = mode
        self.failsafe = failsafe
        self.is_descending_without_sticks = failsafe is not None and mode is Mode.POSCTL

    def _fly_failsafes(self) -> None:
        """The battery's reaction goes before that to a lost offboard stream."""
        if self._battery_mode is not None:
            if self._hold_until_s is not None and self._seen.boot_s >= self._hold_until_s:
                self._hold_until_s = None
                if self._warning is BatteryWarning.EMERGENCY:
                    self._say(Severity.CRITICAL, "Failsafe activated")
                    self._battery_mode = Mode.LAND
                else:
                    self._battery_mode = Mode.RTL
            if self.mode is not self._battery_mode:
                self._enter(self._battery_mode, Failsafe.BATTERY)
        elif self.intended is Mode.OFFBOARD:
            if self.is_offboard_available:
                if self.failsafe is Failsafe.OFFBOARD_LOSS:
                    self._enter(Mode.OFFBOARD, None)
            elif self.failsafe is None:
                self._lose_offboard()

    def _lose_offboard(self) -> None:
        """React to a lost stream by COM_OBL_RC_ACT; without sticks, the modes that need them come down slowly."""
        self._say(Severity.CRITICAL, "Failsafe activated")
        action = int(self._parameters.get("COM_OBL_RC_ACT"))
        mode = {3: Mode.RTL, 4: Mode.LAND, 5: Mode.LOITER}.get(action, Mode.POSCTL)
        self._enter(mode, Failsafe.OFFBOARD_LOSS)

    def _watch_battery(self) -> None:
        """PX4's three battery levels (BAT_LOW_THR, BAT_CRIT_THR, BAT_EMERGEN_THR), by COM_LOW_BAT_ACT."""
        get, battery = self._parameters.get, self._seen.battery
        warning = BatteryWarning(sum(battery < get(f"BAT_{level}_THR") for level in ("LOW", "CRIT", "EMERGEN")))
        if warning <= self._warning:
            return
        self._warning = warning
        words = {1: "Low battery", 2: "Critical battery", 3: "Emergency battery level"}
        self._say(Severity.EMERGENCY, words[warning])
        if not self.is_armed or self._seen.is_landed:
            return
        action = int(get("COM_LOW_BAT_ACT"))
        if warning is BatteryWarning.LOW or action == 0:
            self._say(Severity.CRITICAL, "Failsafe activated")
        elif warning is BatteryWarning.CRITICAL:
            delay_s = get("COM_FAIL_ACT_T")
            self._say(Severity.CRITICAL, f"Failsafe activated: entering Hold for {delay_s:.0f} seconds")
            self._battery_mode, self._hold_until_s = Mode.LOITER, self._seen.boot_s + delay_s
        elif self._hold_until_s is None:
            self._say(Severity.CRITICAL, "Failsafe activated")
            self._battery_mode = Mode.LAND
