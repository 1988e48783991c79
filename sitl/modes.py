"""The autopilot's flight modes, landed states and answers, by PX4's and MAVLink's numbers."""

import enum


class Mode(enum.IntEnum):
    """A flight mode; the value is the `custom_mode` of PX4's HEARTBEAT."""

    MANUAL = 0x00010000
    ALTCTL = 0x00020000
    POSCTL = 0x00030000
    ACRO = 0x00050000
    OFFBOARD = 0x00060000
    STABILIZED = 0x00070000
    TAKEOFF = 0x02040000
    LOITER = 0x03040000
    MISSION = 0x04040000
    RTL = 0x05040000
    LAND = 0x06040000

    @property
    def is_auto(self) -> bool:
        """Whether the autopilot flies by itself."""
        return (self >> 16) & 0xFF == 4

    @property
    def needs_sticks(self) -> bool:
        """Whether a pilot's sticks steer it."""
        return not self.is_auto and self is not Mode.OFFBOARD

    @property
    def needs_position(self) -> bool:
        """Whether it flies by the horizontal position."""
        return self.is_auto or self in (Mode.OFFBOARD, Mode.POSCTL)

    @property
    def title(self) -> str:
        """PX4's name for a person."""
        return _TITLES[self]


_TITLES = {
    Mode.MANUAL: "Manual",
    Mode.ALTCTL: "Altitude",
    Mode.POSCTL: "Position",
    Mode.ACRO: "Acro",
    Mode.OFFBOARD: "Offboard",
    Mode.STABILIZED: "Stabilized",
    Mode.TAKEOFF: "Takeoff",
    Mode.LOITER: "Hold",
    Mode.MISSION: "Mission",
    Mode.RTL: "Return",
    Mode.LAND: "Land",
}


class Landed(enum.IntEnum):
    """MAV_LANDED_STATE."""

    ON_GROUND = 1
    IN_AIR = 2
    TAKEOFF = 3
    LANDING = 4


class Answer(enum.IntEnum):
    """MAV_RESULT."""

    ACCEPTED = 0
    TEMPORARILY_REJECTED = 1
    DENIED = 2
    UNSUPPORTED = 3
    FAILED = 4


class Severity(enum.IntEnum):
    """MAV_SEVERITY, those that are used."""

    EMERGENCY = 0
    CRITICAL = 2
    WARNING = 4
    INFO = 6
