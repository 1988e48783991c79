"""What makes the autopilot act against the intended mode: battery, fence, lost sticks, setpoints or position.

Each step `Failsafes` looks at an `Observation` and says which mode has to be flown instead of the intended one, if any.
The graver reaction wins; where its mode cannot be flown, one that can takes its place (PX4's failsafe framework).
"""

import enum
from collections.abc import Callable
from dataclasses import dataclass

from sitl.modes import Mode, Severity
from sitl.parameters import Parameters

Say = Callable[[Severity, str], None]

_TEXT_GAP_S = 2.1  # PX4's health report, and with it the arming checks, follow at most this often
_FENCE_ACTIONS = {2: Mode.LOITER, 3: Mode.RTL, 5: Mode.LAND}  # GF_ACTION; 4, terminate, is not modelled
_LOSS_ACTIONS = {1: Mode.LOITER, 2: Mode.RTL}  # NAV_RCL_ACT, NAV_DLL_ACT; all else lands
_OFFBOARD_ACTIONS = {3: Mode.RTL, 4: Mode.LAND, 5: Mode.LOITER}  # COM_OBL_RC_ACT; the others need sticks


_BATTERY_LEVELS = ("BAT_LOW_THR", "BAT_CRIT_THR", "BAT_EMERGEN_THR")


class Failsafe(enum.Enum):
    """Why the autopilot acts against the intended mode."""

    OFFBOARD_LOSS = "offboard loss"
    POSITION_LOSS = "position loss"
    STICKS_LOSS = "sticks loss"
    LINK_LOSS = "ground station loss"
    FENCE = "fence"
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

    `is_landed` is the land detector's word, `landed_s` for how long, `has_taken_off` since arming; `battery` is 0 to 1;
    `distance_m` and `height_m` are from home (0 without one).
    """

    boot_s: float = 0.0
    setpoint_age_s: float | None = None
    is_landed: bool = True
    landed_s: float = 0.0
    has_taken_off: bool = False
    battery: float = 1.0
    is_position_valid: bool = False
    has_sticks: bool = False
    has_ground_station: bool = False
    is_stick_moving: bool = False
    distance_m: float = 0.0
    height_m: float = 0.0


@dataclass(frozen=True, slots=True)
class Reaction:
    """The mode to fly instead of the intended one, and why."""

    cause: Failsafe
    mode: Mode


class Failsafes:
    """Watches for what cannot go on."""

    def __init__(self, parameters: Parameters, say: Say) -> None:
        """Nothing is wrong yet."""
        self._parameters = parameters
        self._say = say
        self.warning = BatteryWarning.NONE
        self.told_warning = BatteryWarning.NONE
        self._told_s = -_TEXT_GAP_S
        self._battery_mode: Mode | None = None
        self._fence_mode: Mode | None = None
        self._has_left_fence = False
        self._sticks_mode: Mode | None = None
        self._are_sticks_needed = False
        self._link_mode: Mode | None = None
        self._had_ground_station = False
        self._hold_until_s: float | None = None
        self._active: Reaction | None = None

    def release(self) -> None:
        """A person changed the mode, or the motors were disarmed: that ends every latched reaction."""
        self._battery_mode = self._fence_mode = self._sticks_mode = self._link_mode = None
        self._hold_until_s = None
        self._active = None
        self._are_sticks_needed = False

    def step(
        self, seen: Observation, intended: Mode, *, is_flying: bool, is_offboard_available: bool
    ) -> Reaction | None:
        """What has to be flown instead of `intended`."""
        self._watch_battery(seen, is_flying=is_flying)
        if not is_flying:
            return None
        self._watch_fence(seen)
        self._watch_sticks(seen, intended)
        self._watch_link(seen)
        self._end_hold(seen)
        reaction = self._gravest(intended, seen, is_offboard_available=is_offboard_available)
        if reaction is not None and self._active is None and self._hold_until_s is None:
            self._announce()
        self._active = reaction
        return reaction

    def _announce(self) -> None:
        self._say(Severity.CRITICAL, "Failsafe activated")

    def _gravest(self, intended: Mode, seen: Observation, *, is_offboard_available: bool) -> Reaction | None:
        can_navigate = seen.is_position_valid
        for cause, mode in (
            (Failsafe.BATTERY, self._battery_mode),
            (Failsafe.STICKS_LOSS, self._sticks_mode),
            (Failsafe.LINK_LOSS, self._link_mode),
            (Failsafe.FENCE, self._fence_mode),
        ):
            if mode is not None:
                return Reaction(cause, mode if can_navigate else Mode.LAND)
        if intended is Mode.OFFBOARD and not is_offboard_available:
            mode = _OFFBOARD_ACTIONS.get(int(self._parameters.get("COM_OBL_RC_ACT")), Mode.POSCTL)
            without = Mode.ALTCTL if mode is Mode.POSCTL else Mode.LAND
            return Reaction(Failsafe.OFFBOARD_LOSS, mode if can_navigate else without)
        if not can_navigate and intended.needs_position:
            without = Mode.LAND if intended.is_auto else Mode.ALTCTL
            return Reaction(Failsafe.POSITION_LOSS, without)
        if intended.needs_sticks and not seen.has_sticks:
            return Reaction(Failsafe.STICKS_LOSS, Mode.RTL if can_navigate else Mode.LAND)
        return None

    def _hold(self, seen: Observation) -> None:
        """Wait COM_FAIL_ACT_T in Hold before the action, so that a person can take over."""
        delay_s = self._parameters.get("COM_FAIL_ACT_T")
        if delay_s > 0:
            self._say(Severity.CRITICAL, f"Failsafe activated: entering Hold for {delay_s:.0f} seconds")
            self._hold_until_s = seen.boot_s + delay_s
        else:
            self._hold_until_s = seen.boot_s

    def _end_hold(self, seen: Observation) -> None:
        if self._hold_until_s is None or seen.boot_s < self._hold_until_s:
            return
        self._hold_until_s = None
        self._announce()
        if self._battery_mode is not None:
            self._battery_mode = Mode.LAND if self.warning is BatteryWarning.EMERGENCY else Mode.RTL
        if self._sticks_mode is not None:
            self._sticks_mode = _LOSS_ACTIONS.get(int(self._parameters.get("NAV_RCL_ACT")), Mode.LAND)
        if self._link_mode is not None:
            self._link_mode = _LOSS_ACTIONS.get(int(self._parameters.get("NAV_DLL_ACT")), Mode.LAND)

    def _watch_fence(self, seen: Observation) -> None:
        """The cylinder around home (GF_MAX_HOR_DIST, GF_MAX_VER_DIST), by GF_ACTION."""
        action = int(self._parameters.get("GF_ACTION"))
        if action == 0:
            return
        outside = False
        for parameter, value_m, words in (
            ("GF_MAX_HOR_DIST", seen.distance_m, "Maximum distance from home"),
            ("GF_MAX_VER_DIST", seen.height_m, "Maximum altitude above home"),
        ):
            limit_m = self._parameters.get(parameter)
            if 0 < limit_m < value_m:
                outside = True
                if not self._has_left_fence:
                    self._say(Severity.CRITICAL, f"{words} reached ({limit_m:.5f})")
        if outside and not self._has_left_fence:
            self._fence_mode = _FENCE_ACTIONS.get(action)
            if self._fence_mode is None:
                self._announce()  # GF_ACTION 1 only warns
        self._has_left_fence = outside

    def _watch_sticks(self, seen: Observation, intended: Mode) -> None:
        """Sticks that were there and went: NAV_RCL_ACT after a Hold, unless COM_RCL_EXCEPT excepts the mode."""
        if seen.has_sticks:
            self._are_sticks_needed = True
            if self._sticks_mode is not None and self._hold_until_s is not None:
                self._sticks_mode = self._hold_until_s = None
        elif self._are_sticks_needed:
            self._are_sticks_needed = False
            bit = {Mode.MISSION: 1, Mode.LOITER: 2, Mode.OFFBOARD: 4}.get(intended, 0)
            if not int(self._parameters.get("COM_RCL_EXCEPT")) & bit:
                self._sticks_mode = Mode.LOITER
                self._hold(seen)

    def _watch_link(self, seen: Observation) -> None:
        """A ground station that was there and went: NAV_DLL_ACT after a Hold, if that is not 0."""
        if seen.has_ground_station:
            if self._link_mode is not None and self._hold_until_s is not None:
                self._link_mode = self._hold_until_s = None
        elif self._had_ground_station and int(self._parameters.get("NAV_DLL_ACT")):
            self._link_mode = Mode.LOITER
            self._hold(seen)
        self._had_ground_station = seen.has_ground_station

    def _watch_battery(self, seen: Observation, *, is_flying: bool) -> None:
        """PX4's three battery levels (BAT_LOW_THR, BAT_CRIT_THR, BAT_EMERGEN_THR), by COM_LOW_BAT_ACT."""
        n_below = 0
        for name in _BATTERY_LEVELS:
            n_below += seen.battery < self._parameters.get(name)
        if n_below > self.warning:
            self.warning = BatteryWarning(n_below)
            self._tell_battery(seen)
            if is_flying:
                self._react_to_battery(seen)
        self._tell_battery(seen)

    def _tell_battery(self, seen: Observation) -> None:
        if self.told_warning < self.warning and seen.boot_s - self._told_s >= _TEXT_GAP_S:
            self.told_warning, self._told_s = self.warning, seen.boot_s
            words = {1: "Low battery", 2: "Critical battery", 3: "Emergency battery level"}
            self._say(Severity.EMERGENCY, words[self.warning])

    def _react_to_battery(self, seen: Observation) -> None:
        action = int(self._parameters.get("COM_LOW_BAT_ACT"))
        if self.warning is BatteryWarning.EMERGENCY:
            self._say(Severity.CRITICAL, "System does not support shutdown")
        if self.warning is BatteryWarning.LOW or action == 0:
            self._announce()
        elif self._battery_mode is None and self.warning is BatteryWarning.CRITICAL:
            self._battery_mode = Mode.LOITER
            self._hold(seen)
        elif self._hold_until_s is None:
            self._battery_mode = Mode.LAND
            self._announce()
