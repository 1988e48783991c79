"""The same simulated vehicle behind an ArduCopter's MAVLink face (4.7-dev, as recorded with MAVSDK).

It differs from PX4's where a companion notices: mode numbers, one acknowledgement, nothing streamed until asked for, a
heartbeat at once on every change, a take-off in GUIDED, and no reaction to setpoints that stop.
"""

import math
from dataclasses import replace
from typing import Any

from sitl import commands
from sitl.arducopter_facts import (
    ARMABLE,
    BOOT_TEXTS,
    CAPABILITIES,
    DATA_STREAMS,
    GUIDED_READY_S,
    HOME_S,
    IN_PX4_TERMS,
    PARAMETERS,
    STATUS_S,
    VERSION,
    VERSION_HASH,
    CopterMode,
    ekf_flags,
    sensors,
)
from sitl.autopilot import SimAutopilot
from sitl.failsafes import Failsafe
from sitl.mavlink import MavlinkFace
from sitl.modes import Answer, Landed, Mode, Severity
from sitl.parameters import Parameter
from sitl.telemetry import STREAMS, Fields, Stream, uid2

_HEARTBEAT, _HOME_POSITION, _GLOBAL_ORIGIN = 0, 242, 49
_LOCAL_NED, _IGNORE_POSITION, _IGNORE_YAW = 1, 0x7, 0x400
_REAL32 = 9  # MAV_PARAM_TYPE; ArduPilot's integers travel as numbers, not bytewise
_INT32 = 6


class ArduCopterFace(MavlinkFace):
    """Shows a SimAutopilot as an ArduCopter. It takes the autopilot over: PX4's own failsafes are switched off."""

    _pings = False
    _marks_texts = False

    def __init__(self, autopilot: SimAutopilot, *, first_beat_s: float = 0.24) -> None:
        """Speak for `autopilot`, whose heart begins to beat `first_beat_s` [s] after now."""
        super().__init__(autopilot, first_beat_s=first_beat_s)
        for name, value in IN_PX4_TERMS.items():
            autopilot.set_parameter(name, value)
        self.mode = CopterMode.STABILIZE
        self._values = PARAMETERS | {"MAV_SYSID": self._system}
        self._target: tuple[float, float, float, float] | None = None
        self._is_taking_off = False
        self._was_armed = False
        self._told_beat: Fields | None = None
        self._told_home: object = None
        self._n_boot_texts = 0

    # --- what it tells ---

    def _all_streams(self) -> tuple[Stream, ...]:
        """PX4's messages at no rate until asked for, with ArduCopter's fields where they differ."""
        own = {
            0: ("heartbeat", 1.0, self._heartbeat),
            1: ("sys_status", 0.0, self._sys_status),
            111: ("timesync", 0.1, lambda autopilot: (0, round(autopilot.boot_s * 1e9))),
            148: ("autopilot_version", 0.0, self._version),
            193: ("ekf_status_report", 0.0, lambda autopilot: (ekf_flags(autopilot.boot_s), *[0.0] * 5)),
            245: ("extended_sys_state", 0.0, self._extended_sys_state),
        }
        shared = [replace(stream, rate_hz=0.0) for stream in STREAMS if stream.message_id not in own]
        return (*shared, *(Stream(number, *what) for number, what in own.items()))

    @property
    def landed(self) -> Landed:
        """The landed state, as EXTENDED_SYS_STATE tells it."""
        landed = self._autopilot.landed
        if landed is Landed.ON_GROUND:
            return landed
        if self.mode is CopterMode.LAND:
            return Landed.LANDING
        return Landed.TAKEOFF if self._is_taking_off else Landed.IN_AIR

    def _heartbeat(self, autopilot: SimAutopilot) -> Fields:
        mode = CopterMode.LAND if autopilot.failsafe is Failsafe.POSITION_LOSS else self.mode
        base = (0x59 if mode.is_guided else 0x51) | (0x80 if autopilot.is_armed else 0)
        is_flying = autopilot.is_armed and autopilot.landed is not Landed.ON_GROUND
        status = 4 if is_flying else 3 if autopilot.boot_s >= STATUS_S else 1
        return 2, 3, base, int(mode), status, 3

    def _extended_sys_state(self, autopilot: SimAutopilot) -> Fields | None:
        return (3, int(self.landed)) if autopilot.boot_s >= STATUS_S else None

    def _sys_status(self, autopilot: SimAutopilot) -> Fields | None:
        if autopilot.boot_s < STATUS_S:
            return None
        battery = autopilot.battery
        electric = round(battery.voltage_v * 1e3), round(battery.current_a * 100), round(battery.remaining * 100)
        return *sensors(autopilot.boot_s, is_armed=autopilot.is_armed), 0, *electric, *[0] * 9

    def _version(self, autopilot: SimAutopilot) -> Fields:
        nothing = [0] * 8
        return CAPABILITIES, VERSION, 0, 0, 0, list(VERSION_HASH), nothing, nothing, 0, 0, 0, uid2(autopilot)

    def _is_heard(self, now_s: float) -> bool:
        """ArduPilot's texts go out whether somebody reads them or not."""
        return True

    def _look(self, now_s: float) -> None:
        autopilot = self._autopilot
        autopilot.drain_texts()  # PX4's words
        while self._n_boot_texts < len(BOOT_TEXTS) and BOOT_TEXTS[self._n_boot_texts][0] <= now_s:
            self._say(BOOT_TEXTS[self._n_boot_texts][1])
            self._n_boot_texts += 1
        if self._was_armed and not autopilot.is_armed:
            self._say("Disarming motors")
        self._was_armed = autopilot.is_armed
        if autopilot.mode is Mode.OFFBOARD and self._target is not None:
            autopilot.set_position_setpoint(*self._target)  # a setpoint holds for good
        home = autopilot.home if now_s >= HOME_S and (self._told_home is None or autopilot.is_armed) else None
        if home is not None and (self._told_home is None or home.position_m != self._told_home):
            is_new = self._told_home is None or autopilot.landed is Landed.ON_GROUND
            self._told_home = home.position_m
            if is_new:
                self._send_stream(self._streams[_GLOBAL_ORIGIN])
                self._send_stream(self._streams[_HOME_POSITION])
        beat = self._heartbeat(autopilot)
        has_changed = self._told_beat is not None and beat != self._told_beat
        if has_changed and _HEARTBEAT in self._due_s:  # somebody may have switched it off
            self._due_s[_HEARTBEAT] = now_s
        self._told_beat = beat

    def _say(self, text: str) -> None:
        self._texts.append((Severity.INFO, text))

    # --- what it is told ---

    def _take_command(self, message: Any, params: tuple[float, ...]) -> None:
        self._acknowledge(message, message.command, self._execute(message.command, params))

    def _execute(self, command: int, params: tuple[float, ...]) -> Answer:
        autopilot = self._autopilot
        if command == commands.DO_SET_MODE:
            return self._set_mode(params[1])
        if command == commands.ARM_DISARM:
            return self._arm() if params[0] == 1 else self._disarm(is_forced=params[1] == commands.FORCE)
        if command == commands.TAKEOFF:
            return self._takeoff(params[6])
        if command == commands.LAND:
            return self._set_mode(CopterMode.LAND)
        if command == commands.RETURN_TO_LAUNCH:
            return self._set_mode(CopterMode.RTL)
        if command == commands.REBOOT:
            return Answer.FAILED if autopilot.is_armed else Answer.ACCEPTED
        if command == commands.MISSION_START:
            return Answer.FAILED
        return super()._execute(command, params)

    def _request_message(self, message_id: int) -> Answer:
        """ArduPilot accepts the request of any message that it knows, and sends it when there is one."""
        is_known = message_id in self._streams
        if is_known and not (message_id == _HOME_POSITION and self._told_home is None):
            self._send_stream(self._streams[message_id])
        return Answer.ACCEPTED if is_known else Answer.FAILED

    def _arm(self) -> Answer:
        autopilot = self._autopilot
        if autopilot.is_armed:
            return Answer.ACCEPTED
        if self.mode not in ARMABLE or not sensors(autopilot.boot_s, is_armed=False)[2] & 0x10000000:
            self._say("Arm: Mode not armable" if self.mode not in ARMABLE else "PreArm: AHRS not healthy")
            return Answer.FAILED
        if autopilot.arm() is not Answer.ACCEPTED:
            return Answer.FAILED
        self._is_taking_off = False
        self._say("Arming motors")
        return Answer.ACCEPTED

    def _disarm(self, *, is_forced: bool) -> Answer:
        return Answer.ACCEPTED if self._autopilot.disarm(is_forced=is_forced) is Answer.ACCEPTED else Answer.FAILED

    def _takeoff(self, height_m: float) -> Answer:
        """Climb to `height_m` over home: only in GUIDED, armed and on the ground."""
        autopilot = self._autopilot
        is_ready = autopilot.is_armed and autopilot.landed is Landed.ON_GROUND and self.mode is CopterMode.GUIDED
        if not is_ready or autopilot.home is None or not math.isfinite(height_m):
            return Answer.FAILED
        self._is_taking_off = True
        return autopilot.takeoff(autopilot.origin.altitude_m - autopilot.home.position_m[2] + height_m)

    def _set_mode(self, number: float) -> Answer:
        try:
            mode = CopterMode(round(number)) if math.isfinite(number) else None
        except ValueError:
            mode = None
        autopilot = self._autopilot
        is_positioned = autopilot.boot_s >= GUIDED_READY_S and autopilot.is_position_valid
        if mode is None or (mode.needs_position and not is_positioned):
            return Answer.FAILED
        if mode is self.mode:
            return Answer.ACCEPTED
        if autopilot.is_armed and autopilot.set_mode(mode.flown_as) is not Answer.ACCEPTED:
            return Answer.FAILED
        self.mode, self._is_taking_off = mode, False
        return Answer.ACCEPTED

    def _on_set_mode(self, message: Any) -> None:
        self._set_mode(float(message.custom_mode))

    def _on_set_position_target_local_ned(self, message: Any) -> None:
        autopilot = self._autopilot
        is_position = message.coordinate_frame == _LOCAL_NED and message.type_mask & _IGNORE_POSITION == 0
        is_flying = autopilot.is_armed and autopilot.landed is not Landed.ON_GROUND
        target = (message.x, message.y, message.z, math.nan if message.type_mask & _IGNORE_YAW else message.yaw)
        if self.mode is not CopterMode.GUIDED or not is_position or not is_flying:
            return
        if not all(map(math.isfinite, target[:3])):
            return
        self._target, self._is_taking_off = target, False
        autopilot.set_position_setpoint(*target)
        if autopilot.mode is not Mode.OFFBOARD and autopilot.failsafe is None:
            autopilot.set_mode(Mode.OFFBOARD)

    def _on_manual_control(self, message: Any) -> None:
        """Joysticks are not modelled for this face."""

    def _on_request_data_stream(self, message: Any) -> None:
        for message_id in DATA_STREAMS.get(message.req_stream_id, ()):
            rate_hz = message.req_message_rate if message.start_stop else 0
            self._set_interval(message_id, 1e6 / rate_hz if rate_hz else -1.0)

    # --- parameters: ArduPilot's own, told as plain numbers ---

    def _own(self, name: str) -> Parameter:
        return Parameter(name, self._values[name], sorted(self._values).index(name))

    def _on_param_request_read(self, message: Any) -> None:
        names = sorted(self._values)
        name = names[message.param_index] if 0 <= message.param_index < len(names) else message.param_id
        if name in self._values:
            self._send_parameter(self._own(name))

    def _on_param_request_list(self, message: Any) -> None:
        self._parameters.extend(self._own(name) for name in sorted(self._values))

    def _on_param_set(self, message: Any) -> None:
        if message.param_id not in self._values or not math.isfinite(message.param_value):
            return
        is_integer = isinstance(self._values[message.param_id], int)
        self._values[message.param_id] = round(message.param_value) if is_integer else message.param_value
        self._send_parameter(self._own(message.param_id))

    def _send_parameter(self, parameter: Parameter) -> None:
        kind = _INT32 if parameter.is_integer else _REAL32
        name, count = parameter.name.encode("ascii"), len(self._values)
        self._send(self._mavlink.param_value_encode(name, float(parameter.value), kind, count, parameter.index))
