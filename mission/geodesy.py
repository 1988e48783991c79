"""Between the autopilot's local frame and places on Earth. Pure."""

import numpy as np
import pymap3d
from numpy.typing import NDArray

from mission.autopilot import GlobalPoint, Setpoint


def point_at(local: Setpoint, origin: GlobalPoint) -> GlobalPoint:
    """Where on Earth a place of the local frame is."""
    latitude_rad, longitude_rad, altitude_m = pymap3d.ned2geodetic(
        local.north_m,
        local.east_m,
        local.down_m,
        origin.latitude_rad,
        origin.longitude_rad,
        origin.altitude_m,
        deg=False,
    )
    return GlobalPoint(float(latitude_rad), float(longitude_rad), float(altitude_m))


def points_at(places_ned_m: NDArray[np.float64], origin: GlobalPoint) -> NDArray[np.float64]:
    """Where on Earth many places of the local frame are.

    (n, 3) NED [m] -> (n, 3) WGS-84 latitude, longitude [rad] and altitude above mean sea level [m].
    """
    north_m, east_m, down_m = np.asarray(places_ned_m, dtype=np.float64).reshape(-1, 3).T
    found = pymap3d.ned2geodetic(
        north_m, east_m, down_m, origin.latitude_rad, origin.longitude_rad, origin.altitude_m, deg=False
    )
    columns = [np.reshape(values, -1) for values in found]  # of a single place it makes an array and two scalars
    return np.stack(columns, axis=1).astype(np.float64)


def local_of(point: GlobalPoint, yaw_rad: float, origin: GlobalPoint) -> Setpoint:
    """Where in the local frame a place on Earth is."""
    north_m, east_m, down_m = pymap3d.geodetic2ned(
        point.latitude_rad,
        point.longitude_rad,
        point.altitude_m,
        origin.latitude_rad,
        origin.longitude_rad,
        origin.altitude_m,
        deg=False,
    )
    return Setpoint(float(north_m), float(east_m), float(down_m), yaw_rad)
