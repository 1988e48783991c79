"""A multirotor's rigid body: thrust and torques in, motion out.

World NED, body FRD, quaternion (w, x, y, z) ned_from_frd. Plain floats: a step has to take tens of microseconds.
"""

import math
from collections.abc import Callable

from sitl.airframes import GRAVITY_M_S2, Airframe

__all__ = ["GRAVITY_M_S2", "Airframe", "GroundHeight", "Quaternion", "Vector", "Vehicle", "euler_of", "flat_ground"]

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
GroundHeight = Callable[[float, float], float]
"""(north, east) [m] -> down [m] of the ground."""

_LEFT_SPEED = 0.2  # of the speed, after a crash
_TUMBLE_RAD_S = (4.0, 3.0, 1.0)


def flat_ground(north_m: float, east_m: float) -> float:
    """Ground at down = 0 everywhere [m]."""
    return 0.0


class Vehicle:
    """The moving body. `step` is deterministic: the same inputs give the same motion.

    Attributes are the true state: position NED [m], velocity NED [m/s], acceleration NED [m/s2], `quaternion`
    ned_from_frd, `rates_rad_s` body FRD, `thrust_n` now, `is_on_ground`, `is_broken`. Set `supply`, the share of the
    full thrust that the battery's voltage leaves (0 to 1).
    """

    __slots__ = (
        "_shares",
        "_torque_n_m",
        "_weakness",
        "acceleration_m_s2",
        "airframe",
        "ground",
        "is_broken",
        "is_on_ground",
        "position_m",
        "quaternion",
        "rates_rad_s",
        "supply",
        "thrust_n",
        "velocity_m_s",
    )

    def __init__(
        self, airframe: Airframe | None = None, *, yaw_rad: float = 0.0, ground: GroundHeight = flat_ground
    ) -> None:
        """Stand on the ground at the world's origin, heading `yaw_rad`."""
        self.airframe = airframe or Airframe()
        self.ground = ground
        self.position_m: Vector = (0.0, 0.0, ground(0.0, 0.0))
        self.velocity_m_s: Vector = (0.0, 0.0, 0.0)
        self.acceleration_m_s2: Vector = (0.0, 0.0, 0.0)
        self.quaternion: Quaternion = (math.cos(yaw_rad / 2), 0.0, 0.0, math.sin(yaw_rad / 2))
        self.rates_rad_s: Vector = (0.0, 0.0, 0.0)
        self.thrust_n = 0.0
        self._torque_n_m: Vector = (0.0, 0.0, 0.0)
        self.is_on_ground = True
        self.is_broken = False
        self.supply = 1.0
        self._shares = (1.0,) * len(self.airframe.rotors)
        self._weakness = (
            0.0,
            0.0,
            0.0,
            0.0,
        )  # of the thrust: the share lost, and the torque that makes about x, y, z [m]

    def weaken(self, rotor: int, share: float) -> None:
        """Let one of the airframe's rotors give only a `share` of what is asked of it, 0 to 1: 1 mends it.

        Each rotor keeps its own share until it is told another, so that several may be weak at once. A worn bearing, a
        chipped propeller, a speed controller that has lost step: the autopilot does not know.
        """
        rotors = self.airframe.rotors
        shares = list(self._shares)
        shares[rotor] = share
        self._shares = tuple(shares)
        losses = [(1.0 - each) / len(rotors) for each in self._shares]
        self._weakness = (
            sum(losses),
            sum(loss * right_m for loss, (_, right_m, _) in zip(losses, rotors, strict=True)),
            -sum(loss * forward_m for loss, (forward_m, _, _) in zip(losses, rotors, strict=True)),
            -sum(loss * drag_m for loss, (_, _, drag_m) in zip(losses, rotors, strict=True)),
        )

    @property
    def euler_rad(self) -> Vector:
        """Roll, pitch, yaw [rad]."""
        return euler_of(self.quaternion)

    @property
    def height_m(self) -> float:
        """Height over the ground below [m]."""
        return self.ground(self.position_m[0], self.position_m[1]) - self.position_m[2]

    @property
    def power_w(self) -> float:
        """Electrical power that the motors draw: T^1.5 / sqrt(2 rho A) over the figure of merit [W]."""
        ideal_w: float = self.thrust_n**1.5 / math.sqrt(2 * 1.225 * self.airframe.disk_area_m2)
        return ideal_w / self.airframe.figure_of_merit

    def step(self, dt_s: float, thrust: float, torque: Vector, wind_m_s: Vector) -> None:
        """Move on by `dt_s` [s] (semi-implicit Euler; 4 ms is small against every time constant here).

        `thrust` 0 to 1 and `torque` -1 to 1 about body x, y, z are what the autopilot asks of the motors; they are
        clipped to what the motors can give and lag behind. `wind_m_s` is the air's velocity NED.
        """
        frame = self.airframe
        if self.is_broken:
            thrust, torque = 0.0, (0.0, 0.0, 0.0)
        wanted_n = min(max(thrust, 0.0), self.supply) * frame.max_thrust_n
        lag_s = frame.motor_time_constant_s
        if wanted_n < self.thrust_n and frame.motor_slowing_s is not None:
            lag_s = frame.motor_slowing_s
        lag = dt_s / (lag_s + dt_s)
        self.thrust_n += lag * (wanted_n - self.thrust_n)
        # Torque comes from thrust differences: near zero and near full thrust none is left.
        share = self.thrust_n / frame.max_thrust_n
        authority = max(0.0, min(1.0, 4.0 * share, 4.0 * (1.02 * self.supply - share)))
        tx, ty, tz = self._torque_n_m
        mx, my, mz = frame.max_torque_n_m
        tx += lag * (min(max(torque[0], -authority), authority) * mx - tx)
        ty += lag * (min(max(torque[1], -authority), authority) * my - ty)
        tz += lag * (min(max(torque[2], -authority), authority) * mz - tz)
        self._torque_n_m = (tx, ty, tz)
        lost, lost_x_m, lost_y_m, lost_z_m = self._weakness
        thrust_n = self.thrust_n
        tx, ty, tz = tx + thrust_n * lost_x_m, ty + thrust_n * lost_y_m, tz + thrust_n * lost_z_m

        w, x, y, z = self.quaternion
        # Third column of the rotation matrix: body z (down) in NED.
        zn, ze, zd = 2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)
        vn, ve, vd = self.velocity_m_s
        an, ae, ad = vn - wind_m_s[0], ve - wind_m_s[1], vd - wind_m_s[2]
        drag = frame.linear_drag_1_s + frame.quadratic_drag_1_m * math.sqrt(an * an + ae * ae + ad * ad)
        lift = (1.0 - lost) * self.thrust_n / frame.mass_kg
        acceleration = (-drag * an - lift * zn, -drag * ae - lift * ze, -drag * ad - lift * zd + GRAVITY_M_S2)
        n, e, d = self.position_m
        ground_m = self.ground(n, e)
        if d >= ground_m and acceleration[2] >= 0.0:
            self._rest(ground_m)
            return
        vn, ve, vd = vn + acceleration[0] * dt_s, ve + acceleration[1] * dt_s, vd + acceleration[2] * dt_s
        n, e, d = n + vn * dt_s, e + ve * dt_s, d + vd * dt_s
        ground_m = self.ground(n, e)
        self.is_on_ground = d >= ground_m
        if self.is_on_ground:  # however hard the motors pull, the ground is not passed
            d, vd = ground_m, min(vd, 0.0)
        self.acceleration_m_s2 = acceleration
        self.velocity_m_s = (vn, ve, vd)
        self.position_m = (n, e, d)

        p, q, r = self.rates_rad_s
        ix, iy, iz = frame.inertia_kg_m2
        dx, dy, dz = frame.rotational_drag_n_m_s
        p += dt_s * (tx - dx * p - (iz - iy) * q * r) / ix
        q += dt_s * (ty - dy * q - (ix - iz) * r * p) / iy
        r += dt_s * (tz - dz * r - (iy - ix) * p * q) / iz
        self.rates_rad_s = (p, q, r)
        half = 0.5 * dt_s
        w, x, y, z = (
            w - half * (x * p + y * q + z * r),
            x + half * (w * p + y * r - z * q),
            y + half * (w * q - x * r + z * p),
            z + half * (w * r + x * q - y * p),
        )
        norm = 1.0 / math.sqrt(w * w + x * x + y * y + z * z)
        self.quaternion = (w * norm, x * norm, y * norm, z * norm)

    def crash(self) -> None:
        """It has hit something: it loses its way and its propellers, and falls tumbling. Nothing mends it."""
        self.is_broken = True
        self.thrust_n = 0.0
        self._torque_n_m = (0.0, 0.0, 0.0)
        vn, ve, vd = self.velocity_m_s
        self.velocity_m_s = (_LEFT_SPEED * vn, _LEFT_SPEED * ve, _LEFT_SPEED * vd)
        self.rates_rad_s = _TUMBLE_RAD_S

    def _rest(self, ground_m: float) -> None:
        """Stand on the gear: no motion, level, heading kept. Broken, it lies as it fell."""
        yaw_rad = self.euler_rad[2]
        self.position_m = (self.position_m[0], self.position_m[1], ground_m)
        self.velocity_m_s = self.acceleration_m_s2 = self.rates_rad_s = (0.0, 0.0, 0.0)
        self._torque_n_m = (0.0, 0.0, 0.0)
        if not self.is_broken:
            self.quaternion = (math.cos(yaw_rad / 2), 0.0, 0.0, math.sin(yaw_rad / 2))
        self.is_on_ground = True


def euler_of(quaternion: Quaternion) -> Vector:
    """Roll, pitch, yaw [rad] (rotations about z, then y, then x) of a unit quaternion ned_from_frd."""
    w, x, y, z = quaternion
    return (
        math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
        math.asin(min(1.0, max(-1.0, 2 * (w * y - z * x)))),
        math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)),
    )
