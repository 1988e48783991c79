"""Leaving the ground and coming back to it: the spool-up and take-off ramp, and the land detector.

As PX4 v1.16 does it (mc_pos_control/Takeoff, land_detector), with the times of its recordings.
"""

import enum

from sitl.parameters import Parameters
from sitl.vehicle import GRAVITY_M_S2

_DETECTED_THRUST = 0.45  # of the hover thrust: from here PX4 calls it a take-off
_LET_GO_S = 1.2  # on the ground for this long: stop pushing down, thrust to its minimum
_LANDED_S = 3.0  # on the ground for this long: landed


class Ramp(enum.Enum):
    """Where a take-off stands."""

    DISARMED = "disarmed"
    SPOOLUP = "spoolup"
    READY = "ready"
    RAMPUP = "rampup"
    FLIGHT = "flight"


class TakeoffRamp:
    """Lets the motors spin up, then raises the climb that the controller may ask for, so that nothing jumps."""

    def __init__(self, parameters: Parameters) -> None:
        """Stand disarmed."""
        self._parameters = parameters
        self.state = Ramp.DISARMED
        self._since_s = 0.0
        self._low_m_s = -GRAVITY_M_S2 / parameters.get("MPC_Z_VEL_P_ACC")

    def step(self, dt_s: float, *, is_armed: bool, wants_takeoff: bool, is_landed: bool) -> None:
        """Move on by `dt_s` [s]."""
        self._since_s += dt_s
        if not is_armed:
            self._enter(Ramp.DISARMED)
        elif self.state is Ramp.DISARMED:
            self._enter(Ramp.SPOOLUP if is_landed else Ramp.FLIGHT)
        elif self.state is Ramp.SPOOLUP and self._since_s >= self._parameters.get("COM_SPOOLUP_TIME"):
            self._enter(Ramp.READY)
        elif self.state is Ramp.READY and wants_takeoff:
            self._enter(Ramp.RAMPUP)
        elif self.state is Ramp.RAMPUP and self._since_s >= self._parameters.get("MPC_TKO_RAMP_T"):
            self._enter(Ramp.FLIGHT)
        elif self.state is Ramp.FLIGHT and is_landed:
            self._enter(Ramp.READY)

    def max_up_m_s(self, limit_m_s: float) -> float:
        """The climb [m/s] that may be asked for now, at most `limit_m_s`; negative while the ramp is still low."""
        if self.state is not Ramp.RAMPUP:
            return limit_m_s
        ramp_s = self._parameters.get("MPC_TKO_RAMP_T")
        if self._since_s >= ramp_s:  # also a ramp of no length, which is done as it begins
            return limit_m_s
        return self._low_m_s + self._since_s / ramp_s * (limit_m_s - self._low_m_s)

    def _enter(self, state: Ramp) -> None:
        if state is not self.state:
            self.state = state
            self._since_s = 0.0


class LandDetector:
    """Says whether the vehicle has landed, and since when."""

    def __init__(self, hover_thrust: float) -> None:
        """Stand on the ground; `hover_thrust` is 0 to 1 of the full thrust."""
        self._threshold = _DETECTED_THRUST * hover_thrust
        self.is_landed = True
        self.landed_s = 0.0
        self._contact_s = 0.0

    @property
    def has_let_go(self) -> bool:
        """Whether the vehicle stands long enough that thrust may go to its minimum."""
        return not self.is_landed and self._contact_s >= _LET_GO_S

    def rest(self) -> None:
        """The motors are off: PX4 takes that for landed, wherever the vehicle is."""
        self.is_landed = True

    def step(self, dt_s: float, *, is_touching: bool, is_ramping: bool, is_flying: bool, thrust: float) -> None:
        """Move on by `dt_s` [s]; `thrust` is what the controller asks, 0 to 1."""
        if self.is_landed:
            self.landed_s += dt_s
            if (is_ramping and thrust > self._threshold) or not is_touching:
                self.is_landed = False
                self.landed_s = self._contact_s = 0.0
            return
        # While the ramp still rises the vehicle stands, but it is about to leave.
        self._contact_s = self._contact_s + dt_s if is_touching and is_flying else 0.0
        if self._contact_s >= _LANDED_S:
            self.is_landed = True
