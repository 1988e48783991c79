"""Where the vehicle's local frame lies on Earth, and where its home is in it."""

import math
from dataclasses import dataclass

from sitl.vehicle import Vector

EARTH_RADIUS_M = 6371000.0  # PX4's MapProjection


@dataclass(frozen=True, slots=True)
class Origin:
    """Where on Earth the world's NED origin lies, latitude and longitude [rad], altitude [m]; by default PX4 SITL's."""

    latitude_rad: float = math.radians(47.397742)
    longitude_rad: float = math.radians(8.545594)
    altitude_m: float = 488.0

    def global_of(self, position_m: Vector) -> Vector:
        """Latitude [rad], longitude [rad], altitude [m] of a position NED [m] (flat Earth: good within kilometres)."""
        latitude_rad = self.latitude_rad + position_m[0] / EARTH_RADIUS_M
        longitude_rad = self.longitude_rad + position_m[1] / (EARTH_RADIUS_M * math.cos(self.latitude_rad))
        return (latitude_rad, longitude_rad, self.altitude_m - position_m[2])

    def place_ne_m(self, latitude_rad: float, longitude_rad: float) -> tuple[float, float]:
        """Where a place on Earth lies, north and east [m]: global_of, the other way round."""
        return (
            (latitude_rad - self.latitude_rad) * EARTH_RADIUS_M,
            (longitude_rad - self.longitude_rad) * EARTH_RADIUS_M * math.cos(self.latitude_rad),
        )


@dataclass(frozen=True, slots=True)
class Home:
    """The home position: NED [m], yaw [rad], and when it was set [s, boot]."""

    position_m: Vector
    yaw_rad: float
    boot_s: float
