"""ArduCopter's numbers (4.7-dev): modes, what it says and when while it boots, sensor bits, parameters."""

import enum

from sitl.modes import Mode


class CopterMode(enum.IntEnum):
    """A flight mode by the `custom_mode` of ArduCopter's HEARTBEAT; those that the model can show."""

    STABILIZE = 0
    ALT_HOLD = 2
    AUTO = 3
    GUIDED = 4
    LOITER = 5
    RTL = 6
    LAND = 9
    BRAKE = 17

    @property
    def is_guided(self) -> bool:
        """Whether MAV_MODE_FLAG_GUIDED_ENABLED is told with it."""
        return self not in (CopterMode.STABILIZE, CopterMode.ALT_HOLD)

    @property
    def needs_position(self) -> bool:
        """Whether it is refused without a position."""
        return self.is_guided and self is not CopterMode.LAND

    @property
    def flown_as(self) -> Mode:
        """The PX4 mode that flies it in the model; without sticks the manual ones hold, and AUTO has no mission."""
        return _FLOWN_AS.get(self, Mode.LOITER)


_FLOWN_AS = {CopterMode.RTL: Mode.RTL, CopterMode.LAND: Mode.LAND}
ARMABLE = (CopterMode.STABILIZE, CopterMode.ALT_HOLD, CopterMode.LOITER, CopterMode.GUIDED)

CAPABILITIES, VERSION = 64495, 67567616  # AUTOPILOT_VERSION: 4.7.0-dev
VERSION_HASH = (57, 48, 55, 48, 48, 57, 55, 55)

# How the recorded one got ready [s, boot].
STATUS_S = 2.45
_GPS_S = 9.75
HOME_S = 19.95
_AHRS_S = 22.4
_PREARM_S = 23.4
GUIDED_READY_S = 41.35
BOOT_TEXTS = (
    (0.4, "Barometer 1 calibration complete"),
    (0.4, "Barometer 2 calibration complete"),
    (2.45, "AHRS: DCM active"),
    (4.35, "EKF3 IMU0 initialised"),
    (4.35, "EKF3 IMU1 initialised"),
    (5.74, "EKF3 IMU1 tilt alignment complete"),
    (5.74, "EKF3 IMU0 MAG0 initial yaw alignment complete"),
    (5.74, "EKF3 IMU1 MAG0 initial yaw alignment complete"),
    (9.75, "GPS 1: probing for u-blox at 230400 baud"),
    (9.75, "GPS 1: detected u-blox"),
    (19.95, "EKF3 IMU0 origin set"),
    (20.04, "Field Elevation Set: 490m"),
    (20.15, "EKF3 IMU1 origin set"),
    (41.35, "EKF3 IMU0 is using GPS"),
)


def sensors(boot_s: float, *, is_armed: bool) -> tuple[int, int, int]:
    """SYS_STATUS's sensors present, enabled and healthy at `boot_s` [s]."""
    gps = 0x20 if boot_s >= _GPS_S else 0
    ahrs = 0x200000 if boot_s >= _AHRS_S else 0
    ready = 0x10000000 if boot_s >= _PREARM_S else 0
    if is_armed:
        return 0x5371FC0F | gps, 0x5361FC2F, 0x5771FC2F
    return 0x5371FC0F | gps, 0x52419C0F | gps | ahrs, 0x47519C0F | gps | ahrs | ready


def ekf_flags(boot_s: float) -> int:
    """EKF_STATUS_REPORT's flags at `boot_s` [s]: not initialised, attitude and height, then the position, too."""
    return 1024 if boot_s < 5.9 else 167 if boot_s < GUIDED_READY_S else 831


DATA_STREAMS = {
    0: (1, 24, 30, 32, 33, 74, 105, 147, 193, 245),
    1: (105,),
    2: (1, 24, 245),
    6: (32, 33),
    10: (30,),
    11: (74,),
    12: (147, 193),
}
"""MAV_DATA_STREAM: the messages of each group."""

PARAMETERS: dict[str, float | int] = {
    "FENCE_ACTION": 1,
    "FENCE_ALT_MAX": 100.0,
    "FENCE_ENABLE": 0,
    "FENCE_RADIUS": 300.0,
    "FS_GCS_ENABLE": 0,
    "FS_THR_ENABLE": 1,
    "GUID_TIMEOUT": 3.0,
    "MAV_SYSID": 1,
}

IN_PX4_TERMS: dict[str, float | int] = {
    "COM_DISARM_LAND": 0.1,
    "COM_LOW_BAT_ACT": 0,
    "COM_OF_LOSS_T": 60.0,
    "COM_RC_OVERRIDE": 0,
    "COM_SPOOLUP_TIME": 3.0,
    "GF_ACTION": 0,
    "MPC_TKO_RAMP_T": 1.0,
    "MPC_TKO_SPEED": 2.5,
}
"""What makes the model fly as ArduCopter does: quicker off the ground, disarmed as it lands, no PX4 failsafe."""
