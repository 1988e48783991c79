"""The autopilot as the mission sees it: a protocol and its records.

World frame: NED, origin where the autopilot's local frame has it. Yaw: from north, clockwise positive, (-pi, pi].
"""

import enum
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol


class FlightMode(enum.StrEnum):
    """The flight modes that the mission tells apart; OTHER is any mode that only a pilot chooses."""

    UNKNOWN = "unknown"
    HOLD = "hold"
    TAKEOFF = "takeoff"
    OFFBOARD = "offboard"
    RETURN = "return"
    LAND = "land"
    OTHER = "other"


class LandedState(enum.StrEnum):
    """MAVLink's MAV_LANDED_STATE."""

    UNKNOWN = "unknown"
    ON_GROUND = "on_ground"
    TAKING_OFF = "taking_off"
    IN_AIR = "in_air"
    LANDING = "landing"


class AutopilotKind(enum.StrEnum):
    """MAVLink's MAV_AUTOPILOT, as far as the mission tells them apart."""

    UNKNOWN = "unknown"
    PX4 = "px4"
    ARDUPILOT = "ardupilot"


@dataclass(frozen=True, slots=True)
class Identity:
    """Who flies the vehicle (MAVLink AUTOPILOT_VERSION); what was not told is empty.

    `version` is major.minor.patch of the flight software, `uid` the hardware's own hexadecimal number: the same at
    every start, another for every vehicle.
    """

    kind: AutopilotKind
    version: str
    uid: str


@dataclass(frozen=True, slots=True)
class Setpoint:
    """An offboard position setpoint: NED [m] and yaw [rad] (MAVLink SET_POSITION_TARGET_LOCAL_NED)."""

    north_m: float
    east_m: float
    down_m: float
    yaw_rad: float


@dataclass(frozen=True, slots=True)
class VehicleState:
    """The vehicle as telemetry tells it; `t_ns` is flight time when the older of position and attitude arrived.

    Position NED [m], velocity NED [m/s], attitude [rad] (FRD body to NED), battery 0 to 1 (None: not known yet).
    `is_failsafe` says that the autopilot acts against what it was told (MAV_STATE_CRITICAL), `is_position_ok` that it
    knows where it is. `boot_ns` is the autopilot's own time of the attitude, since it started (None: not told).
    """

    t_ns: int
    north_m: float
    east_m: float
    down_m: float
    v_north_m_s: float
    v_east_m_s: float
    v_down_m_s: float
    roll_rad: float
    pitch_rad: float
    yaw_rad: float
    mode: FlightMode
    is_armed: bool
    landed: LandedState
    battery: float | None
    is_connected: bool
    is_failsafe: bool = False
    is_position_ok: bool = True
    boot_ns: int | None = None


@dataclass(frozen=True, slots=True)
class GlobalPoint:
    """A place on Earth: WGS-84 latitude and longitude [rad], altitude above mean sea level [m]."""

    latitude_rad: float
    longitude_rad: float
    altitude_m: float


class AutopilotError(Exception):
    """The autopilot refused or did not answer; the message is one sentence for a person."""


class NoAnswerError(AutopilotError):
    """The autopilot did not answer: nobody knows whether it obeyed."""


class Autopilot(Protocol):
    """A vehicle that flies offboard position setpoints.

    Every coroutine has its own time limit and raises AutopilotError when the autopilot refuses or does not answer.
    Commands return once the autopilot has accepted them; `state` tells when they have happened.
    """

    @property
    def state(self) -> VehicleState | None:
        """The newest telemetry; None until position, attitude, mode and landed state were all seen."""
        ...

    @property
    def target(self) -> Setpoint | None:
        """Where the autopilot says that it flies to (POSITION_TARGET_LOCAL_NED); None while it has not said."""
        ...

    @property
    def takes_off_in_offboard(self) -> bool:
        """Whether its own take-off shows as offboard, as ArduCopter's does; known once connected."""
        ...

    def drain_status_texts(self) -> list[str]:
        """The autopilot's own words since the last call, oldest first."""
        ...

    async def connect(self) -> None:
        """Find the autopilot and start its streams."""
        ...

    async def read_origin(self) -> GlobalPoint | None:
        """Where the local frame has its origin (GPS_GLOBAL_ORIGIN); None where the autopilot does not know."""
        ...

    def missing_health(self) -> list[str]:
        """What keeps the vehicle from arming, in words for a person; empty when it can arm."""
        ...

    async def identify(self) -> Identity:
        """Ask who flies the vehicle, once connected; an autopilot that does not tell is UNKNOWN, not an error."""
        ...

    async def read_parameters(self, names: Sequence[str]) -> dict[str, float]:
        """Read parameters by name; those that the autopilot does not have, or does not tell, are absent."""
        ...

    async def arm(self) -> None:
        """Arm the motors."""
        ...

    async def takeoff(self, altitude_m: float) -> None:
        """Climb to `altitude_m` above the take-off point in the autopilot's own take-off mode."""
        ...

    async def start_offboard(self, setpoint: Setpoint) -> None:
        """Send `setpoint` and ask for offboard; `state.mode` tells whether the autopilot went there."""
        ...

    async def set_setpoint(self, setpoint: Setpoint) -> None:
        """Send the next offboard setpoint."""
        ...

    async def hold(self) -> None:
        """Leave offboard and hold position in the autopilot's own mode."""
        ...

    async def return_home(self) -> None:
        """Fly home and land in the autopilot's own mode (RTL)."""
        ...

    async def land(self) -> None:
        """Land here in the autopilot's own mode."""
        ...

    async def close(self) -> None:
        """Let go of the link. Never changes what the vehicle does."""
        ...
