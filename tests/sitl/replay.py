"""Replays what a golden record's stations sent to a simulated autopilot, and keeps what it answers. Virtual time.

The application of a recording waited for answers; a replay waits for the same ones, so that a simulated vehicle which
climbs a little slower is asked for the next thing a little later. `Replay.clock` keeps which moment stands for which.
"""

import json
import math
from bisect import bisect_right
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pymavlink.dialects.v20 import all as dialect

from sitl.arducopter import ArduCopterFace
from sitl.autopilot import SimAutopilot
from sitl.mavlink import MavlinkFace
from sitl.parameters import Parameters

STEP_S = 0.004
WAIT_S = 8.0  # at most, beyond the recorded moment
SETPOINT_S = STICKS_S = 0.05
ABOUT_MESSAGES = (511, 512)  # answered by PX4's MAVLink module, in no order with the others
POSITION_AND_YAW = 2552  # type_mask
HEARD = {0, 1, 22, 77, 245, 253, 436}  # message numbers; the rest would only take time to read

Answers = dict[str, list[list[Any]]]


@dataclass
class Moment:
    """A recorded boot time, the replay's that stands for it [s], and whether something was sent then."""

    recorded_s: float
    ours_s: float
    is_input: bool


@dataclass
class Replay:
    """What came of a replay: `answers` as a golden record has them, the `clock`, and a wait in vain."""

    answers: Answers = field(default_factory=dict)
    clock: list[Moment] = field(default_factory=list)
    in_vain: str = ""

    def expected(self, recorded_s: float) -> tuple[float, float]:
        """When an answer of that moment is expected here [s], and how long after the last thing that was sent [s]."""
        before = self.clock[max(0, bisect_right([m.recorded_s for m in self.clock], recorded_s + 1e-6) - 1)]
        since_s = self.since_input_s(recorded_s, is_recorded=True)
        return before.ours_s + recorded_s - before.recorded_s, since_s

    def since_input_s(self, at_s: float, *, is_recorded: bool) -> float:
        """How long before a moment of the recording, or of the replay, something was last sent [s]."""
        sent = [m.recorded_s if is_recorded else m.ours_s for m in self.clock if m.is_input]
        return at_s - max((moment for moment in sent if moment <= at_s + 1e-6), default=0.0)


def load(path: Path) -> dict[str, Any]:
    """A golden record."""
    record: dict[str, Any] = json.loads(path.read_text())
    return record


class Player:
    """Sends a record's inputs to a face, and hears what it says."""

    def __init__(self, record: dict[str, Any], autopilot: SimAutopilot, face: MavlinkFace) -> None:
        self.autopilot, self.face = autopilot, face
        self.replay = Replay(clock=[Moment(0.0, 0.0, True)])
        self._record = record
        self._encoders: dict[int, Any] = {}
        self._parser: Any = dialect.MAVLink(None)
        self._state: dict[str, list[Any]] = {}
        self._texts: dict[int, list[Any]] = {}
        self._shift_s = 0.0
        self._repeats: dict[str, tuple[float, Any]] = {}
        self._next_s: dict[str, float] = {}

    def play(self) -> Replay:
        """Play it to the end."""
        inputs = list(self._record["inputs"])
        while self.autopilot.boot_s < self._record["end_s"] + self._shift_s:
            while inputs and self._is_done(inputs[0]):
                inputs.pop(0)
            if self.replay.in_vain:
                break
            self._repeat()
            self.autopilot.step(STEP_S)
            for packet in self.face.service():
                if int.from_bytes(packet[7:10], "little") not in HEARD:
                    continue
                for message in self._parser.parse_buffer(packet) or []:
                    self._hear(message)
        return self.replay

    def _is_done(self, entry: list[Any]) -> bool:
        """Do what an input says, if its time has come."""
        at_s, kind, *what = entry
        now_s = self.autopilot.boot_s
        if kind == "wait":
            return self._has_come(at_s, *what)
        if at_s + self._shift_s > now_s:
            return False
        self.replay.clock.append(Moment(at_s, now_s, kind not in ("heartbeats", "setpoint", "sticks")))
        if kind == "heartbeats":
            self._repeats[kind] = (what[0] + 1.0, None)
        elif kind == "setpoint":
            self._repeats[kind] = (what[0] + STEP_S, what[1])
            self._next_s[kind] = now_s + SETPOINT_S
            self._send_setpoint(what[1])
        elif kind == "sticks":
            self._repeats[kind] = (math.inf if what[0] else -math.inf, what[0])
        else:
            getattr(self, f"_send_{kind}")(*what)
        return True

    def _has_come(self, at_s: float, stream: str, what: list[Any]) -> bool:
        """Whether the answer that a wait is for has been heard; the time from then on is counted from it."""
        now_s = self.autopilot.boot_s
        for heard in reversed(self.replay.answers.get(stream, [])):
            if heard[1:] == what and heard[0] > self.replay.clock[-1].ours_s - 1.1:
                self._shift_s = heard[0] - at_s
                self.replay.clock.append(Moment(at_s, heard[0], False))
                return True
        if now_s > at_s + self._shift_s + WAIT_S + 0.2 * (at_s - self.replay.clock[-1].recorded_s):
            self.replay.in_vain = f"waited in vain for {stream} {what}, recorded at {at_s} s"
        return False

    def _repeat(self) -> None:
        now_s = self.autopilot.boot_s
        for kind, period_s in (("heartbeats", 1.0), ("setpoint", SETPOINT_S), ("sticks", STICKS_S)):
            until_s, what = self._repeats.get(kind, (-math.inf, None))
            if now_s <= until_s + self._shift_s and now_s >= self._next_s.get(kind, 0.0):
                self._next_s[kind] = now_s + period_s
                getattr(self, f"_send_{kind}")(what)

    # --- in ---

    def _send(self, station: int, name: str, *fields: Any) -> None:
        component = 190 if station == 245 else 1
        mavlink = self._encoders.setdefault(station, dialect.MAVLink(None, srcSystem=station, srcComponent=component))
        self.face.receive(getattr(mavlink, f"{name}_encode")(*fields).pack(mavlink))

    def _send_command(self, station: int, number: int, params: list[float | None]) -> None:
        filled = [math.nan if value is None else value for value in params]
        self._send(station, "command_long", 1, 1, number, 0, *filled, *[math.nan] * (7 - len(filled)))

    def _send_set(self, station: int, name: str, value: float, kind: int) -> None:
        if kind == dialect.MAV_PARAM_TYPE_INT32:
            value = int_as_float(int(value))
        self._send(station, "param_set", 1, 1, name.encode(), value, kind)

    def _send_read(self, station: int, name: str) -> None:
        self._send(station, "param_request_read", 1, 1, name.encode(), -1)

    def _send_heartbeats(self, _: None) -> None:
        self._send(245, "heartbeat", 6, 8, 0, 0, 0)

    def _send_setpoint(self, target: list[float]) -> None:
        n, e, d, yaw = target
        self._send(245, "set_position_target_local_ned", 0, 1, 1, 1, POSITION_AND_YAW, n, e, d, *[0.0] * 6, yaw, 0.0)

    def _send_sticks(self, sticks: list[int]) -> None:
        self._send(255, "manual_control", 1, *sticks, 0)

    # --- out ---

    def _hear(self, message: Any) -> None:
        kind = message.get_type()
        if kind == "HEARTBEAT":
            self._change("heartbeat", message.custom_mode, message.base_mode, message.system_status)
        elif kind == "EXTENDED_SYS_STATE":
            self._change("landed", message.landed_state)
        elif kind == "CURRENT_MODE":
            self._change("current_mode", message.standard_mode, message.custom_mode, message.intended_custom_mode)
        elif kind == "SYS_STATUS":
            sensors = [getattr(message, f"onboard_control_sensors_{word}") for word in ("present", "enabled", "health")]
            self._change("health", *sensors)
        elif kind == "COMMAND_ACK":
            stream = "message_ack" if message.command in ABOUT_MESSAGES else "ack"
            self._keep(stream, message.target_system, message.command, message.result)
        elif kind == "PARAM_VALUE":
            value = message.param_value
            self._keep("parameter", message.param_id, None if value != value else round(value, 3), message.param_type)
        elif kind == "STATUSTEXT":
            if message.chunk_seq:
                text = self._texts[message.id]
                text[2], text[3] = text[2] + message.text, message.chunk_seq + 1
            else:
                self._keep("text", message.severity, message.text, 1)
                self._texts[message.id] = self.replay.answers["text"][-1]

    def _change(self, stream: str, *what: Any) -> None:
        if self._state.get(stream) != list(what):
            self._state[stream] = list(what)
            self._keep(stream, *what)

    def _keep(self, stream: str, *what: Any) -> None:
        self.replay.answers.setdefault(stream, []).append([round(self.autopilot.boot_s, 3), *what])


def int_as_float(value: int) -> float:
    """An INT32 parameter's bytes read as the float that PARAM_SET carries."""
    return float(dialect.struct.unpack("<f", dialect.struct.pack("<i", value))[0])


def play_arducopter(record: dict[str, Any]) -> Replay:
    """Play a record to a simulated ArduCopter that beats its heart when the recorded one did."""
    autopilot = SimAutopilot(seed=4, speed=record["speed"])
    return Player(record, autopilot, ArduCopterFace(autopilot, first_beat_s=0.94)).play()


def play_px4(record: dict[str, Any]) -> Replay:
    """Play a record to a simulated PX4 that beats its heart when the recorded one did."""
    types = Parameters()
    changes = {
        name: int(value) if types.parameter(name).is_integer else value for name, value in record["parameters"].items()
    }
    autopilot = SimAutopilot(seed=4, parameters=Parameters(changes), speed=record["speed"])
    first_beat_s = record["heartbeat"][0][0] % 1.0
    return Player(record, autopilot, MavlinkFace(autopilot, first_beat_s=first_beat_s)).play()
