"""The autopilot over MAVLink, by MAVSDK's native binding: found, asked, and commanded. What it tells is another file.

What the binding does that its documentation does not say: setpoints are repeated by a C++ thread whatever our event
loop does; `offboard.start()` may return although the autopilot refused, so only the heartbeat's mode counts; and
subscriptions must be cancelled before `destroy()`, or they hang for ever.
"""

import asyncio
import contextlib
import json
import math
from collections.abc import Awaitable, Callable, Mapping, Sequence
from functools import partial
from typing import Any, TypeVar

from mavsdk import Autopilot as MavsdkKind
from mavsdk.asyncio import ComponentType, Configuration, Mavsdk, MavsdkConnectionError, MavsdkError
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.info import InfoAsync
from mavsdk.asyncio.plugins.mavlink_direct import MavlinkDirectAsync
from mavsdk.asyncio.plugins.offboard import OffboardAsync, PositionNedYaw
from mavsdk.asyncio.plugins.param import ParamAsync
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync
from mavsdk.logging import log_subscribe
from mavsdk.plugins.mavlink_direct import MavlinkMessage
from mavsdk.plugins.param import ParamError, ParamResult

from drivers.clock import Clock
from mission.autopilot import (
    AutopilotError,
    AutopilotKind,
    GlobalPoint,
    Identity,
    NoAnswerError,
    Setpoint,
    VehicleState,
)
from mission.records import ClockSync
from mission.telemetry_mavsdk import AUTOPILOT_COMPONENT, MavsdkTelemetry
from mission.time_sync import TimeSync

T = TypeVar("T")

FIND_TIMEOUT_S = 20.0
COMMAND_TIMEOUT_S = 5.0
SETPOINT_TIMEOUT_S = 0.5
IDENTIFY_TIMEOUT_S = 5.0
ORIGIN_TIMEOUT_S = 3.0
PARAMETER_TIMEOUT_S = 6.0
"""MAVSDK itself asks for a parameter six times, which takes 3 s for one that the autopilot does not have."""

_IDENTIFY_POLL_S = 0.2
_TELEMETRY_RATE_HZ = 50.0
_STATUS_RATE_HZ = 5.0
_BATTERY_RATE_HZ = 2.0

_KINDS = {MavsdkKind.PX4: AutopilotKind.PX4, MavsdkKind.ARDUPILOT: AutopilotKind.ARDUPILOT}


class MavsdkAutopilot:
    """A vehicle at a MAVSDK connection URL. See mission.autopilot.Autopilot for what the methods promise.

    `on_log` gets MAVSDK's own log lines, which would otherwise go to the terminal in colour; `on_sync` hears once a
    second how the autopilot's clock stands to ours.
    """

    def __init__(
        self,
        connection: str,
        clock: Clock,
        on_log: Callable[[str], None],
        on_sync: Callable[[ClockSync], None] = lambda sync: None,
    ) -> None:
        self._connection = connection
        self._clock = clock
        self._on_log = on_log
        self._on_sync = on_sync
        self._mavsdk: Mavsdk | None = None
        self._system: Any = None
        self._action: Any = None
        self._offboard: Any = None
        self._asking: asyncio.Task[None] | None = None
        self._reading: asyncio.Task[float] | None = None
        self._telemetry: Any = None
        self._heard = MavsdkTelemetry(clock, on_log)
        self._kind = AutopilotKind.UNKNOWN

    @property
    def state(self) -> VehicleState | None:
        """The newest telemetry; None until position, attitude, mode and landed state were all seen."""
        return self._heard.state

    @property
    def target(self) -> Setpoint | None:
        """Where the autopilot says that it flies to; None while it has not said."""
        return self._heard.target

    def drain_status_texts(self) -> list[str]:
        """The autopilot's own words since the last call, oldest first."""
        return self._heard.drain_status_texts()

    def missing_health(self) -> list[str]:
        """What keeps the vehicle from arming, in words for a person; empty when it can arm."""
        return self._heard.missing_health()

    @property
    def takes_off_in_offboard(self) -> bool:
        """Whether its own take-off shows as offboard, as ArduCopter's does; known once connected."""
        return self._kind is AutopilotKind.ARDUPILOT

    async def read_origin(self) -> GlobalPoint | None:
        """Where the local frame has its origin; None where the autopilot does not know."""
        try:
            origin = await self._call("tell its origin", self._telemetry.get_gps_global_origin(), ORIGIN_TIMEOUT_S)
        except AutopilotError:
            return None
        if not all(map(math.isfinite, (origin.latitude_deg, origin.longitude_deg, origin.altitude_m))):
            return None
        return GlobalPoint(math.radians(origin.latitude_deg), math.radians(origin.longitude_deg), origin.altitude_m)

    async def connect(self) -> None:
        """Find the autopilot and start its streams."""
        log_subscribe(self._take_log)
        # As a ground station, because that is how PX4's answers were recorded (tests/sitl/golden).
        self._mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
        try:
            await asyncio.wait_for(self._mavsdk.add_any_connection(self._connection), COMMAND_TIMEOUT_S)
        except TimeoutError:
            raise AutopilotError(f"the connection {self._connection} does not open") from None
        except MavsdkConnectionError as error:
            raise AutopilotError(
                f"cannot open the connection {self._connection}: {error}; try udpin://0.0.0.0:14540"
            ) from None
        system = await self._mavsdk.first_autopilot(timeout_s=FIND_TIMEOUT_S)
        if system is None:
            raise AutopilotError(f"no autopilot was heard on {self._connection} within {FIND_TIMEOUT_S:g} s")
        self._system = system
        self._action = ActionAsync(system)
        self._offboard = OffboardAsync(system)
        direct = MavlinkDirectAsync(system)
        telemetry = self._telemetry = TelemetryAsync(system)
        self._heard.listen(system, telemetry, direct)
        time_sync = TimeSync(
            self._clock, partial(self._send_timesync, direct, await system.get_system_id()), self._on_sync
        )
        self._heard.follow(
            direct.subscribe_message("TIMESYNC"), lambda message: time_sync.take(json.loads(message.fields_json))
        )
        self._asking = asyncio.create_task(time_sync.ask())
        # ArduPilot streams nothing that was not asked for.
        rates: list[tuple[str, Callable[[float], Awaitable[None]], float]] = [
            ("positions", telemetry.set_rate_position_velocity_ned, _TELEMETRY_RATE_HZ),
            ("attitudes", telemetry.set_rate_attitude_euler, _TELEMETRY_RATE_HZ),
            ("landed states", telemetry.set_rate_landed_state, _STATUS_RATE_HZ),
            ("health reports", telemetry.set_rate_health, _STATUS_RATE_HZ),
            ("global positions", telemetry.set_rate_position, _STATUS_RATE_HZ),
            ("battery reports", telemetry.set_rate_battery, _BATTERY_RATE_HZ),
        ]
        for what, set_rate, rate_hz in rates:
            await self._call(f"set the rate of {what}", set_rate(rate_hz))

    async def identify(self) -> Identity:
        """Ask who flies the vehicle, once connected; an autopilot that does not tell is UNKNOWN, not an error."""
        loop = asyncio.get_running_loop()
        limit_s = loop.time() + IDENTIFY_TIMEOUT_S
        kind = self._kind = _KINDS.get(await self._system.autopilot_type(), AutopilotKind.UNKNOWN)
        info = InfoAsync(self._system)
        while loop.time() < limit_s:
            with contextlib.suppress(AutopilotError):  # AUTOPILOT_VERSION has not come yet
                version = await self._call("tell its version", info.get_version())
                identification = await self._call("identify itself", info.get_identification())
                uid = str(identification.hardware_uid)
                return Identity(
                    kind,
                    f"{version.flight_sw_major}.{version.flight_sw_minor}.{version.flight_sw_patch}",
                    # Older autopilots, and simulated ones, have the short number alone.
                    uid if uid.strip("0") else f"{identification.legacy_uid:016x}",
                )
            await asyncio.sleep(_IDENTIFY_POLL_S)
        return Identity(kind, "", "")

    async def read_parameters(self, names: Sequence[str]) -> dict[str, float]:
        """Read parameters by name; those that the autopilot does not have, or does not tell, are absent."""
        param = ParamAsync(self._system)
        found: dict[str, float] = {}
        for name in names:
            # Shielded, so that `close` can wait for the call in C when nobody else does any more.
            self._reading = asyncio.create_task(_read(param, name))
            with contextlib.suppress(AutopilotError):
                found[name] = await self._call(f"tell {name}", asyncio.shield(self._reading), PARAMETER_TIMEOUT_S)
        return found

    async def arm(self) -> None:
        """Arm the motors."""
        await self._call("arm", self._action.arm())

    async def takeoff(self, altitude_m: float) -> None:
        """Climb to `altitude_m` above the take-off point in the autopilot's own take-off mode."""

        async def climb() -> None:
            await self._action.set_takeoff_altitude(altitude_m)
            await self._action.takeoff()

        # One time limit for both: a control tick must not wait longer than its guard does.
        await self._call("take off", climb())

    async def start_offboard(self, setpoint: Setpoint) -> None:
        """Send `setpoint` and ask for offboard. Whether the autopilot went there shows in `state.mode`."""
        await self.set_setpoint(setpoint)
        await self._call("start offboard control", self._offboard.start())

    async def set_setpoint(self, setpoint: Setpoint) -> None:
        """Send the next offboard setpoint."""
        target = PositionNedYaw(setpoint.north_m, setpoint.east_m, setpoint.down_m, math.degrees(setpoint.yaw_rad))
        await self._call("take a setpoint", self._offboard.set_position_ned(target), SETPOINT_TIMEOUT_S)

    async def hold(self) -> None:
        """Leave offboard and hold position in the autopilot's own mode."""
        await self._call("hold", self._action.hold())

    async def return_home(self) -> None:
        """Fly home and land in the autopilot's own mode (RTL)."""
        await self._call("return", self._action.return_to_launch())

    async def land(self) -> None:
        """Land here in the autopilot's own mode."""
        await self._call("land", self._action.land())

    async def close(self) -> None:
        """Let go of the link. Never changes what the vehicle does."""
        if self._asking is not None:
            self._asking.cancel()
            await asyncio.gather(self._asking, return_exceptions=True)
            self._asking = None
        await self._heard.close()
        if self._reading is not None:  # in a thread of its own, which must not find MAVSDK destroyed
            await asyncio.wait([self._reading], timeout=PARAMETER_TIMEOUT_S)
            await asyncio.gather(self._reading, return_exceptions=True)
            self._reading = None
        if self._mavsdk is not None:
            self._mavsdk.destroy()
            self._mavsdk = None

    async def _call(self, what: str, call: Awaitable[T], timeout_s: float = COMMAND_TIMEOUT_S) -> T:
        """Await a call with its own time limit, and say its failure in words."""
        try:
            return await asyncio.wait_for(call, timeout_s)
        except TimeoutError:
            raise NoAnswerError(f"the autopilot did not answer within {timeout_s:g} s when asked to {what}") from None
        except MavsdkError as error:
            result = getattr(error, "result", None)
            words = str(getattr(result, "name", error)).replace("_", " ").lower()
            if words == "timeout":
                raise NoAnswerError(f"the autopilot did not answer when asked to {what}") from None
            raise AutopilotError(f"the autopilot refused to {what}: {words}") from None

    async def _send_timesync(self, direct: Any, system_id: int, fields: Mapping[str, int]) -> None:
        question = MavlinkMessage(
            message_name="TIMESYNC",
            target_system_id=system_id,
            target_component_id=AUTOPILOT_COMPONENT,
            fields_json=json.dumps(fields),
        )
        await self._call("tell its time", direct.send_message(question))

    def _take_log(self, level: Any, message: str, _file: str | None, _line: int) -> bool:
        self._on_log(f"{level.name}: {message}")
        return True


async def _read(param: Any, name: str) -> float:
    """A parameter of either type: MAVSDK wants the right one, and says at once when it was not."""
    try:
        return float(await param.get_param_float(name))
    except ParamError as error:
        if error.result is not ParamResult.WRONG_TYPE:
            raise
    return float(await param.get_param_int(name))
