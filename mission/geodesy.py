"""Between the autopilot's local frame and places on Earth. Pure."""

import pymap3d

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
