"""Where the vehicle was at any time, by the autopilot's estimate.

Rotations are quaternions w, x, y, z, `target_from_source`; arrays of them are (n, 4).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.clock import NS_PER_S
from mission.autopilot import VehicleState
from mission.export.errors import ExportError

Floats = NDArray[np.float64]

ENU_FROM_NED: Floats = np.array([0.0, math.sqrt(0.5), math.sqrt(0.5), 0.0])
FRD_FROM_CAMERA: Floats = np.array([math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)])
"""The camera looks straight down, its image's top is the vehicle's forward (docs/conventions.md)."""

_MAX_AGE_NS = NS_PER_S // 4


@dataclass(frozen=True, slots=True, eq=False)
class Poses:
    """The vehicle at n times: places (n, 3) NED [m], attitudes (n, 3) roll, pitch, yaw [rad] of FRD in NED.

    `is_known` (n,) is False where the log holds no state within a quarter of a second: such a pose is the nearest one,
    or drawn over a long gap.
    """

    ned_m: Floats
    attitude_rad: Floats
    is_known: NDArray[np.bool_]

    @property
    def ned_from_frd(self) -> Floats:
        """The attitudes as quaternions (n, 4)."""
        (cr, cp, cy), (sr, sp, sy) = np.cos(self.attitude_rad.T / 2), np.sin(self.attitude_rad.T / 2)
        return np.stack(
            [
                cr * cp * cy + sr * sp * sy,
                sr * cp * cy - cr * sp * sy,
                cr * sp * cy + sr * cp * sy,
                cr * cp * sy - sr * sp * cy,
            ],
            axis=1,
        )


class Track:
    """The vehicle's states as arrays, to be asked for poses. Raises ExportError where there are none."""

    def __init__(self, states: Sequence[VehicleState]) -> None:
        # Telemetry that the control loop saw twice is one state.
        self._states = list({state.t_ns: state for state in states}.values())
        if not self._states:
            raise ExportError("The log holds no state of the vehicle, so that nothing in it has a place.")
        self.times_ns = np.array([state.t_ns for state in self._states], dtype=np.int64)
        self._ned_m = np.array([(state.north_m, state.east_m, state.down_m) for state in self._states])
        attitudes_rad = np.array([(state.roll_rad, state.pitch_rad, state.yaw_rad) for state in self._states])
        self._attitude_rad = np.unwrap(attitudes_rad, axis=0)

    def at(self, times_ns: NDArray[np.int64] | Sequence[int]) -> Poses:
        """The poses at n times [ns, flight], interpolated linearly between the states as mission.eyes does."""
        asked_ns = np.asarray(times_ns, dtype=np.int64)
        begin_ns = self.times_ns[0]  # seconds since then keep their nanoseconds as floats
        asked_s, known_s = (asked_ns - begin_ns) / NS_PER_S, (self.times_ns - begin_ns) / NS_PER_S

        def between(values: Floats) -> Floats:
            return np.stack([np.interp(asked_s, known_s, column) for column in values.T], axis=1)

        after = np.searchsorted(self.times_ns, asked_ns)
        last = len(self.times_ns) - 1
        neighbours_ns = self.times_ns[np.clip([after - 1, after], 0, last)]
        age_ns = np.abs(neighbours_ns - asked_ns).min(axis=0)
        return Poses(between(self._ned_m), between(self._attitude_rad), age_ns <= _MAX_AGE_NS)


def product(a: Floats, b: Floats) -> Floats:
    """Turn by one rotation after the other, (4,) or (n, 4) each: z_from_x of `a`, z_from_y, and `b`, y_from_x."""
    aw, ax, ay, az = np.moveaxis(a, -1, 0)
    bw, bx, by, bz = np.moveaxis(b, -1, 0)
    return np.stack(
        [
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ],
        axis=-1,
    )


def inverse(rotation: Floats) -> Floats:
    """`source_from_target` of `target_from_source`; (4,) or (n, 4)."""
    conjugate: Floats = rotation * np.array([1.0, -1.0, -1.0, -1.0])
    return conjugate


def rotated(rotation: Floats, vectors: Floats) -> Floats:
    """Vectors (n, 3) of the source frame, in the target frame; one rotation (4,) or (n, 4)."""
    pure = np.concatenate([np.zeros((len(vectors), 1)), vectors], axis=1)
    turned: Floats = product(product(rotation, pure), inverse(rotation))[:, 1:]
    return turned


def heading_deg(yaw_rad: float) -> float:
    """A yaw as a compass shows it: [0, 360) degrees from true north, clockwise."""
    return round(math.degrees(yaw_rad), 2) % 360.0
