"""The autopilot's cascade: position -> velocity -> thrust vector and yaw -> attitude -> body rates -> torque.

The structure, names and gains are PX4 v1.16's (mc_pos_control, mc_att_control, mc_rate_control), so that the simulated
vehicle answers a setpoint as a real one does. NED world, FRD body, quaternion (w, x, y, z) ned_from_frd.
"""

import math
from dataclasses import dataclass

from sitl.parameters import Parameters
from sitl.vehicle import GRAVITY_M_S2, Quaternion, Vector

_HORIZONTAL_THRUST_MARGIN = 0.3
_MIN_YAW_WEIGHT = 1e-4  # below it yaw has no weight at all, and its gain is not scaled up
_YAW_TORQUE_LAG_S = 0.04  # MC_YAW_TQ_CUTOFF's low-pass: yaw is the axis that motors turn by their drag


@dataclass(frozen=True, slots=True)
class Setpoint:
    """What a flight task asks for: a position NED [m] (None: only velocity), a velocity NED [m/s] added to it, a yaw.

    `max_*` bound the resulting velocity [m/s], `max_tilt_rad` the thrust vector's angle from the vertical.
    `lean_m_s2` (north, east) is a horizontal acceleration to lean for instead, whatever the position and velocity are.
    """

    position_m: tuple[float | None, float | None, float | None]
    velocity_m_s: Vector
    yaw_rad: float
    max_up_m_s: float
    max_down_m_s: float
    max_tilt_rad: float
    lean_m_s2: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True)
class Estimate:
    """What the estimator believes: position NED [m], velocity NED [m/s], acceleration NED [m/s2], attitude, rates."""

    position_m: Vector
    velocity_m_s: Vector
    acceleration_m_s2: Vector
    quaternion: Quaternion
    rates_rad_s: Vector


def clamp(value: float, low: float, high: float) -> float:
    """`value`, but at least `low` and at most `high`."""
    return low if value < low else high if value > high else value


class PositionControl:
    """Position P, velocity PID with integral and anti-windup, and the thrust vector that gives the acceleration."""

    def __init__(self, parameters: Parameters, hover_thrust: float) -> None:
        """Take the gains of `parameters`; `hover_thrust` (0 to 1) is what PX4's hover thrust estimator finds."""
        self._hover_thrust = hover_thrust
        self._integral: Vector = (0.0, 0.0, 0.0)
        self.velocity_setpoint_m_s: Vector = (0.0, 0.0, 0.0)
        self.tune(parameters)

    def tune(self, parameters: Parameters) -> None:
        """Take other gains, and keep the integrals."""
        get = parameters.get
        self._p_xy, self._p_z = get("MPC_XY_P"), get("MPC_Z_P")
        self._gains_xy = (get("MPC_XY_VEL_P_ACC"), get("MPC_XY_VEL_I_ACC"), get("MPC_XY_VEL_D_ACC"))
        self._gains_z = (get("MPC_Z_VEL_P_ACC"), get("MPC_Z_VEL_I_ACC"), get("MPC_Z_VEL_D_ACC"))
        self._max_xy_m_s = get("MPC_XY_VEL_MAX")
        self._thrust_min, self._thrust_max = get("MPC_THR_MIN"), get("MPC_THR_MAX")

    def reset(self) -> None:
        """Forget the integrals, as on the ground."""
        self._integral = (0.0, 0.0, 0.0)

    def step(self, dt_s: float, setpoint: Setpoint, estimate: Estimate) -> Vector:
        """The thrust vector NED, each 0 to 1 of the full thrust, after `dt_s` [s] (PositionControl.cpp)."""
        vn, ve, vd = self._velocity_setpoint(setpoint, estimate.position_m)
        self.velocity_setpoint_m_s = (vn, ve, vd)
        velocity, acceleration = estimate.velocity_m_s, estimate.acceleration_m_s2
        p, i, d = self._gains_xy
        pz, iz, dz = self._gains_z
        integral_n, integral_e, integral_d = self._integral
        error_n, error_e, error_d = vn - velocity[0], ve - velocity[1], vd - velocity[2]
        an = p * error_n + integral_n - d * acceleration[0]
        ae = p * error_e + integral_e - d * acceleration[1]
        ad = pz * error_d + integral_d - dz * acceleration[2]
        if setpoint.lean_m_s2 is not None:
            an, ae = setpoint.lean_m_s2
            error_n = error_e = 0.0

        # The body's z axis points against the wanted specific force; PX4 decouples it from the vertical acceleration.
        horizontal = math.hypot(an, ae)
        tilt_rad = min(math.atan2(horizontal, GRAVITY_M_S2), setpoint.max_tilt_rad)
        scale = math.sin(tilt_rad) / horizontal if horizontal > 1e-9 else 0.0
        up_n, up_e, up_d = an * scale, ae * scale, -math.cos(tilt_rad)
        vertical = ad * self._hover_thrust / GRAVITY_M_S2 - self._hover_thrust
        collective = min(vertical / -up_d, -self._thrust_min)
        thrust_n, thrust_e, thrust_d = -up_n * collective, -up_e * collective, -up_d * collective

        # Vertical thrust has priority, but a margin is left for the horizontal.
        thrust_h = math.hypot(thrust_n, thrust_e)
        thrust_h_kept = min(thrust_h, _HORIZONTAL_THRUST_MARGIN)
        vertical_max = math.sqrt(max(self._thrust_max**2 - thrust_h_kept**2, 0.0))
        saturated_up = -thrust_d > vertical_max
        thrust_d = max(thrust_d, -vertical_max)
        horizontal_max = math.sqrt(max(self._thrust_max**2 - thrust_d**2, 0.0))
        if thrust_h > horizontal_max:
            thrust_n, thrust_e = thrust_n * horizontal_max / thrust_h, thrust_e * horizontal_max / thrust_h

        # Anti-windup: vertical integration stops in saturation, horizontal tracks the acceleration really produced.
        saturated_down = thrust_d >= -self._thrust_min
        if (saturated_up and error_d < 0.0) or (saturated_down and error_d > 0.0):
            error_d = 0.0
        produced_n = thrust_n * GRAVITY_M_S2 / self._hover_thrust
        produced_e = thrust_e * GRAVITY_M_S2 / self._hover_thrust
        is_limited = an * an + ae * ae > produced_n * produced_n + produced_e * produced_e
        if is_limited and setpoint.lean_m_s2 is None:
            gain = 2.0 / p
            error_n -= gain * (an - produced_n)
            error_e -= gain * (ae - produced_e)
        self._integral = (
            integral_n + i * error_n * dt_s,
            integral_e + i * error_e * dt_s,
            clamp(integral_d + iz * error_d * dt_s, -GRAVITY_M_S2, GRAVITY_M_S2),
        )
        return (thrust_n, thrust_e, thrust_d)

    def _velocity_setpoint(self, setpoint: Setpoint, position_m: Vector) -> Vector:
        """Position error times P plus the feed-forward, within the limits; the position's part has priority."""
        wanted = []
        for target, actual, gain in zip(
            setpoint.position_m, position_m, (self._p_xy, self._p_xy, self._p_z), strict=True
        ):
            wanted.append(0.0 if target is None else gain * (target - actual))
        n = wanted[0] + setpoint.velocity_m_s[0]
        e = wanted[1] + setpoint.velocity_m_s[1]
        speed = math.hypot(n, e)
        if speed > self._max_xy_m_s:
            n, e = n * self._max_xy_m_s / speed, e * self._max_xy_m_s / speed
        return (n, e, clamp(wanted[2] + setpoint.velocity_m_s[2], -setpoint.max_up_m_s, setpoint.max_down_m_s))


def attitude_of(thrust: Vector, yaw_rad: float) -> Quaternion:
    """The attitude ned_from_frd whose body z is against `thrust` (NED) and whose yaw is `yaw_rad`."""
    norm = math.sqrt(thrust[0] ** 2 + thrust[1] ** 2 + thrust[2] ** 2)
    zn, ze, zd = (-thrust[0] / norm, -thrust[1] / norm, -thrust[2] / norm) if norm > 1e-6 else (0.0, 0.0, 1.0)
    # Seen from the heading, body z is (cos roll sin pitch, -sin roll, cos roll cos pitch).
    cy, sy = math.cos(yaw_rad), math.sin(yaw_rad)
    roll_rad = -math.asin(clamp(cy * ze - sy * zn, -1.0, 1.0))
    pitch_rad = math.atan2(cy * zn + sy * ze, zd)
    return quaternion_of(roll_rad, pitch_rad, yaw_rad)


def quaternion_of(roll_rad: float, pitch_rad: float, yaw_rad: float) -> Quaternion:
    """The quaternion ned_from_frd of rotations about z by yaw, then y by pitch, then x by roll [rad]."""
    cr, sr = math.cos(roll_rad / 2), math.sin(roll_rad / 2)
    cp, sp = math.cos(pitch_rad / 2), math.sin(pitch_rad / 2)
    cy, sy = math.cos(yaw_rad / 2), math.sin(yaw_rad / 2)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


class AttitudeControl:
    """Attitude P and rate PID: attitude setpoint in, normalised torque out (AttitudeControl.cpp, RateControl.cpp)."""

    def __init__(self, parameters: Parameters) -> None:
        """Take the gains of `parameters`."""
        self._integral = [0.0, 0.0, 0.0]
        self._last_rates_rad_s: Vector = (0.0, 0.0, 0.0)
        self._yaw_torque = 0.0
        self.tune(parameters)

    def tune(self, parameters: Parameters) -> None:
        """Take other gains, and keep the integrals."""
        get = parameters.get
        self._yaw_weight = get("MC_YAW_WEIGHT")
        yaw_scale = 1 / self._yaw_weight if self._yaw_weight > _MIN_YAW_WEIGHT else 1.0
        self._p_attitude = (get("MC_ROLL_P"), get("MC_PITCH_P"), get("MC_YAW_P") * yaw_scale)
        self._max_rates_rad_s = tuple(math.radians(get(f"MC_{axis}RATE_MAX")) for axis in ("ROLL", "PITCH", "YAW"))
        self._p = (get("MC_ROLLRATE_P"), get("MC_PITCHRATE_P"), get("MC_YAWRATE_P"))
        self._i = (get("MC_ROLLRATE_I"), get("MC_PITCHRATE_I"), get("MC_YAWRATE_I"))
        self._d = (get("MC_ROLLRATE_D"), get("MC_PITCHRATE_D"), 0.0)

    def reset(self) -> None:
        """Forget the integrals, as on the ground."""
        self._integral = [0.0, 0.0, 0.0]
        self._last_rates_rad_s = (0.0, 0.0, 0.0)
        self._yaw_torque = 0.0

    def rates_setpoint_rad_s(self, wanted: Quaternion, actual: Quaternion) -> Vector:
        """Body rates FRD [rad/s] that turn `actual` to `wanted`, the thrust direction first, yaw by its weight."""
        # The error splits into a tilt that aligns body z and a yaw about it; scaling the latter slows yaw down.
        w, x, y, z = multiply(_conjugate(actual), wanted)
        norm = math.hypot(w, z)
        if norm < 1e-5:
            tilt, cos_half, sin_half = (w, x, y, z), 1.0, 0.0
        else:
            cos_half, sin_half = w / norm, z / norm
            tilt = multiply((w, x, y, z), (cos_half, 0.0, 0.0, -sin_half))
        if cos_half < 0.0:
            cos_half, sin_half = -cos_half, -sin_half
        half_rad = self._yaw_weight * math.atan2(sin_half, cos_half)
        ew, ex, ey, ez = multiply(tilt, (math.cos(half_rad), 0.0, 0.0, math.sin(half_rad)))
        sign = 2.0 if ew >= 0.0 else -2.0
        px, py, pz = self._p_attitude
        mx, my, mz = self._max_rates_rad_s
        return (
            clamp(px * sign * ex, -mx, mx),
            clamp(py * sign * ey, -my, my),
            clamp(pz * sign * ez, -mz, mz),
        )

    def step(self, dt_s: float, wanted: Quaternion, actual: Quaternion, rates_rad_s: Vector) -> Vector:
        """Torque about body x, y, z, -1 to 1, after `dt_s` [s]."""
        rates = self.rates_setpoint_rad_s(wanted, actual)
        torque = [0.0, 0.0, 0.0]
        for axis in range(3):
            error = rates[axis] - rates_rad_s[axis]
            derivative = (rates_rad_s[axis] - self._last_rates_rad_s[axis]) / dt_s
            torque[axis] = self._p[axis] * error + self._integral[axis] - self._d[axis] * derivative
            # PX4 lowers the integral's gain for large errors, so that flips do not wind it up.
            factor = max(0.0, 1.0 - (error / math.radians(400.0)) ** 2)
            if abs(torque[axis]) < 1.0 or error * torque[axis] < 0.0:
                self._integral[axis] = clamp(self._integral[axis] + factor * self._i[axis] * error * dt_s, -0.3, 0.3)
        self._last_rates_rad_s = rates_rad_s
        self._yaw_torque += dt_s / (_YAW_TORQUE_LAG_S + dt_s) * (torque[2] - self._yaw_torque)
        return (clamp(torque[0], -1.0, 1.0), clamp(torque[1], -1.0, 1.0), clamp(self._yaw_torque, -1.0, 1.0))


def _conjugate(q: Quaternion) -> Quaternion:
    return (q[0], -q[1], -q[2], -q[3])


def multiply(a: Quaternion, b: Quaternion) -> Quaternion:
    """The rotation `b`, then `a`: target_from_middle times middle_from_source."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )
