"""What the autopilot flies in each mode by itself: take off, hold, return, land, and what an offboard setpoint asks."""

import math
from typing import Protocol

from sitl.control import Estimate, Setpoint, clamp
from sitl.parameters import Parameters
from sitl.vehicle import Vector, euler_of

_REFERENCE_GAIN_1_S = 2.0
_ARRIVAL_GAIN_1_S = 0.6
_MAX_LAG_M = 2.0  # MPC_XY_ERR_MAX: the reference waits for a vehicle that falls further behind
_APPROACH_M_S2 = 0.45  # how hard a climb or a descent brakes before its end, as recorded from PX4 v1.16
_ARRIVED_M = 2.0  # from home, where a return begins to land, as recorded from PX4 v1.16
_DESCEND_M_S = 0.6  # a failsafe descent without sticks, as recorded from PX4 v1.16
_TAKEOFF_ACCELERATION_M_S2 = 0.5
_YAW_RATE_RAD_S = math.radians(45.0)  # a turn that a task makes by itself


class FlightTask(Protocol):
    """Turns a mode into setpoints."""

    @property
    def is_landing(self) -> bool:
        """Whether the vehicle is on its way to the ground."""
        ...

    def step(self, dt_s: float, estimate: Estimate, height_m: float) -> Setpoint:
        """The setpoint after `dt_s` [s]; `height_m` is the range finder's height over the ground."""
        ...


class Reference:
    """A position that moves smoothly: its velocity follows a wanted one within acceleration and jerk limits."""

    def __init__(self, parameters: Parameters, estimate: Estimate) -> None:
        """Start where the vehicle is, as fast as it is."""
        self.position_m = list(estimate.position_m)
        self.velocity_m_s = list(estimate.velocity_m_s)
        self._acceleration_m_s2 = [0.0, 0.0, 0.0]
        self._jerk_m_s3 = parameters.get("MPC_JERK_AUTO")
        horizontal = parameters.get("MPC_ACC_HOR")
        self._up_m_s2, self._down_m_s2 = parameters.get("MPC_ACC_UP_MAX"), parameters.get("MPC_ACC_DOWN_MAX")
        self._limits_m_s2 = (horizontal, horizontal, min(self._up_m_s2, self._down_m_s2))

    def step(self, dt_s: float, wanted_m_s: Vector, actual_m: Vector) -> None:
        """Move on by `dt_s` [s] towards the velocity `wanted_m_s` NED, waiting for the vehicle at `actual_m`."""
        for axis in range(3):
            wanted = _REFERENCE_GAIN_1_S * (wanted_m_s[axis] - self.velocity_m_s[axis])
            limit = self._limits_m_s2[axis]
            change = clamp(wanted, -limit, limit) - self._acceleration_m_s2[axis]
            step = self._jerk_m_s3 * dt_s
            self._acceleration_m_s2[axis] += clamp(change, -step, step)
            self.velocity_m_s[axis] += self._acceleration_m_s2[axis] * dt_s
            ahead = (self.position_m[axis] - actual_m[axis]) * math.copysign(1.0, self.velocity_m_s[axis])
            pace = clamp(2.0 - ahead / _MAX_LAG_M, 0.0, 1.0)
            self.position_m[axis] += pace * self.velocity_m_s[axis] * dt_s


def _speed_to(distance_m: float, limit_m_s: float, braking_m_s2: float) -> float:
    """The signed speed [m/s] from which one can still stop after `distance_m`, at most `limit_m_s`."""
    return math.copysign(min(limit_m_s, math.sqrt(2 * braking_m_s2 * abs(distance_m))), distance_m)


def _velocity_to(north_m: float, east_m: float, limit_m_s: float, braking_m_s2: float) -> tuple[float, float]:
    """The velocity (north, east) [m/s] towards a point that far away, slow enough to stop there.

    Close by it falls in proportion to the distance: the reference lags behind what is wanted of it, and with the square
    root alone, whose gain has no bound, it would swing around the point for ever.
    """
    distance_m = math.hypot(north_m, east_m)
    if distance_m < 1e-3:
        return (0.0, 0.0)
    scale = min(_speed_to(distance_m, limit_m_s, braking_m_s2) / distance_m, _ARRIVAL_GAIN_1_S)
    return (north_m * scale, east_m * scale)


class AutoTask:
    """What the tasks share: limits, a reference, and the yaw at their start."""

    def __init__(self, parameters: Parameters, estimate: Estimate) -> None:
        self._parameters = parameters
        self._reference = Reference(parameters, estimate)
        self._yaw_rad = euler_of(estimate.quaternion)[2]
        self._max_up_m_s = parameters.get("MPC_Z_VEL_MAX_UP")
        self._max_down_m_s = 1.2 * parameters.get("MPC_Z_VEL_MAX_DN")  # room to catch up with the reference
        self._tilt_rad = math.radians(parameters.get("MPC_TILTMAX_AIR"))

    @property
    def is_landing(self) -> bool:
        """Whether the vehicle is on its way to the ground."""
        return False

    def _turn(self, dt_s: float, yaw_rad: float) -> None:
        """Turn the setpoint's yaw towards `yaw_rad`, the short way."""
        left_rad = math.remainder(yaw_rad - self._yaw_rad, 2 * math.pi)
        step_rad = _YAW_RATE_RAD_S * dt_s
        self._yaw_rad = math.remainder(self._yaw_rad + clamp(left_rad, -step_rad, step_rad), 2 * math.pi)

    def _setpoint(self, *, lean_m_s2: tuple[float, float] | None = None) -> Setpoint:
        n, e, d = self._reference.position_m
        vn, ve, vd = self._reference.velocity_m_s
        return Setpoint(
            (n, e, d),
            (vn, ve, vd),
            self._yaw_rad,
            self._max_up_m_s,
            self._max_down_m_s,
            self._tilt_rad,
            lean_m_s2,
        )


class Hold(AutoTask):
    """Brake, then stay there."""

    def step(self, dt_s: float, estimate: Estimate, height_m: float) -> Setpoint:
        """The setpoint after `dt_s` [s]."""
        self._reference.step(dt_s, (0.0, 0.0, 0.0), estimate.position_m)
        return self._setpoint()


class Takeoff(AutoTask):
    """Climb straight up to a height. `is_done` within NAV_MC_ALT_RAD of it, where PX4 goes on to Hold."""

    def __init__(self, parameters: Parameters, estimate: Estimate, target_down_m: float) -> None:
        """Climb from where the vehicle is to `target_down_m` NED."""
        super().__init__(parameters, estimate)
        self.is_done = False
        self._target_down_m = target_down_m
        self._n, self._e = estimate.position_m[0], estimate.position_m[1]
        self._climb_m_s = max(0.0, -estimate.velocity_m_s[2])

    def step(self, dt_s: float, estimate: Estimate, height_m: float) -> Setpoint:
        """The setpoint after `dt_s` [s]."""
        left_m = estimate.position_m[2] - self._target_down_m
        self.is_done = abs(left_m) < self._parameters.get("NAV_MC_ALT_RAD")
        wanted_m_s = _speed_to(left_m, self._parameters.get("MPC_TKO_SPEED"), _APPROACH_M_S2)
        change = _TAKEOFF_ACCELERATION_M_S2 * dt_s
        self._climb_m_s = min(wanted_m_s, self._climb_m_s + change)
        velocity = (0.0, 0.0, -self._climb_m_s)
        position = (self._n, self._e, None)
        return Setpoint(position, velocity, self._yaw_rad, self._max_up_m_s, self._max_down_m_s, self._tilt_rad)

    def wait(self) -> None:
        """The vehicle does not climb yet."""
        self._climb_m_s = 0.0


class Land(AutoTask):
    """Descend, slower towards the ground, until disarmed: where the vehicle is, or on a spot (north, east) [m]."""

    def __init__(
        self,
        parameters: Parameters,
        estimate: Estimate,
        spot_m: tuple[float, float] | None = None,
        yaw_rad: float | None = None,
    ) -> None:
        """Start where the vehicle is; without a spot it brakes and comes straight down, without a yaw it keeps it."""
        super().__init__(parameters, estimate)
        self._spot_m = spot_m
        self._final_yaw_rad = self._yaw_rad if yaw_rad is None else yaw_rad

    @property
    def is_landing(self) -> bool:
        """Always: that is what it is for."""
        return True

    def step(self, dt_s: float, estimate: Estimate, height_m: float) -> Setpoint:
        """The setpoint after `dt_s` [s]."""
        get = self._parameters.get
        fast_m_s, slow_m_s = get("MPC_Z_V_AUTO_DN"), get("MPC_LAND_SPEED")
        high_m, low_m = get("MPC_LAND_ALT1"), get("MPC_LAND_ALT2")
        share = clamp((height_m - low_m) / max(high_m - low_m, 0.1), 0.0, 1.0)
        speed_m_s = slow_m_s + share * (fast_m_s - slow_m_s)
        if height_m < get("MPC_LAND_ALT3"):
            speed_m_s = get("MPC_LAND_CRWL")
            self._tilt_rad = math.radians(get("MPC_TILTMAX_LND"))
        self._turn(dt_s, self._final_yaw_rad)
        north_m_s = east_m_s = 0.0
        if self._spot_m is not None:
            n, e, _ = self._reference.position_m
            north_m_s, east_m_s = _velocity_to(self._spot_m[0] - n, self._spot_m[1] - e, 1.0, _APPROACH_M_S2)
        self._reference.step(dt_s, (north_m_s, east_m_s, speed_m_s), estimate.position_m)
        return self._setpoint()


class Descend(AutoTask):
    """Come down slowly where a mode needs sticks and there are none; level, and so with the wind, when blind."""

    def __init__(self, parameters: Parameters, estimate: Estimate, *, is_blind: bool = False) -> None:
        """`is_blind`: the horizontal position is not known."""
        super().__init__(parameters, estimate)
        self._is_blind = is_blind

    def step(self, dt_s: float, estimate: Estimate, height_m: float) -> Setpoint:
        """The setpoint after `dt_s` [s]."""
        self._reference.step(dt_s, (0.0, 0.0, _DESCEND_M_S), estimate.position_m)
        return self._setpoint(lean_m_s2=(0.0, 0.0) if self._is_blind else None)


class Return(AutoTask):
    """Climb if need be, fly home, turn as home was, descend and land there (PX4's rtl_direct)."""

    def __init__(self, parameters: Parameters, estimate: Estimate, home_m: Vector, home_yaw_rad: float) -> None:
        """Return to `home_m` NED [m] and its yaw [rad]; `return_height_m` over it is what PX4 announces."""
        super().__init__(parameters, estimate)
        self._home_m = home_m
        self._home_yaw_rad = home_yaw_rad
        n, e, d = estimate.position_m
        distance_m = math.hypot(n - home_m[0], e - home_m[1])
        self.return_height_m = max(_return_height_m(parameters, distance_m), home_m[2] - d)
        self._landing: Land | None = None
        self._has_climbed = False

    @property
    def is_landing(self) -> bool:
        """Whether the descent at home has begun."""
        return self._landing is not None

    def step(self, dt_s: float, estimate: Estimate, height_m: float) -> Setpoint:
        """The setpoint after `dt_s` [s]."""
        if self._landing is not None:
            return self._landing.step(dt_s, estimate, height_m)
        n, e, d = estimate.position_m
        distance_m = math.hypot(self._home_m[0] - n, self._home_m[1] - e)
        climb_m = self.return_height_m - (self._home_m[2] - d)
        radius_m = self._parameters.get("NAV_MC_ALT_RAD")
        self._has_climbed = self._has_climbed or climb_m < radius_m
        if self._has_climbed and distance_m < _ARRIVED_M:
            self._landing = Land(self._parameters, estimate, self._home_m[:2], self._home_yaw_rad)
            return self._landing.step(dt_s, estimate, height_m)
        if distance_m < self._parameters.get("RTL_MIN_DIST"):
            self._turn(dt_s, self._home_yaw_rad)
        limit_m_s = self._parameters.get("MPC_XY_CRUISE") if self._has_climbed else 0.0
        braking_m_s2 = 0.4 * self._parameters.get("MPC_ACC_HOR")
        reference_n, reference_e, _ = self._reference.position_m
        to_home_n, to_home_e = self._home_m[0] - reference_n, self._home_m[1] - reference_e
        north_m_s, east_m_s = _velocity_to(to_home_n, to_home_e, limit_m_s, braking_m_s2)
        up_m_s = _speed_to(climb_m, self._parameters.get("MPC_Z_V_AUTO_UP"), _APPROACH_M_S2)
        self._reference.step(dt_s, (north_m_s, east_m_s, -up_m_s), estimate.position_m)
        return self._setpoint()


def _return_height_m(parameters: Parameters, distance_m: float) -> float:
    """Height over home [m] at which to return from `distance_m`: a cone close by, RTL_RETURN_ALT farther out."""
    radius_m = parameters.get("NAV_ACC_RAD")
    if distance_m <= radius_m:
        return 2 * distance_m
    height_m = parameters.get("RTL_RETURN_ALT")
    cone_rad = math.radians(parameters.get("RTL_CONE_ANG"))
    if 0 < cone_rad < math.pi / 2 and distance_m <= parameters.get("RTL_MIN_DIST"):
        height_m = min(height_m, distance_m / math.tan(cone_rad))
    return max(height_m, 2 * radius_m)


class Offboard:
    """Hand an application's position setpoint to the controller as it is, without smoothing, as PX4 does."""

    def __init__(self, parameters: Parameters, target_m: Vector, yaw_rad: float) -> None:
        """Aim at `target_m` NED [m] and `yaw_rad`; `aim` moves the target."""
        self._limits = (
            parameters.get("MPC_Z_VEL_MAX_UP"),
            parameters.get("MPC_Z_VEL_MAX_DN"),
            math.radians(parameters.get("MPC_TILTMAX_AIR")),
        )
        self.aim(target_m, yaw_rad)

    @property
    def is_landing(self) -> bool:
        """Never: where it goes is the application's business."""
        return False

    def aim(self, target_m: Vector, yaw_rad: float) -> None:
        """Take the application's newest setpoint."""
        self._setpoint = Setpoint(target_m, (0.0, 0.0, 0.0), yaw_rad, *self._limits)

    def step(self, dt_s: float, estimate: Estimate, height_m: float) -> Setpoint:
        """The setpoint after `dt_s` [s]."""
        return self._setpoint
