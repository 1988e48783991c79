"""The simulated autopilot's parameters: PX4's names, types and defaults, as a ground station reads and writes them."""

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter as it stands: `index` is its place in the list, `value` an int where PX4 declares INT32."""

    name: str
    value: float | int
    index: int

    @property
    def is_integer(self) -> bool:
        """Whether PX4 declares it INT32 (else FLOAT)."""
        return isinstance(self.value, int)


# Default, least and greatest value of the parameters that the model obeys, and of the MAV_ and SYS_ ones that say what
# it is. Defaults and types are PX4 v1.16's: a value written as an int is INT32, one with a point is FLOAT. The ranges
# follow its documentation; where that has none or is narrower than missions need, they are what the model bears.
# SIM_BAT_DRAIN alone departs from PX4's 60 s: 0 is the pack's own physics.
_TABLE: dict[str, tuple[float | int, float | int, float | int]] = {
    "BAT_CRIT_THR": (0.07, 0.0, 1.0),
    "BAT_EMERGEN_THR": (0.05, 0.0, 1.0),
    "BAT_LOW_THR": (0.15, 0.0, 1.0),
    "COM_ARM_WO_GPS": (1, 0, 2),
    "COM_DISARM_LAND": (2.0, -1.0, 20.0),
    "COM_DISARM_PRFLT": (10.0, -1.0, 60.0),
    "COM_DL_LOSS_T": (10, 5, 300),
    "COM_FAIL_ACT_T": (5.0, 0.0, 25.0),
    "COM_LOW_BAT_ACT": (3, 0, 3),
    "COM_OBL_RC_ACT": (0, 0, 7),
    "COM_OF_LOSS_T": (1.0, 0.0, 60.0),
    "COM_POSCTL_NAVL": (0, 0, 1),
    "COM_RCL_EXCEPT": (0, 0, 31),
    "COM_RC_IN_MODE": (3, 0, 4),
    "COM_RC_LOSS_T": (0.5, 0.0, 35.0),
    "COM_RC_OVERRIDE": (1, 0, 3),
    "COM_RC_STICK_OV": (30.0, 5.0, 80.0),
    "COM_SPOOLUP_TIME": (1.0, 0.0, 30.0),
    "GF_ACTION": (2, 0, 5),
    "GF_MAX_HOR_DIST": (0.0, 0.0, 10000.0),
    "GF_MAX_VER_DIST": (0.0, 0.0, 10000.0),
    "MAV_COMP_ID": (1, 1, 250),
    "MAV_SYS_ID": (1, 1, 250),
    "MAV_TYPE": (2, 0, 43),
    "MC_PITCHRATE_D": (0.003, 0.0, 0.01),
    "MC_PITCHRATE_I": (0.2, 0.0, 1.0),
    "MC_PITCHRATE_MAX": (220.0, 0.0, 1800.0),
    "MC_PITCHRATE_P": (0.15, 0.01, 0.6),
    "MC_PITCH_P": (6.5, 0.0, 12.0),
    "MC_ROLLRATE_D": (0.003, 0.0, 0.01),
    "MC_ROLLRATE_I": (0.2, 0.0, 1.0),
    "MC_ROLLRATE_MAX": (220.0, 0.0, 1800.0),
    "MC_ROLLRATE_P": (0.15, 0.01, 0.5),
    "MC_ROLL_P": (6.5, 0.0, 12.0),
    "MC_YAWRATE_I": (0.1, 0.0, 1.0),
    "MC_YAWRATE_MAX": (200.0, 0.0, 1800.0),
    "MC_YAWRATE_P": (0.2, 0.0, 0.6),
    "MC_YAW_P": (2.8, 0.0, 5.0),
    "MC_YAW_WEIGHT": (0.4, 0.0, 1.0),
    "MIS_TAKEOFF_ALT": (2.5, 0.0, 1000.0),
    "MPC_ACC_DOWN_MAX": (3.0, 2.0, 15.0),
    "MPC_ACC_HOR": (3.0, 2.0, 15.0),
    "MPC_ACC_UP_MAX": (4.0, 2.0, 15.0),
    "MPC_HOLD_DZ": (0.1, 0.0, 1.0),
    "MPC_JERK_AUTO": (4.0, 1.0, 80.0),
    "MPC_LAND_ALT1": (10.0, 0.0, 122.0),
    "MPC_LAND_ALT2": (5.0, 0.0, 122.0),
    "MPC_LAND_ALT3": (1.0, 0.0, 122.0),
    "MPC_LAND_CRWL": (0.3, 0.1, 5.0),
    "MPC_LAND_SPEED": (0.7, 0.6, 5.0),
    "MPC_MAN_TILT_MAX": (35.0, 1.0, 70.0),
    "MPC_MAN_Y_MAX": (150.0, 0.0, 400.0),
    "MPC_THR_MAX": (1.0, 0.0, 1.0),
    "MPC_THR_MIN": (0.12, 0.05, 0.5),
    "MPC_TILTMAX_AIR": (45.0, 20.0, 89.0),
    "MPC_TILTMAX_LND": (12.0, 10.0, 89.0),
    "MPC_TKO_RAMP_T": (3.0, 0.0, 5.0),
    "MPC_TKO_SPEED": (1.5, 1.0, 5.0),
    "MPC_VEL_MANUAL": (10.0, 3.0, 20.0),
    "MPC_XY_CRUISE": (5.0, 3.0, 20.0),
    "MPC_XY_P": (0.95, 0.0, 2.0),
    "MPC_XY_VEL_D_ACC": (0.2, 0.1, 2.0),
    "MPC_XY_VEL_I_ACC": (0.4, 0.0, 60.0),
    "MPC_XY_VEL_MAX": (12.0, 0.0, 20.0),
    "MPC_XY_VEL_P_ACC": (1.8, 1.2, 5.0),
    "MPC_Z_P": (1.0, 0.1, 1.5),
    "MPC_Z_VEL_D_ACC": (0.0, 0.0, 2.0),
    "MPC_Z_VEL_I_ACC": (2.0, 0.2, 3.0),
    "MPC_Z_VEL_MAX_DN": (1.5, 0.5, 4.0),
    "MPC_Z_VEL_MAX_UP": (3.0, 0.5, 8.0),
    "MPC_Z_VEL_P_ACC": (4.0, 2.0, 15.0),
    "MPC_Z_V_AUTO_DN": (1.5, 0.5, 4.0),
    "MPC_Z_V_AUTO_UP": (3.0, 0.5, 8.0),
    "NAV_ACC_RAD": (10.0, 0.05, 200.0),
    "NAV_DLL_ACT": (0, 0, 6),
    "NAV_MC_ALT_RAD": (0.8, 0.05, 200.0),
    "NAV_RCL_ACT": (2, 1, 6),
    "RTL_CONE_ANG": (45, 0, 90),
    "RTL_MIN_DIST": (10.0, 0.5, 100.0),
    "RTL_RETURN_ALT": (60.0, 0.0, 1000.0),
    "SIM_BAT_DRAIN": (0.0, 0.0, 86400.0),
    "SIM_BAT_MIN_PCT": (50.0, 0.0, 100.0),
    "SIM_GPS_USED": (10, 0, 50),
    "SYS_AUTOSTART": (6001, 0, 9999999),
}
DEFAULTS = {name: default for name, (default, _, _) in _TABLE.items()}
LIMITS = {name: (least, greatest) for name, (_, least, greatest) in _TABLE.items()}


class Parameters:
    """The parameters in force. Reading and writing keep PX4's types; an unknown name raises KeyError."""

    def __init__(self, changes: dict[str, float | int] | None = None) -> None:
        """Take the defaults, and `changes` over them; raises what `set` raises."""
        self._values = dict(DEFAULTS)
        self._indices = {name: index for index, name in enumerate(sorted(DEFAULTS))}
        for name, value in (changes or {}).items():
            self.set(name, value)

    def __len__(self) -> int:
        return len(self._values)

    def get(self, name: str) -> float:
        """A parameter's value as a float, for the control laws."""
        return float(self._values[name])

    def parameter(self, name: str) -> Parameter:
        """A parameter with its place and type; raises KeyError for a name that PX4's vehicle does not have."""
        return Parameter(name, self._values[name], self._indices[name])

    def at(self, index: int) -> Parameter:
        """The parameter at a place in the list; raises IndexError beyond its end."""
        return self.parameter(sorted(self._values)[index])

    def all(self) -> list[Parameter]:
        """Every parameter, in the list's order."""
        return [self.parameter(name) for name in sorted(self._values)]

    def set(self, name: str, value: float | int) -> Parameter:
        """Write a parameter, and return it as it stands then.

        Raises KeyError for an unknown name, TypeError for the wrong one of int and float, and ValueError for what is
        outside its range or not finite; the old value then stays.
        """
        if isinstance(value, int) != isinstance(self._values[name], int):
            declared = "INT32" if isinstance(self._values[name], int) else "FLOAT"
            raise TypeError(f"parameter {name} is {declared}, but got {value!r}; write it in its own type")
        least, greatest = LIMITS[name]
        if not (math.isfinite(value) and least <= value <= greatest):
            raise ValueError(f"parameter {name} is {value!r}; give a value from {least} to {greatest}")
        self._values[name] = value
        return self.parameter(name)
