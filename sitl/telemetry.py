"""What the autopilot streams: every message's number, default rate and fields, as PX4 v1.16 fills them.

Field tuples stand in the order of the MAVLink definition; sitl.mavlink puts them on the wire. Units are MAVLink's.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

from sitl.autopilot import SimAutopilot
from sitl.modes import Mode
from sitl.vehicle import GRAVITY_M_S2, Vector, euler_of

Fields = tuple[object, ...]

_NAN = math.nan
_SAFETY_ARMED = 0x80
# SYS_STATUS as recorded: what is always there, and the MAV_SYS_STATUS_SENSOR bits that come and go.
_PRESENT, _ENABLED, _HEALTHY = 0x0200400F, 0x0201400F, 0x0320881F
_GPS, _XY_POSITION, _RC, _BATTERY, _PREARM = 0x20, 0x4000, 0x10000, 0x02000000, 0x10000000
_GIT_HASH = (0, 0, 0, 121, 18, 32, 203, 148)  # of v1.16.1, as AUTOPILOT_VERSION told it
_FIRST_STATUS_S = 2.0
_FIRST_POSITION_S = 2.5
_STANDARD_MODES = {Mode.POSCTL: 1, Mode.ALTCTL: 4, Mode.RTL: 5, Mode.MISSION: 6, Mode.LAND: 7, Mode.TAKEOFF: 8}
_STANDBY, _ACTIVE, _CRITICAL, _UNINIT = 3, 4, 5, 0


@dataclass(frozen=True, slots=True)
class Stream:
    """A message that the autopilot can send: its number, name, default rate [Hz] (0: only asked for) and fields.

    `fields` gives None where there is nothing to say yet.
    """

    message_id: int
    name: str
    rate_hz: float
    fields: Callable[[SimAutopilot], Fields | None]


def _ms(autopilot: SimAutopilot) -> int:
    return round(autopilot.boot_s * 1e3)


def _us(autopilot: SimAutopilot) -> int:
    return round(autopilot.boot_s * 1e6)


def _e7(autopilot: SimAutopilot, position_m: Vector) -> tuple[int, int, int]:
    latitude_rad, longitude_rad, altitude_m = autopilot.origin.global_of(position_m)
    return round(math.degrees(latitude_rad) * 1e7), round(math.degrees(longitude_rad) * 1e7), round(altitude_m * 1e3)


def _heartbeat(autopilot: SimAutopilot) -> Fields:
    mode = autopilot.mode
    if mode.is_auto:
        base = 0x1D
    elif mode is Mode.OFFBOARD:
        base = 0x11 if autopilot.has_seen_setpoints else 0x01
    else:
        base = 0x51
    if autopilot.is_armed:
        status = _CRITICAL if autopilot.failsafe else _ACTIVE
    else:
        status = _STANDBY if autopilot.commander.is_armable else _UNINIT
    return 2, 12, base | (_SAFETY_ARMED if autopilot.is_armed else 0), int(mode), status, 3


def _attitude(autopilot: SimAutopilot) -> Fields:
    estimate = autopilot.estimate
    return _ms(autopilot), *euler_of(estimate.quaternion), *estimate.rates_rad_s


def _attitude_quaternion(autopilot: SimAutopilot) -> Fields:
    estimate = autopilot.estimate
    return _ms(autopilot), *estimate.quaternion, *estimate.rates_rad_s


def _local_position(autopilot: SimAutopilot) -> Fields:
    return _ms(autopilot), *autopilot.estimate.position_m, *autopilot.estimate.velocity_m_s


def _global_position(autopilot: SimAutopilot) -> Fields | None:
    if autopilot.boot_s < _FIRST_POSITION_S or autopilot.home is None:
        return None
    estimate = autopilot.estimate
    latitude, longitude, altitude_mm = _e7(autopilot, estimate.position_m)
    over_home_mm = round((autopilot.home.position_m[2] - estimate.position_m[2]) * 1e3)
    velocity_cm_s = [round(v * 100) for v in estimate.velocity_m_s]
    heading = round(math.degrees(euler_of(estimate.quaternion)[2]) % 360 * 100) % 36000
    return _ms(autopilot), latitude, longitude, altitude_mm, over_home_mm, *velocity_cm_s, heading


def _odometry(autopilot: SimAutopilot) -> Fields:
    estimate = autopilot.estimate
    unknown = [_NAN] * 21
    head = (_us(autopilot), 1, 1, *estimate.position_m, list(estimate.quaternion))
    return *head, *estimate.velocity_m_s, *estimate.rates_rad_s, unknown, unknown, 0, 8, 0


def _highres_imu(autopilot: SimAutopilot) -> Fields:
    w, x, y, z = autopilot.estimate.quaternion
    an, ae, ad = autopilot.estimate.acceleration_m_s2
    ad -= GRAVITY_M_S2
    # The accelerometer feels the acceleration without gravity, seen from the body: the transposed rotation.
    force = (
        (1 - 2 * (y * y + z * z)) * an + 2 * (x * y + w * z) * ae + 2 * (x * z - w * y) * ad,
        2 * (x * y - w * z) * an + (1 - 2 * (x * x + z * z)) * ae + 2 * (y * z + w * x) * ad,
        2 * (x * z + w * y) * an + 2 * (y * z - w * x) * ae + (1 - 2 * (x * x + y * y)) * ad,
    )
    altitude_m = autopilot.origin.altitude_m - autopilot.estimate.position_m[2]
    pressure_hpa = 1013.25 * (1 - 2.25577e-5 * altitude_m) ** 5.25588
    magnetic_gauss = (0.21, 0.01, 0.42)
    rates = autopilot.estimate.rates_rad_s
    return _us(autopilot), *force, *rates, *magnetic_gauss, pressure_hpa, 0.0, altitude_m, 15.0, 63, 0


def _altitude(autopilot: SimAutopilot) -> Fields:
    down_m = autopilot.estimate.position_m[2]
    over_home_m = autopilot.home.position_m[2] - down_m if autopilot.home else _NAN
    amsl_m = autopilot.origin.altitude_m - down_m
    height_m = autopilot.vehicle.height_m
    return _us(autopilot), amsl_m, amsl_m, -down_m, over_home_m, -down_m - height_m, height_m


def _vfr_hud(autopilot: SimAutopilot) -> Fields:
    estimate = autopilot.estimate
    n, e, d = estimate.velocity_m_s
    heading_deg = int(math.degrees(euler_of(estimate.quaternion)[2]) % 360)
    altitude_m = autopilot.origin.altitude_m - estimate.position_m[2]
    return 0.0, math.hypot(n, e), heading_deg, round(autopilot.thrust * 100), altitude_m, -d


def _position_target(autopilot: SimAutopilot) -> Fields:
    setpoint = autopilot.setpoint
    if setpoint is None:
        return _ms(autopilot), 1, 0, *[_NAN] * 9, euler_of(autopilot.estimate.quaternion)[2], 0.0
    position = [_NAN if value is None else value for value in setpoint.position_m]
    return _ms(autopilot), 1, 0, *position, *setpoint.velocity_m_s, *[_NAN] * 3, setpoint.yaw_rad, 0.0


def _gps_raw(autopilot: SimAutopilot) -> Fields:
    n, e, _ = autopilot.estimate.velocity_m_s
    if not autopilot.has_gps:  # as recorded: no fix, and the last position
        last = _e7(autopilot, autopilot.last_fix_m)
        return _us(autopilot), 0, *last, 10000, 10000, 0, 0, 0, last[2], 100000, 100000, 10000, 0, 0
    course = round(math.degrees(math.atan2(e, n)) % 360 * 100) % 36000
    position = _e7(autopilot, autopilot.estimate.position_m)
    speed_cm_s = round(math.hypot(n, e) * 100)
    return _us(autopilot), 3, *position, 70, 110, speed_cm_s, course, 10, position[2], 900, 1780, 400, 0, 0


def _sys_status(autopilot: SimAutopilot) -> Fields:
    battery = autopilot.battery
    present, enabled, health = _sensors(autopilot)
    electric = round(battery.voltage_v * 1e3), round(battery.current_a * 100), _percent(autopilot)
    return present, enabled, health, 220, *electric, 0, 0, 0, 0, 0, 0, 0, 0, 1


def _sensors(autopilot: SimAutopilot) -> tuple[int, int, int]:
    """The sensors that are present, enabled and healthy, MAV_SYS_STATUS_SENSOR bits."""
    if autopilot.boot_s < _FIRST_STATUS_S:
        return 0, 0, 0x0321C83F
    present, enabled, health = _PRESENT, _ENABLED, _HEALTHY | _GPS
    if autopilot.is_position_ok:
        present, enabled = present | _GPS, enabled | _GPS
    elif not autopilot.has_gps and not autopilot.is_armed:
        enabled, health = enabled | _GPS, health & ~_GPS  # a receiver without a fix keeps from arming
    if autopilot.is_position_valid:
        health |= _XY_POSITION
    if autopilot.sticks is not None:
        present, health = present | _RC, health | _RC
    if autopilot.commander.warning:
        health &= ~_BATTERY
    if autopilot.commander.is_armable:
        health |= _PREARM
    return present, enabled, health


def _percent(autopilot: SimAutopilot) -> int:
    return round(autopilot.battery.remaining * 100)


def _battery_status(autopilot: SimAutopilot) -> Fields:
    battery = autopilot.battery
    voltages = [round(battery.voltage_v * 1e3)] + [65535] * 9
    consumed_mah = round(battery.consumed_ah * 1e3)
    return 0, 1, 1, 32767, voltages, round(battery.current_a * 100), consumed_mah, -1, _percent(autopilot), 0, 1


def _home(autopilot: SimAutopilot) -> Fields | None:
    home = autopilot.home
    if home is None:
        return None
    half = home.yaw_rad / 2
    turned = [math.cos(half), 0.0, 0.0, math.sin(half)]
    return *_e7(autopilot, home.position_m), *home.position_m, turned, 0.0, 0.0, 0.0, round(home.boot_s * 1e6)


def _current_mode(autopilot: SimAutopilot) -> Fields:
    commander = autopilot.commander
    return _STANDARD_MODES.get(commander.mode, 0), int(commander.mode), int(commander.intended)


def _extended_sys_state(autopilot: SimAutopilot) -> Fields:
    return 0, int(autopilot.landed)


def uid2(autopilot: SimAutopilot) -> list[int]:
    """The 18 bytes of the hardware's longer number: the short one, and zeros."""
    return [*autopilot.uid.to_bytes(8, "big"), *[0] * 10]


def _autopilot_version(autopilot: SimAutopilot) -> Fields:
    version = 17826303  # 1.16.1 release, as PX4 packs it
    return (
        59647,
        version,
        version,
        101854463,
        1,
        list(_GIT_HASH),
        list(_GIT_HASH),
        [0] * 8,
        0,
        0,
        autopilot.uid,
        uid2(autopilot),
    )


def _origin(autopilot: SimAutopilot) -> Fields:
    return *_e7(autopilot, (0.0, 0.0, 0.0)), _us(autopilot)


def _timesync(autopilot: SimAutopilot) -> Fields:
    return 0, round(autopilot.boot_s * 1e9)


STREAMS = (
    Stream(0, "heartbeat", 1.0, _heartbeat),
    Stream(1, "sys_status", 5.0, _sys_status),
    Stream(24, "gps_raw_int", 8.0, _gps_raw),
    Stream(30, "attitude", 100.0, _attitude),
    Stream(31, "attitude_quaternion", 50.0, _attitude_quaternion),
    Stream(32, "local_position_ned", 30.0, _local_position),
    Stream(33, "global_position_int", 50.0, _global_position),
    Stream(49, "gps_global_origin", 0.0, _origin),
    Stream(74, "vfr_hud", 10.0, _vfr_hud),
    Stream(85, "position_target_local_ned", 10.0, _position_target),
    Stream(105, "highres_imu", 50.0, _highres_imu),
    Stream(111, "timesync", 10.0, _timesync),
    Stream(141, "altitude", 10.0, _altitude),
    Stream(147, "battery_status", 0.5, _battery_status),
    Stream(148, "autopilot_version", 0.0, _autopilot_version),
    Stream(242, "home_position", 0.5, _home),
    Stream(245, "extended_sys_state", 5.0, _extended_sys_state),
    Stream(331, "odometry", 30.0, _odometry),
    Stream(436, "current_mode", 0.5, _current_mode),
)
