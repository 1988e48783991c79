"""Where the vehicle's local frame lies on Earth, and where its home is in it."""

import math
from dataclasses import dataclass

from sitl.vehicle import Vector

_EARTH_RADIUS_M = 6371000.0  # PX4's MapProjection


@dataclass(frozen=True, slots=True)
class Origin:
    """Where on Earth the world's NED origin lies; the default is PX4 SITL's."""

    latitude_deg: float = 47.397742
    longitude_deg: float = 8.545594
    altitude_m: float = 488.0

    def global_of(self, position_m: Vector) -> Vector:
        """Latitude [deg], longitude [deg], altitude [m] of a position NED [m] (flat Earth: good within kilometres)."""
        latitude = self.latitude_deg + math.degrees(position_m[0] / _EARTH_RADIUS_M)
        around_m = _EARTH_RADIUS_M * math.cos(math.radians(self.latitude_deg))
        return (latitude, self.longitude_deg + math.degrees(position_m[1] / around_m), self.altitude_m - position_m[2])


@dataclass(frozen=True, slots=True)
class Home:
    """The home position: NED [m], yaw [rad], and when it was set [s, boot]."""

    position_m: Vector
    yaw_rad: float
    boot_s: float
