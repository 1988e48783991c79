"""The autopilot over MAVLink, by MAVSDK's native binding. The only file that imports mavsdk.

What the binding does that its documentation does not say: setpoints are repeated by a C++ thread whatever our event
loop does; `offboard.start()` may return although the autopilot refused, so only the heartbeat's mode counts; and
subscriptions must be cancelled before `destroy()`, or they hang for ever.
"""

import asyncio
import contextlib
import json
import math
from collections.abc import AsyncIterator, Awaitable, Callable, Sequence
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
from mavsdk.plugins.telemetry import FlightMode as MavsdkMode
from mavsdk.plugins.telemetry import LandedState as MavsdkLanded

from drivers.clock import Clock
from mission.autopilot import (
    AutopilotError,
    AutopilotKind,
    FlightMode,
    GlobalPoint,
    Identity,
    LandedState,
    NoAnswerError,
    Setpoint,
    VehicleState,
)
from mission.records import ClockSync

T = TypeVar("T")

FIND_TIMEOUT_S = 20.0
COMMAND_TIMEOUT_S = 5.0
SETPOINT_TIMEOUT_S = 0.5
IDENTIFY_TIMEOUT_S = 5.0
ORIGIN_TIMEOUT_S = 3.0
PARAMETER_TIMEOUT_S = 6.0
"""MAVSDK itself asks for a parameter six times, which takes 3 s for one that the autopilot does not have."""

_IDENTIFY_POLL_S = 0.2
_AUTOPILOT_COMPONENT = 1  # MAV_COMP_ID_AUTOPILOT1
_FAILSAFE_STATES = (5, 6)  # MAV_STATE_CRITICAL, MAV_STATE_EMERGENCY
_TELEMETRY_RATE_HZ = 50.0
_STATUS_RATE_HZ = 5.0
_BATTERY_RATE_HZ = 2.0
_SYNC_PERIOD_S = 1.0

_MODES = {
    MavsdkMode.UNKNOWN: FlightMode.UNKNOWN,
    MavsdkMode.READY: FlightMode.HOLD,
    MavsdkMode.TAKEOFF: FlightMode.TAKEOFF,
    MavsdkMode.HOLD: FlightMode.HOLD,
    MavsdkMode.RETURN_TO_LAUNCH: FlightMode.RETURN,
    MavsdkMode.LAND: FlightMode.LAND,
    MavsdkMode.OFFBOARD: FlightMode.OFFBOARD,
}
_KINDS = {MavsdkKind.PX4: AutopilotKind.PX4, MavsdkKind.ARDUPILOT: AutopilotKind.ARDUPILOT}
_LANDED = {
    MavsdkLanded.UNKNOWN: LandedState.UNKNOWN,
    MavsdkLanded.ON_GROUND: LandedState.ON_GROUND,
    MavsdkLanded.TAKING_OFF: LandedState.TAKING_OFF,
    MavsdkLanded.IN_AIR: LandedState.IN_AIR,
    MavsdkLanded.LANDING: LandedState.LANDING,
}
_HEALTH_WORDS = {
    "is_gyrometer_calibration_ok": "gyroscope calibration",
    "is_accelerometer_calibration_ok": "accelerometer calibration",
    "is_magnetometer_calibration_ok": "compass calibration",
    "is_local_position_ok": "local position estimate",
    "is_global_position_ok": "global position (GPS)",
    "is_home_position_ok": "home position",
    "is_armable": "the autopilot's own arming checks",
}


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
        self._asked_ns = 0
        self._mavsdk: Mavsdk | None = None
        self._system: Any = None
        self._action: Any = None
        self._offboard: Any = None
        self._subscriptions: list[asyncio.Task[None]] = []
        self._reading: asyncio.Task[float] | None = None
        self._telemetry: Any = None
        self._target: Setpoint | None = None
        self._kind = AutopilotKind.UNKNOWN
        self._newest: dict[str, Any] = {"connected": True, "battery": None, "failsafe": False}
        self._is_deaf = False
        self._position_ns = 0
        self._attitude_ns = 0
        self._status_texts: list[str] = []

    @property
    def state(self) -> VehicleState | None:
        """The newest telemetry; None until position, attitude, mode and landed state were all seen."""
        newest = self._newest
        if any(key not in newest for key in ("position", "attitude", "mode", "landed", "armed")):
            return None
        position, velocity = newest["position"].position, newest["position"].velocity
        attitude = newest["attitude"]
        return VehicleState(
            t_ns=min(self._position_ns, self._attitude_ns),
            north_m=position.north_m,
            east_m=position.east_m,
            down_m=position.down_m,
            v_north_m_s=velocity.north_m_s,
            v_east_m_s=velocity.east_m_s,
            v_down_m_s=velocity.down_m_s,
            roll_rad=math.radians(attitude.roll_deg),
            pitch_rad=math.radians(attitude.pitch_deg),
            yaw_rad=math.radians(attitude.yaw_deg),
            mode=_MODES.get(newest["mode"], FlightMode.OTHER),
            is_armed=newest["armed"],
            landed=_LANDED.get(newest["landed"], LandedState.UNKNOWN),
            battery=newest["battery"],
            is_connected=newest["connected"] and not self._is_deaf,
            is_failsafe=newest["failsafe"],
            is_position_ok=self._is_position_ok(),
            boot_ns=int(attitude.timestamp_us) * 1000 if attitude.timestamp_us else None,
        )

    @property
    def takes_off_in_offboard(self) -> bool:
        """Whether its own take-off shows as offboard, as ArduCopter's does; known once connected."""
        return self._kind is AutopilotKind.ARDUPILOT

    @property
    def target(self) -> Setpoint | None:
        """Where the autopilot says that it flies to; None while it has not said."""
        return self._target

    async def read_origin(self) -> GlobalPoint | None:
        """Where the local frame has its origin; None where the autopilot does not know."""
        try:
            origin = await self._call("tell its origin", self._telemetry.get_gps_global_origin(), ORIGIN_TIMEOUT_S)
        except AutopilotError:
            return None
        if not all(map(math.isfinite, (origin.latitude_deg, origin.longitude_deg, origin.altitude_m))):
            return None
        return GlobalPoint(math.radians(origin.latitude_deg), math.radians(origin.longitude_deg), origin.altitude_m)

    def drain_status_texts(self) -> list[str]:
        """The autopilot's own words since the last call, oldest first."""
        texts, self._status_texts = self._status_texts, []
        return texts

    def missing_health(self) -> list[str]:
        """What keeps the vehicle from arming, in words for a person; empty when it can arm."""
        health = self._newest.get("health")
        if health is None:
            return ["health report"]
        return [words for name, words in _HEALTH_WORDS.items() if not getattr(health, name)]

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
        streams: list[tuple[AsyncIterator[Any], Callable[[Any], None]]] = [
            (telemetry.subscribe_position_velocity_ned(), self._take_position),
            (telemetry.subscribe_attitude_euler(), self._take_attitude),
            (telemetry.subscribe_flight_mode(), self._keep("mode")),
            (telemetry.subscribe_landed_state(), self._keep("landed")),
            (telemetry.subscribe_armed(), self._keep("armed")),
            (telemetry.subscribe_health(), self._keep("health")),
            (telemetry.subscribe_battery(), self._take_battery),
            (telemetry.subscribe_status_text(), self._take_status_text),
            (system.is_connected_state(), self._keep("connected")),
            (direct.subscribe_message("HEARTBEAT"), self._take_heartbeat),
            (direct.subscribe_message("POSITION_TARGET_LOCAL_NED"), self._take_target),
            (direct.subscribe_message("TIMESYNC"), self._take_timesync),
        ]
        self._subscriptions = [asyncio.create_task(self._pump(stream, take)) for stream, take in streams]
        self._subscriptions.append(asyncio.create_task(self._ask_time(direct)))
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
        for subscription in self._subscriptions:
            subscription.cancel()
        await asyncio.gather(*self._subscriptions, return_exceptions=True)
        self._subscriptions = []
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

    def _is_position_ok(self) -> bool:
        health = self._newest.get("health")
        return health is not None and health.is_local_position_ok and health.is_global_position_ok

    async def _pump(self, stream: AsyncIterator[Any], take: Callable[[Any], None]) -> None:
        try:
            async for item in stream:
                try:
                    take(item)
                except Exception as error:  # one message that cannot be read must not end its stream
                    self._on_log(f"{type(error).__name__} in a message: {error}")
        finally:
            # A stream that has ended tells an old truth for ever: without one of them the link is as good as lost.
            self._is_deaf = True

    def _keep(self, key: str) -> Callable[[Any], None]:
        def take(item: Any) -> None:
            self._newest[key] = item

        return take

    def _take_position(self, item: Any) -> None:
        self._newest["position"] = item
        self._position_ns = self._clock.now_ns()

    def _take_attitude(self, item: Any) -> None:
        self._newest["attitude"] = item
        self._attitude_ns = self._clock.now_ns()

    def _take_battery(self, item: Any) -> None:
        percent = float(item.remaining_percent)
        self._newest["battery"] = None if math.isnan(percent) else percent / 100

    def _take_heartbeat(self, message: Any) -> None:
        """MAVSDK's own streams leave out the state of the system, which tells a failsafe from a pilot's choice."""
        if message.component_id == _AUTOPILOT_COMPONENT:
            self._newest["failsafe"] = json.loads(message.fields_json).get("system_status") in _FAILSAFE_STATES

    def _take_target(self, message: Any) -> None:
        fields = json.loads(message.fields_json)
        place = [fields.get(key) for key in ("x", "y", "z", "yaw")]
        if all(isinstance(value, int | float) and math.isfinite(value) for value in place):
            self._target = Setpoint(*place)

    async def _ask_time(self, direct: Any) -> None:
        """Ask the autopilot for its time, once a second. Nobody waits for the answers."""
        while True:
            self._asked_ns = self._clock.now_ns()
            question = MavlinkMessage(
                message_name="TIMESYNC",
                target_system_id=1,
                target_component_id=_AUTOPILOT_COMPONENT,
                fields_json=json.dumps({"tc1": 0, "ts1": self._asked_ns}),
            )
            with contextlib.suppress(AutopilotError):
                await self._call("tell its time", direct.send_message(question))
            await asyncio.sleep(_SYNC_PERIOD_S)

    def _take_timesync(self, message: Any) -> None:
        """The autopilot asks for our time, too, which MAVSDK answers; what matters here are answers to our question."""
        fields = json.loads(message.fields_json)
        boot_ns, asked_ns = int(fields["tc1"]), int(fields["ts1"])
        if boot_ns and asked_ns == self._asked_ns:
            now_ns = self._clock.now_ns()
            self._on_sync(ClockSync(now_ns, boot_ns - (asked_ns + now_ns) // 2, now_ns - asked_ns))

    def _take_status_text(self, item: Any) -> None:
        self._status_texts.append(str(item.text).strip())

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
