"""What the autopilot tells over MAVLink, as MAVSDK's streams bring it, brought together to the vehicle's state."""

import asyncio
import json
import math
from collections.abc import AsyncIterator, Callable
from typing import Any

from mavsdk.plugins.telemetry import FlightMode as MavsdkMode
from mavsdk.plugins.telemetry import LandedState as MavsdkLanded

from drivers.clock import Clock
from mission.autopilot import FlightMode, LandedState, Setpoint, VehicleState

AUTOPILOT_COMPONENT = 1
"""MAV_COMP_ID_AUTOPILOT1"""

_FAILSAFE_STATES = (5, 6)  # MAV_STATE_CRITICAL, MAV_STATE_EMERGENCY
_MODES = {
    MavsdkMode.UNKNOWN: FlightMode.UNKNOWN,
    MavsdkMode.READY: FlightMode.HOLD,
    MavsdkMode.TAKEOFF: FlightMode.TAKEOFF,
    MavsdkMode.HOLD: FlightMode.HOLD,
    MavsdkMode.RETURN_TO_LAUNCH: FlightMode.RETURN,
    MavsdkMode.LAND: FlightMode.LAND,
    MavsdkMode.OFFBOARD: FlightMode.OFFBOARD,
}
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


class MavsdkTelemetry:
    """The newest of each stream. `on_log` hears of messages that cannot be read.

    What the properties and methods give is what mission.autopilot.Autopilot promises.
    """

    def __init__(self, clock: Clock, on_log: Callable[[str], None]) -> None:
        self._clock = clock
        self._on_log = on_log
        self._streams: list[asyncio.Task[None]] = []
        self._target: Setpoint | None = None
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
    def target(self) -> Setpoint | None:
        """Where the autopilot says that it flies to; None while it has not said."""
        return self._target

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

    def listen(self, system: Any, telemetry: Any, direct: Any) -> None:
        """Take in what a system's plugins TelemetryAsync and MavlinkDirectAsync tell from now on."""
        self.follow(telemetry.subscribe_position_velocity_ned(), self._take_position)
        self.follow(telemetry.subscribe_attitude_euler(), self._take_attitude)
        self.follow(telemetry.subscribe_flight_mode(), self._keep("mode"))
        self.follow(telemetry.subscribe_landed_state(), self._keep("landed"))
        self.follow(telemetry.subscribe_armed(), self._keep("armed"))
        self.follow(telemetry.subscribe_health(), self._keep("health"))
        self.follow(telemetry.subscribe_battery(), self._take_battery)
        self.follow(telemetry.subscribe_status_text(), self._take_status_text)
        self.follow(system.is_connected_state(), self._keep("connected"))
        self.follow(direct.subscribe_message("HEARTBEAT"), self._take_heartbeat)
        self.follow(direct.subscribe_message("POSITION_TARGET_LOCAL_NED"), self._take_target)

    def follow(self, stream: AsyncIterator[Any], take: Callable[[Any], None]) -> None:
        """Hand each item of a stream to `take`, until `close`."""
        self._streams.append(asyncio.create_task(self._pump(stream, take)))

    async def close(self) -> None:
        """Listen no more: MAVSDK must not be destroyed before."""
        for stream in self._streams:
            stream.cancel()
        await asyncio.gather(*self._streams, return_exceptions=True)
        self._streams = []

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
        if message.component_id == AUTOPILOT_COMPONENT:
            self._newest["failsafe"] = json.loads(message.fields_json).get("system_status") in _FAILSAFE_STATES

    def _take_target(self, message: Any) -> None:
        fields = json.loads(message.fields_json)
        place = [fields.get(key) for key in ("x", "y", "z", "yaw")]
        if all(isinstance(value, int | float) and math.isfinite(value) for value in place):
            self._target = Setpoint(*place)

    def _take_status_text(self, item: Any) -> None:
        self._status_texts.append(str(item.text).strip())
