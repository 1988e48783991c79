"""Distils recordings of a real autopilot to tests/sitl/golden: what was sent to it, and what it answered, by boot time.

    python -m tests.sitl.distil RECORDINGS

A recording is NAME.tlog.xz, every message on the application's link, and NAME.events.txt, the observer's notes, from
which comes what another station did (lines with ### or GCS) and what the application waited for (# reached).
"""

import json
import lzma
import math
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pymavlink.dialects.v20 import all as dialect

from tests.sitl.replay import ABOUT_MESSAGES

GOLDEN = Path(__file__).parent / "golden"
APPLICATION, GROUND = 245, 255
SET_MODE, ARM = 176, 400
CENTRED, FORWARD = [0, 0, 500, 0], [600, 0, 500, 0]

# What the notes say another station did, as the MAVLink that says it.
DEEDS: dict[str, list[Any]] = {
    "GCS sends MANUAL_CONTROL 20 Hz, centred": ["sticks", CENTRED],
    "pilot moves the stick (x=600)": ["sticks", FORWARD],
    "stick centred": ["sticks", CENTRED],
    "joystick gone (MANUAL_CONTROL stops)": ["sticks", None],
    "GPS gone: GCS sets SIM_GPS_USED=0": ["set", GROUND, "SIM_GPS_USED", 0, 6],
    "GCS commands POSCTL, sticks centred": ["command", GROUND, SET_MODE, [1, 3, 0]],
    "GCS commands POSCTL (no RC)": ["command", GROUND, SET_MODE, [1, 3, 0]],
    "GCS commands AUTO.RTL": ["command", GROUND, SET_MODE, [1, 4, 5]],
    "GCS commands AUTO.LOITER": ["command", GROUND, SET_MODE, [1, 4, 3]],
    "GCS commands AUTO.LAND": ["command", GROUND, SET_MODE, [1, 4, 6]],
    "GCS: HOLD during takeoff": ["command", GROUND, SET_MODE, [1, 4, 3]],
    "GCS: HOLD during land": ["command", GROUND, SET_MODE, [1, 4, 3]],
    "GCS: force disarm refused? DISARM in air": ["command", GROUND, ARM, [0, 0]],
    "GCS: KILL (disarm force 21196) in air": ["command", GROUND, ARM, [0, 21196]],
    "GCS injects battery failure (420: unit 100 SYSTEM_BATTERY, type 1 OFF)": ["command", GROUND, 420, [100, 1, 0]],
}
CUTS = ("dropping everything", "app destroys")  # from here nothing of the application's arrives
DROPS, PASSES = ("dropping SET_POSITION", "setpoints dropped", "drop setpoints"), "setpoints pass"
WAITS = ("health", "takeoff done", "ON_GROUND", "disarmed", "auto-disarm", "armed")


def messages(path: Path) -> Iterator[tuple[float, Any]]:
    """Every message of a recording with the autopilot's boot time [s] then."""
    data = lzma.decompress(path.read_bytes())
    place, boot_s = 0, 0.0
    while place < len(data):
        place += 8  # the wall time
        is_v2 = data[place] == 0xFD
        length = data[place + 1] + (12 + 13 * (data[place + 2] & 1) if is_v2 else 8)
        parser: Any = dialect.MAVLink(None)  # a new one, which no unknown message before can have led astray
        parser.robust_parsing = True
        for message in parser.parse_buffer(data[place : place + length]) or []:
            if message.get_srcSystem() == 1 and hasattr(message, "time_boot_ms"):
                boot_s = message.time_boot_ms / 1e3
            yield boot_s, message
        place += length


def number(value: float) -> float | int | None:
    """A number as JSON has it: None for what is not one, three decimals, whole where it is."""
    if value != value:
        return None
    return int(value) if value == int(value) else round(value, 3)


class Distillate:
    """What is kept of a recording: `inputs`, and `answers` by stream, each [boot time, ...]."""

    def __init__(self) -> None:
        self.inputs: list[list[Any]] = []
        self.answers: dict[str, list[list[Any]]] = {}
        self._last: dict[str, list[Any]] = {}
        self._setpoint: list[Any] | None = None
        self._text: dict[int, list[Any]] = {}

    def answer(self, stream: str, boot_s: float, *what: Any, only_change: bool = False) -> None:
        if only_change and self._last.get(stream) == list(what):
            return
        self._last[stream] = list(what)
        self.answers.setdefault(stream, []).append([boot_s, *what])

    def hear(self, boot_s: float, message: Any) -> None:
        """Keep what the autopilot told."""
        kind = message.get_type()
        if kind == "HEARTBEAT":
            state = message.custom_mode, message.base_mode, message.system_status
            self.answer("heartbeat", boot_s, *state, only_change=True)
        elif kind == "EXTENDED_SYS_STATE":
            self.answer("landed", boot_s, message.landed_state, only_change=True)
        elif kind == "CURRENT_MODE":
            state = message.standard_mode, message.custom_mode, message.intended_custom_mode
            self.answer("current_mode", boot_s, *state, only_change=True)
        elif kind == "SYS_STATUS":
            sensors = [getattr(message, f"onboard_control_sensors_{word}") for word in ("present", "enabled", "health")]
            self.answer("health", boot_s, *sensors, only_change=True)
        elif kind == "COMMAND_ACK" and message.target_system:
            stream = "message_ack" if message.command in ABOUT_MESSAGES else "ack"
            self.answer(stream, boot_s, message.target_system, message.command, message.result)
        elif kind == "PARAM_VALUE" and self.inputs:
            self.answer("parameter", boot_s, message.param_id, number(message.param_value), message.param_type)
        elif kind == "STATUSTEXT":
            if message.chunk_seq:
                text = self._text[message.id]
                text[2], text[3] = text[2] + message.text, message.chunk_seq + 1
            else:
                self.answer("text", boot_s, message.severity, message.text, 1)
                self._text[message.id] = self.answers["text"][-1]

    def send(self, boot_s: float, message: Any) -> None:
        """Keep what the application sent."""
        kind = message.get_type()
        if kind == "COMMAND_LONG":
            params = [number(getattr(message, f"param{n}")) for n in range(1, 8)]
            self.inputs.append([boot_s, "command", APPLICATION, message.command, params])
        elif kind == "PARAM_SET":
            value = number(message.param_value)
            self.inputs.append([boot_s, "set", APPLICATION, message.param_id, value, message.param_type])
        elif kind == "PARAM_REQUEST_READ":
            self.inputs.append([boot_s, "read", APPLICATION, message.param_id])
        elif kind == "HEARTBEAT":
            self.inputs.append([boot_s, "heartbeat", APPLICATION, message.type])
        elif kind == "SET_POSITION_TARGET_LOCAL_NED":
            target = [round(value, 2) for value in (message.x, message.y, message.z, message.yaw)]
            last = self._setpoint
            if last is not None and last[3] == target and boot_s - last[2] < 0.4:
                last[2] = boot_s
            else:
                self._setpoint = [boot_s, "setpoint", boot_s, target]
                self.inputs.append(self._setpoint)


def distil(recording: Path, name: str) -> dict[str, Any]:
    """One recording's golden record."""
    notes = (recording / f"{name}.events.txt").read_text().splitlines()
    kept = Distillate()
    cut_s = next((boot for boot, note in timed(notes) if any(word in note for word in CUTS)), math.inf)
    drops = setpoint_drops(notes)
    for boot_s, message in messages(recording / f"{name}.tlog.xz"):
        if message.get_srcSystem() == 1 and message.get_srcComponent() == 1:
            kept.hear(boot_s, message)
        elif message.get_srcSystem() == APPLICATION and boot_s <= cut_s:
            is_setpoint = message.get_type() == "SET_POSITION_TARGET_LOCAL_NED"
            if not (is_setpoint and any(since_s <= boot_s < until_s for since_s, until_s in drops)):
                kept.send(boot_s, message)
    for boot_s, note in timed(notes):
        if note.startswith("### ") and note[4:] in DEEDS:
            kept.inputs.append([boot_s, *DEEDS[note[4:]]])
        elif command := re.match(r"GCS> cmd \(([\d, ]*)\)", note):
            numbers = [int(word) for word in command[1].split(",") if word.strip()]
            kept.inputs.append([boot_s, "command", GROUND, numbers[0], numbers[1:]])
        elif answer := re.match(r"\s*PX4>GCS ACK \S+\((\d+)\) (\w+)", note):
            result = getattr(dialect, f"MAV_RESULT_{answer[2]}")
            kept.answer("ack", boot_s, GROUND, int(answer[1]), result)
        elif note.startswith("# reached: ") and note[11:].startswith(WAITS):
            kept.inputs.append(anchor(kept, boot_s))
    start = re.search(r"speed=(\S+) params=\[(.*?)\]", notes[0])
    speed = 1.0 if start is None or start[1] == "None" else float(start[1])
    kept.inputs = heartbeats_condensed(kept.inputs)
    for records in (kept.inputs, *kept.answers.values()):
        # Times are known to some milliseconds: the application's setpoints came before the command that needs them.
        early_s = {"wait": 0.021 * speed, "setpoint": 0.02 * speed}
        records.sort(key=lambda record: record[0] - early_s.get(record[1], 0.0))
    settings = dict(word.split("=") for word in re.findall(r"'(.*?)'", start[2])) if start else {}
    end_s = [boot for boot, note in timed(notes)][-1]
    return {
        "speed": speed,
        "parameters": {key: float(value) for key, value in settings.items()},
        "end_s": end_s,
        "inputs": kept.inputs,
        **kept.answers,
    }


def setpoint_drops(notes: list[str]) -> list[tuple[float, float]]:
    """The spans of time in which the application's setpoints were kept from the autopilot."""
    drops = []
    for boot_s, note in timed(notes):
        if PASSES in note:
            drops = [(since_s, min(until_s, boot_s)) for since_s, until_s in drops]
        elif any(word in note for word in DROPS):
            drops.append((boot_s, math.inf))
    return drops


def anchor(kept: Distillate, boot_s: float) -> list[Any]:
    """The answer that the application had waited for when it went on at `boot_s`: the last change of state."""
    state = [(record[0], stream, record) for stream in ("heartbeat", "landed") for record in kept.answers[stream]]
    at_s, stream, record = max(entry for entry in state if entry[0] <= boot_s)
    return [at_s, "wait", stream, record[1:]]


def heartbeats_condensed(inputs: list[list[Any]]) -> list[list[Any]]:
    """The application's heartbeats as one span of time: when the first and the last came."""
    beats = [record for record in inputs if record[1] == "heartbeat"]
    others = [record for record in inputs if record[1] != "heartbeat"]
    return [[beats[0][0], "heartbeats", beats[-1][0]], *others] if beats else others


def timed(notes: list[str]) -> Iterator[tuple[float, str]]:
    """Each note with its boot time [s]."""
    for line in notes:
        if found := re.match(r"\s*[\d.]+ boot=\s*([\d.]+) (.*)", line):
            yield float(found[1]), found[2]


def write(record: dict[str, Any], path: Path) -> None:
    """JSON with one record to a line."""
    parts = []
    for key, value in record.items():
        if isinstance(value, list):
            lines = ",\n  ".join(json.dumps(entry, separators=(",", ":")) for entry in value)
            parts.append(f'"{key}": [\n  {lines}\n ]')
        else:
            parts.append(f'"{key}": {json.dumps(value)}')
    path.write_text("{\n " + ",\n ".join(parts) + "\n}\n")


if __name__ == "__main__":
    source = Path(sys.argv[1])
    for tlog in sorted(source.glob("*.tlog.xz")):
        scenario = tlog.name.removesuffix(".tlog.xz")
        folder = GOLDEN / ("arducopter" if scenario.startswith("ap_") else "px4")
        folder.mkdir(parents=True, exist_ok=True)
        write(distil(source, scenario), folder / f"{scenario}.json")
