"""What the autopilot believes about its motion: the truth plus biases and slowly varying errors, from a seed.

| error | standard deviation | correlation | after |
| --- | --- | --- | --- |
| position (GPS, inertial) | 0.15 m level, 0.20 m up | 15 s, smoothed over 1 s | PX4 v1.16 standing and hovering |
| velocity | 0.06 m/s level, 0.04 m/s up | 1.5 s | the same |
| height (barometer) | 0.3 m, from 0 at boot | 10 min | its warming, and weather: 1 hPa an hour is 0.14 m a minute |
| height (wind on the case) | 0.05 of the dynamic pressure: 0.16 m at 8 m/s | 2 s | EKF2_PCOEF, covered sensor |
| level | 0.3 degrees, stays | | how well a person levels an accelerometer on its mount |
| compass | 1.5 degrees, stays | | how well a person calibrates it, and declination |
| compass deviation | 1.2 degrees once a turn, 0.4 twice | | iron left over after the calibration, hard and soft |
| attitude | 0.2 degrees | 3 s | PX4 v1.16 standing |
| rates | 0.01 rad/s | none | a MEMS gyro behind PX4's low-pass, with the propellers' shaking |
| acceleration | 0.05 m/s2 | none | the same of an accelerometer |
"""

import math
import random

from sitl.control import Estimate, multiply, quaternion_of
from sitl.vehicle import GRAVITY_M_S2, Quaternion, Vector, Vehicle, euler_of

_POSITION_M = (0.15, 0.15, 0.20)
_POSITION_S = 15.0
_POSITION_SMOOTHING_S = 1.0
_VELOCITY_M_S = (0.06, 0.06, 0.04)
_VELOCITY_S = 1.5
_BAROMETER_M = 0.3
_BAROMETER_S = 600.0
_PRESSURE_SHARE = 0.05
_PRESSURE_S = 2.0
_ATTITUDE_RAD = math.radians(0.2)
_ATTITUDE_S = 3.0
_LEVEL_BIAS_RAD = math.radians(0.3)
_COMPASS_BIAS_RAD = math.radians(1.5)
_DEVIATION_RAD = (math.radians(1.2), math.radians(0.4))
_RATE_RAD_S = 0.01
_ACCELERATION_NOISE_M_S2 = 0.05
_ACCELERATION_M_S2 = 0.03  # what dead reckoning without GPS errs by


class Estimator:
    """Adds errors to the truth. Positions are NED from where the vehicle stood at boot, as the local frame has it.

    `barometer_m` is the drift that the height has now, upwards positive.
    """

    def __init__(self, seed: int, *, is_noisy: bool = True) -> None:
        """Draw the errors from `seed`; without noise the estimate is the truth."""
        self._draw = random.Random(f"estimator {seed}")
        self._draw_more = random.Random(f"barometer and accelerometer {seed}")
        self._is_noisy = is_noisy
        self._position_raw = [0.0, 0.0, 0.0]
        self._position = [0.0, 0.0, 0.0]
        self._velocity = [0.0, 0.0, 0.0]
        self._attitude = [0.0, 0.0, 0.0]
        biases = random.Random(f"estimator biases {seed}")
        self._level_bias_rad = (biases.gauss(0.0, _LEVEL_BIAS_RAD), biases.gauss(0.0, _LEVEL_BIAS_RAD))
        self._compass_bias_rad = biases.gauss(0.0, _COMPASS_BIAS_RAD)
        self._lean_m_s2 = (biases.gauss(0.0, _ACCELERATION_M_S2), biases.gauss(0.0, _ACCELERATION_M_S2))
        self._deviation_phases_rad = (biases.uniform(-math.pi, math.pi), biases.uniform(-math.pi, math.pi))
        self._drift_m_s = self._drift_m = (0.0, 0.0)
        self.barometer_m = self._pressure_m = 0.0

    def step(self, dt_s: float, vehicle: Vehicle, *, has_gps: bool = True, airspeed_m_s: float = 0.0) -> Estimate:
        """The estimate after `dt_s` [s], of a vehicle that the air passes at `airspeed_m_s`.

        Without GPS its position drifts away; with it again, it jumps back.
        """
        if has_gps:
            self._drift_m_s = self._drift_m = (0.0, 0.0)
        elif self._is_noisy:
            vn, ve = self._drift_m_s
            vn, ve = vn + self._lean_m_s2[0] * dt_s, ve + self._lean_m_s2[1] * dt_s
            self._drift_m_s = (vn, ve)
            self._drift_m = (self._drift_m[0] + vn * dt_s, self._drift_m[1] + ve * dt_s)
        if not self._is_noisy:
            return Estimate(
                vehicle.position_m,
                vehicle.velocity_m_s,
                vehicle.acceleration_m_s2,
                vehicle.quaternion,
                vehicle.rates_rad_s,
            )
        gauss, more = self._draw.gauss, self._draw_more.gauss
        position_drive = math.sqrt(2 * dt_s / _POSITION_S)
        velocity_drive = math.sqrt(2 * dt_s / _VELOCITY_S)
        attitude_drive = _ATTITUDE_RAD * math.sqrt(2 * dt_s / _ATTITUDE_S)
        for axis in range(3):
            raw = self._position_raw
            raw[axis] += -raw[axis] * dt_s / _POSITION_S + _POSITION_M[axis] * position_drive * gauss(0.0, 1.0)
            self._position[axis] += (raw[axis] - self._position[axis]) * dt_s / _POSITION_SMOOTHING_S
            velocity = self._velocity
            velocity[axis] += -velocity[axis] * dt_s / _VELOCITY_S
            velocity[axis] += _VELOCITY_M_S[axis] * velocity_drive * gauss(0.0, 1.0)
            self._attitude[axis] += -self._attitude[axis] * dt_s / _ATTITUDE_S + attitude_drive * gauss(0.0, 1.0)
        barometer_drive = _BAROMETER_M * math.sqrt(2 * dt_s / _BAROMETER_S)
        self.barometer_m += -self.barometer_m * dt_s / _BAROMETER_S + barometer_drive * more(0.0, 1.0)
        # Air that passes a case sucks at it: the pressure falls, and the height seems greater.
        suction_m = _PRESSURE_SHARE * airspeed_m_s * airspeed_m_s / (2 * GRAVITY_M_S2)
        self._pressure_m += (suction_m - self._pressure_m) * dt_s / (_PRESSURE_S + dt_s)
        n, e, d = _sum(vehicle.position_m, self._position, self._drift_m)
        an, ae, ad = vehicle.acceleration_m_s2
        p, q, r = vehicle.rates_rad_s
        noise = _ACCELERATION_NOISE_M_S2
        return Estimate(
            (n, e, d - self.barometer_m - self._pressure_m),
            _sum(vehicle.velocity_m_s, self._velocity, self._drift_m_s),
            (an + more(0.0, noise), ae + more(0.0, noise), ad + more(0.0, noise)),
            self._turned(vehicle.quaternion),
            (p + gauss(0.0, _RATE_RAD_S), q + gauss(0.0, _RATE_RAD_S), r + gauss(0.0, _RATE_RAD_S)),
        )

    def _turned(self, quaternion: Quaternion) -> Quaternion:
        """The attitude with its errors: the compass errs about the vertical, the level and the noise in the body."""
        roll_rad, pitch_rad, yaw_rad = self._attitude
        roll_bias_rad, pitch_bias_rad = self._level_bias_rad
        in_body = quaternion_of(roll_rad + roll_bias_rad, pitch_rad + pitch_bias_rad, yaw_rad)
        error_rad = self._compass_error_rad(euler_of(quaternion)[2])
        compass = (math.cos(error_rad / 2), 0.0, 0.0, math.sin(error_rad / 2))
        return multiply(multiply(compass, quaternion), in_body)

    def _compass_error_rad(self, yaw_rad: float) -> float:
        """The bias, and the deviation of this heading."""
        (once_rad, twice_rad), (once, twice) = _DEVIATION_RAD, self._deviation_phases_rad
        deviation_rad = once_rad * math.sin(yaw_rad + once) + twice_rad * math.sin(2 * yaw_rad + twice)
        return self._compass_bias_rad + deviation_rad


def _sum(truth: Vector, error: list[float], drift: tuple[float, float]) -> Vector:
    return (truth[0] + error[0] + drift[0], truth[1] + error[1] + drift[1], truth[2] + error[2])
