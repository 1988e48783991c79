"""What the autopilot believes about its motion: the truth plus biases and slowly varying errors, from a seed."""

import math
import random

from sitl.control import Estimate, multiply, quaternion_of
from sitl.vehicle import Quaternion, Vector, Vehicle

# Standard deviation and correlation time of each error, of the size that a PX4 v1.16 with GPS shows standing and
# hovering: decimetres that wander over tens of seconds.
_POSITION_M = (0.15, 0.15, 0.20)
_POSITION_S = 15.0
_POSITION_SMOOTHING_S = 1.0
_VELOCITY_M_S = (0.06, 0.06, 0.04)
_VELOCITY_S = 1.5
_ATTITUDE_RAD = math.radians(0.2)
_ATTITUDE_S = 3.0
# Biases that stay for a flight: how well an accelerometer is levelled on its mount, and a compass calibrated.
_LEVEL_BIAS_RAD = math.radians(0.3)
_COMPASS_BIAS_RAD = math.radians(1.5)
_RATE_RAD_S = 0.01
_ACCELERATION_M_S2 = 0.03  # what dead reckoning without GPS errs by


class Estimator:
    """Adds errors to the truth. Positions are NED from where the vehicle stood at boot, as the local frame has it."""

    def __init__(self, seed: int, *, is_noisy: bool = True) -> None:
        """Draw the errors from `seed`; without noise the estimate is the truth."""
        self._draw = random.Random(f"estimator {seed}")
        self._is_noisy = is_noisy
        self._position_raw = [0.0, 0.0, 0.0]
        self._position = [0.0, 0.0, 0.0]
        self._velocity = [0.0, 0.0, 0.0]
        self._attitude = [0.0, 0.0, 0.0]
        biases = random.Random(f"estimator biases {seed}")
        self._level_bias_rad = (biases.gauss(0.0, _LEVEL_BIAS_RAD), biases.gauss(0.0, _LEVEL_BIAS_RAD))
        self._compass_bias = quaternion_of(0.0, 0.0, biases.gauss(0.0, _COMPASS_BIAS_RAD))
        self._lean_m_s2 = (biases.gauss(0.0, _ACCELERATION_M_S2), biases.gauss(0.0, _ACCELERATION_M_S2))
        self._drift_m_s = self._drift_m = (0.0, 0.0)

    def step(self, dt_s: float, vehicle: Vehicle, *, has_gps: bool = True) -> Estimate:
        """The estimate after `dt_s` [s]. Without GPS its position drifts away; with it again, it jumps back."""
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
        gauss = self._draw.gauss
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
        p, q, r = vehicle.rates_rad_s
        return Estimate(
            _sum(vehicle.position_m, self._position, self._drift_m),
            _sum(vehicle.velocity_m_s, self._velocity, self._drift_m_s),
            vehicle.acceleration_m_s2,
            self._turned(vehicle.quaternion),
            (p + gauss(0.0, _RATE_RAD_S), q + gauss(0.0, _RATE_RAD_S), r + gauss(0.0, _RATE_RAD_S)),
        )

    def _turned(self, quaternion: Quaternion) -> Quaternion:
        """The attitude with its errors: the compass errs about the vertical, the level and the noise in the body."""
        roll_rad, pitch_rad, yaw_rad = self._attitude
        roll_bias_rad, pitch_bias_rad = self._level_bias_rad
        in_body = quaternion_of(roll_rad + roll_bias_rad, pitch_rad + pitch_bias_rad, yaw_rad)
        return multiply(multiply(self._compass_bias, quaternion), in_body)


def _sum(truth: Vector, error: list[float], drift: tuple[float, float]) -> Vector:
    return (truth[0] + error[0] + drift[0], truth[1] + error[1] + drift[1], truth[2] + error[2])
