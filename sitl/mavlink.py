"""The simulated autopilot's MAVLink face: streams out, commands, parameters and setpoints in, as PX4's offboard link.

It turns bytes into bytes and knows no time but the autopilot's; sitl.udp carries them.
"""

import math
import struct
from collections import deque
from typing import Any

# The whole dialect, MAVLink 2, whatever MAVLINK_DIALECT and MAVLINK20 say; `common` lacks CURRENT_MODE.
from pymavlink.dialects.v20 import all as dialect

from sitl import commands
from sitl.autopilot import SimAutopilot
from sitl.modes import Answer, Severity
from sitl.parameters import Parameter
from sitl.telemetry import STREAMS, Stream

_FIRST_BEAT_S = 0.24  # after boot; the heartbeat keeps this fraction of each second
_COMMAND_S = 0.008  # a command waits this long for PX4's commander, in flight time
_TEXT_CHUNK = 50
_KEPT_TEXTS = 8
_FIRST_TEXT_S = 2.5  # after boot
_HEARTBEAT_LOSS_S = 2.5
_PARAMETERS_PER_SERVICE = 4
_COMPONENT = 1
_GET_MESSAGE_INTERVAL, _SET_MESSAGE_INTERVAL, _REQUEST_MESSAGE = 510, 511, 512
_REQUEST_CAPABILITIES = 520
_ABOUT_MESSAGES = (_GET_MESSAGE_INTERVAL, _SET_MESSAGE_INTERVAL, _REQUEST_MESSAGE, _REQUEST_CAPABILITIES)
_AUTOPILOT_VERSION = 148
_FLOAT, _INT32 = 9, 6  # MAV_PARAM_TYPE
_IGNORE_POSITION, _IGNORE_YAW = 0x7, 0x400  # POSITION_TARGET_TYPEMASK
_LOCAL_NED = 1  # MAV_FRAME
_MAX_INTERVAL_US = 2**31 - 1  # what MESSAGE_INTERVAL can tell

_COMPONENT_METADATA, _COMPONENT_METADATA_EXTRA = 397, 182


class _NoComponentMetadata(dialect.MAVLink_message):  # type: ignore[misc]
    """COMPONENT_METADATA, which the dialect lacks, saying that there is no file (and so no checksum of it)."""

    def __init__(self, time_boot_ms: int) -> None:
        super().__init__(_COMPONENT_METADATA, "COMPONENT_METADATA")
        self._payload_bytes = struct.pack("<II100s", time_boot_ms, 0, b"")

    def pack(self, mav: Any, force_mavlink1: bool = False) -> bytes:
        return bytes(self._pack(mav, _COMPONENT_METADATA_EXTRA, self._payload_bytes, force_mavlink1=force_mavlink1))


class MavlinkFace:
    """One autopilot's end of a MAVLink link: bytes in by `receive`, bytes out by `service`."""

    _pings = True
    _marks_texts = True

    def __init__(self, autopilot: SimAutopilot, *, first_beat_s: float = _FIRST_BEAT_S) -> None:
        """Speak for `autopilot`, whose streams begin `first_beat_s` [s] after now."""
        self._autopilot = autopilot
        # As in PX4, a change counts from the next start on.
        self._system = round(autopilot.parameters.get("MAV_SYS_ID"))
        streams = self._all_streams()
        self._outbox: list[bytes] = []
        self._mavlink: Any = dialect.MAVLink(None, srcSystem=self._system, srcComponent=_COMPONENT)
        self._streams = {stream.message_id: stream for stream in streams}
        first_s = autopilot.boot_s + first_beat_s
        self._due_s = {stream.message_id: first_s for stream in streams if stream.rate_hz > 0}
        self._intervals_s = {stream.message_id: 1 / stream.rate_hz for stream in streams if stream.rate_hz > 0}
        self._commands: deque[tuple[float, Any, int, tuple[float, ...]]] = deque()
        self._parameters: deque[Parameter] = deque()
        self._has_refused_frame = False
        self._n_texts = 0
        # PX4 keeps its texts while no ground station is there to read them; a full queue loses the oldest.
        self._texts: deque[tuple[Severity, str]] = deque(maxlen=_KEPT_TEXTS)
        self._heard_s = -math.inf
        self._n_pings = 0
        self._ping_s = autopilot.boot_s

    def _all_streams(self) -> tuple[Stream, ...]:
        """What can be sent, with its default rates."""
        return STREAMS

    def _look(self, now_s: float) -> None:
        """Anything else to do before sending, at `now_s` [s, boot]."""

    def receive(self, data: bytes) -> None:
        """Take a datagram: whole messages, so that a broken one does not spoil the next."""
        parser: Any = dialect.MAVLink(None)
        parser.robust_parsing = True
        for message in parser.parse_buffer(data) or ():
            self._receive(message)

    def service(self) -> list[bytes]:
        """Carry out what is due now, in the autopilot's time; returns the messages to send, in order."""
        now_s = self._autopilot.boot_s
        self._look(now_s)
        while self._commands and self._commands[0][0] <= now_s:
            _, message, command, params = self._commands.popleft()
            self._acknowledge(message, command, self._execute(command, params))
        self._texts.extend(self._autopilot.drain_texts())
        if self._is_heard(now_s):
            while self._texts:
                self._send_text(*self._texts.popleft())
        for _ in range(min(_PARAMETERS_PER_SERVICE, len(self._parameters))):
            self._send_parameter(self._parameters.popleft())
        for message_id, due_s in self._due_s.items():
            if due_s <= now_s:
                interval_s = self._intervals_s[message_id]
                # Keep the rate over jitter, but never make up for missed messages.
                self._due_s[message_id] = max(due_s + interval_s, now_s)
                self._send_stream(self._streams[message_id])
        if self._pings and self._ping_s <= now_s:
            self._ping_s = now_s + 1.0
            self._send(self._mavlink.ping_encode(round(now_s * 1e6), self._n_pings, 0, 0))
            self._n_pings += 1
        sent, self._outbox = self._outbox, []
        return sent

    # --- in ---

    def _receive(self, message: Any) -> None:
        handler = getattr(self, f"_on_{message.get_type().lower()}", None)
        is_for_us = getattr(message, "target_system", 0) in (0, self._system) and getattr(
            message, "target_component", 0
        ) in (0, _COMPONENT)
        if handler is not None and is_for_us:
            handler(message)

    def _on_command_long(self, message: Any) -> None:
        params = tuple(float(getattr(message, f"param{n}")) for n in range(1, 8))
        self._take_command(message, params)

    def _on_command_int(self, message: Any) -> None:
        params = (message.param1, message.param2, message.param3, message.param4, message.x, message.y, message.z)
        self._take_command(message, tuple(float(value) for value in params))

    def _take_command(self, message: Any, params: tuple[float, ...]) -> None:
        if message.command == commands.DO_SET_MODE:
            # PX4's MAVLink module answers at once, its commander again with what came of it.
            self._acknowledge(message, message.command, Answer.ACCEPTED)
        elif message.command in _ABOUT_MESSAGES:
            # These are the module's own, and never wait for the commander.
            self._acknowledge(message, message.command, self._execute(message.command, params))
            return
        self._commands.append((self._autopilot.boot_s + _COMMAND_S, message, message.command, params))

    def _on_set_position_target_local_ned(self, message: Any) -> None:
        if message.coordinate_frame != _LOCAL_NED:
            if not self._has_refused_frame:  # say it once: setpoints come many times a second
                self._has_refused_frame = True
                text = f"Setpoints in frame {message.coordinate_frame} are refused; send MAV_FRAME_LOCAL_NED"
                self._autopilot.say(Severity.CRITICAL, text)
        elif message.type_mask & _IGNORE_POSITION == 0:
            yaw_rad = math.nan if message.type_mask & _IGNORE_YAW else message.yaw
            self._autopilot.set_position_setpoint(message.x, message.y, message.z, yaw_rad)

    def _on_manual_control(self, message: Any) -> None:
        if message.target in (0, self._system):
            x, y, z, r = (value / 1000 for value in (message.x, message.y, message.z, message.r))
            self._autopilot.set_sticks(x, y, z, r)

    def _on_param_request_read(self, message: Any) -> None:
        try:
            if message.param_index >= 0:
                parameter = self._autopilot.parameters.at(message.param_index)
            else:
                parameter = self._autopilot.parameters.parameter(message.param_id)
        except (KeyError, IndexError):
            return  # PX4 does not answer for what it does not know
        self._send_parameter(parameter)

    def _on_param_request_list(self, message: Any) -> None:
        self._parameters = deque(self._autopilot.parameters.all())

    def _on_param_set(self, message: Any) -> None:
        value: float | int = message.param_value
        if message.param_type == _INT32:
            value = struct.unpack("<i", struct.pack("<f", message.param_value))[0]
        try:
            before = self._autopilot.parameters.parameter(message.param_id)
            self._autopilot.set_parameter(message.param_id, value)
        except (KeyError, TypeError):
            return
        except ValueError as error:
            self._autopilot.say(Severity.WARNING, f"Refused: {error}")  # and the old value is the answer
        parameter = self._autopilot.parameters.parameter(message.param_id)
        self._send_parameter(parameter)
        if parameter != before:
            self._parameters.append(parameter)  # PX4 answers, and then tells every station of the change

    def _is_heard(self, now_s: float) -> bool:
        """Whether a ground station's heartbeat came of late."""
        return now_s >= _FIRST_TEXT_S and now_s - self._heard_s < _HEARTBEAT_LOSS_S

    def _on_heartbeat(self, message: Any) -> None:
        if message.type == dialect.MAV_TYPE_GCS:
            self._heard_s = self._autopilot.boot_s
            self._autopilot.see_ground_station()

    def _on_ping(self, message: Any) -> None:
        if message.target_system == 0:
            sender = message.get_srcSystem(), message.get_srcComponent()
            self._send(self._mavlink.ping_encode(message.time_usec, message.seq, *sender))

    def _on_timesync(self, message: Any) -> None:
        if message.tc1 == 0:
            self._send(self._mavlink.timesync_encode(round(self._autopilot.boot_s * 1e9), message.ts1))

    # --- commands about messages ---

    def _execute(self, command: int, params: tuple[float, ...]) -> Answer:
        if command == _REQUEST_CAPABILITIES:
            return self._request_message(_AUTOPILOT_VERSION)
        if command in _ABOUT_MESSAGES:
            message_id = round(params[0]) if math.isfinite(params[0]) else -1
            if command == _SET_MESSAGE_INTERVAL:
                return self._set_interval(message_id, params[1])
            if command == _REQUEST_MESSAGE:
                return self._request_message(message_id)
            if message_id not in self._streams:
                return Answer.DENIED
            interval_us = min(round(self._intervals_s.get(message_id, 0.0) * 1e6), _MAX_INTERVAL_US)
            self._send(self._mavlink.message_interval_encode(message_id, interval_us))
            return Answer.ACCEPTED
        return commands.execute(self._autopilot, command, params)

    def _set_interval(self, message_id: int, interval_us: float) -> Answer:
        """Interval [us]; 0 is the default, -1 is off."""
        stream = self._streams.get(message_id)
        if stream is None or not math.isfinite(interval_us):
            return Answer.DENIED
        default_s = 1 / stream.rate_hz if stream.rate_hz > 0 else 0.0
        interval_s = interval_us * 1e-6 if interval_us > 0 else default_s if interval_us == 0 else 0.0
        if interval_s > 0:
            self._intervals_s[message_id] = interval_s
            self._due_s[message_id] = self._autopilot.boot_s
        else:
            self._intervals_s.pop(message_id, None)
            self._due_s.pop(message_id, None)
        return Answer.ACCEPTED

    def _request_message(self, message_id: int) -> Answer:
        if message_id == _COMPONENT_METADATA:
            self._send(_NoComponentMetadata(round(self._autopilot.boot_s * 1e3)))
            return Answer.ACCEPTED
        stream = self._streams.get(message_id)
        return Answer.ACCEPTED if stream is not None and self._send_stream(stream) else Answer.DENIED

    # --- out ---

    def _send(self, message: Any) -> None:
        self._outbox.append(message.pack(self._mavlink))
        self._mavlink.seq = (self._mavlink.seq + 1) % 256

    def _send_stream(self, stream: Stream) -> bool:
        fields = stream.fields(self._autopilot)
        if fields is None:
            return False
        self._send(getattr(self._mavlink, f"{stream.name}_encode")(*fields))
        return True

    def _send_text(self, severity: int, text: str) -> None:
        """Send a text as PX4 does: a tab says that it also exists as an event, and 50 characters make a chunk."""
        end = "\t" if self._marks_texts and not text.startswith("Preflight") else ""
        data = f"{text}{end}".encode("ascii", "replace")
        for chunk, start in enumerate(range(0, len(data), _TEXT_CHUNK)):
            piece = data[start : start + _TEXT_CHUNK]
            self._send(self._mavlink.statustext_encode(int(severity), piece, self._n_texts % 65536, chunk))
        self._n_texts += 1

    def _send_parameter(self, parameter: Parameter) -> None:
        value = parameter.value
        if parameter.is_integer:  # PX4's INT32 travel bytewise in the message's float
            value = struct.unpack("<f", struct.pack("<i", value))[0]
        kind = _INT32 if parameter.is_integer else _FLOAT
        count = len(self._autopilot.parameters)
        name = parameter.name.encode("ascii")
        self._send(self._mavlink.param_value_encode(name, value, kind, count, parameter.index))

    def _acknowledge(self, message: Any, command: int, answer: Answer) -> None:
        sender = message.get_srcSystem(), message.get_srcComponent()
        self._send(self._mavlink.command_ack_encode(command, int(answer), 0, 0, *sender))
