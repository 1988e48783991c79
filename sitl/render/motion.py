"""A camera that moves while it takes a picture: where it is at each moment, and the shutter's times."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.clock import NS_PER_S
from sitl.pose import Pose

_LONGEST_STEP_S = 0.5

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class Motion:
    """A pose, and how it changes: velocity [m/s] NED and body rates [rad/s] FRD, both constant for the short while."""

    pose: Pose
    velocity_ned_m_s: Vector = (0.0, 0.0, 0.0)
    rates_frd_rad_s: Vector = (0.0, 0.0, 0.0)

    @property
    def is_still(self) -> bool:
        """Whether nothing moves."""
        return not any(self.velocity_ned_m_s) and not any(self.rates_frd_rad_s)

    def pose_at(self, dt_s: float) -> Pose:
        """The pose `dt_s` [s] later; before, where that is negative."""
        pose, (north, east, down) = self.pose, self.velocity_ned_m_s
        return Pose(
            pose.t_ns + round(dt_s * NS_PER_S),
            pose.north_m + dt_s * north,
            pose.east_m + dt_s * east,
            pose.down_m + dt_s * down,
            _turned(pose.quaternion, self.rates_frd_rad_s, dt_s),
        )


@dataclass(frozen=True, slots=True)
class Shutter:
    """When the rows of a picture are exposed.

    `exposure_s` is how long each row is, None for as long as the automatic chooses. `readout_s` is the time from the
    first row's exposure to the last one's: 0 for a global shutter, about 0.02 for a rolling one. The frame's time is
    the middle of the middle row's exposure. Raises ValueError for times below 0.
    """

    exposure_s: float | None = None
    readout_s: float = 0.0

    def __post_init__(self) -> None:
        if (self.exposure_s is not None and not self.exposure_s > 0.0) or not self.readout_s >= 0.0:
            raise ValueError("A shutter's exposure is longer than 0 s, and its readout no shorter.")

    def row_s(self, row: float, height_px: int) -> float:
        """When the exposure of a row, or of a place between rows, is half over: [s] from the frame's time."""
        return self.readout_s * (row / max(1, height_px - 1) - 0.5)


def motion_between(before: Pose | None, now: Pose) -> Motion:
    """The motion that brought a vehicle from one pose to the next; none where they are no step of a flight."""
    dt_s = 0.0 if before is None else (now.t_ns - before.t_ns) / NS_PER_S
    if before is None or not 0.0 < dt_s <= _LONGEST_STEP_S:
        return Motion(now)
    w0, x0, y0, z0 = before.quaternion
    w, x, y, z = _product((w0, -x0, -y0, -z0), now.quaternion)
    sine = math.sqrt(x * x + y * y + z * z)
    angle_rad = 2.0 * math.atan2(sine, abs(w))
    rate = 0.0 if sine < 1e-12 else math.copysign(angle_rad / sine / dt_s, w)
    velocity = (
        (now.north_m - before.north_m) / dt_s,
        (now.east_m - before.east_m) / dt_s,
        (now.down_m - before.down_m) / dt_s,
    )
    return Motion(now, velocity, (rate * x, rate * y, rate * z))


def sub_times_s(exposure_s: float, n: int) -> list[float]:
    """`n` even times [s] from the middle of an exposure that stand for it.

    The middles of its equal parts, spread a little: so few times have the variance of the whole exposure then.
    """
    spread = 1.0 if n == 1 else n / math.sqrt(n * n - 1.0)
    return [spread * exposure_s * ((k + 0.5) / n - 0.5) for k in range(n)]


def light_by_sub_frames(
    light_at: Callable[[Pose], NDArray[np.float32]],
    motion: Motion,
    shutter: Shutter,
    exposure_s: float,
    n_sub_frames: int,
    strip_px: int,
) -> NDArray[np.float32]:
    """What a moving camera gathers, (height, width, 3) float32: the mean over sub-frames, strip by strip of rows.

    Slow and simply right: what is faster is compared with it. `light_at` renders the light at a pose, as
    Renderer.light does; a strip is `strip_px` rows that share their times, all of them for a global shutter.
    """
    height_px = light_at(motion.pose).shape[0]
    if shutter.readout_s == 0.0:
        strip_px = height_px
    strips = []
    for top in range(0, height_px, strip_px):
        bottom = min(top + strip_px, height_px)
        middle_s = shutter.row_s((top + bottom - 1) / 2.0, height_px)
        gathered: NDArray[np.float32] | None = None
        for dt_s in sub_times_s(exposure_s, n_sub_frames):
            light = light_at(motion.pose_at(middle_s + dt_s))[top:bottom]
            gathered = light.copy() if gathered is None else gathered + light
        strips.append(np.asarray(gathered) / np.float32(n_sub_frames))
    return np.concatenate(strips)


def _turned(quaternion: Quaternion, rates_rad_s: Vector, dt_s: float) -> Quaternion:
    """The attitude after turning at body rates for a while."""
    rate = math.sqrt(sum(r * r for r in rates_rad_s))
    if rate * abs(dt_s) < 1e-12:
        return quaternion
    half = 0.5 * rate * dt_s
    x, y, z = (math.sin(half) / rate * r for r in rates_rad_s)
    return _product(quaternion, (math.cos(half), x, y, z))


def _product(a: Quaternion, b: Quaternion) -> Quaternion:
    """Hamilton's product of two quaternions."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )
