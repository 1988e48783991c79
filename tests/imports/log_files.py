"""The smallest logs that PX4, ArduPilot and a ground station might have written, by their formats' descriptions."""

import struct
from pathlib import Path

import numpy as np

from tests.imports.flown import END_S, Flown

UNIX_S = 1_790_000_000.0
_ULOG_HEADER = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0)
_ULOG_SYNC = bytes.fromhex("2f73132025 0cbb12")
ULOG_TOPICS = {
    "vehicle_local_position": "uint64_t timestamp;uint64_t timestamp_sample;float x;float y;float z;float vx;float vy;"
    "float vz;bool xy_valid;bool z_valid;",
    "vehicle_attitude": "uint64_t timestamp;uint64_t timestamp_sample;float[4] q;",
    "vehicle_local_position_setpoint": "uint64_t timestamp;float x;float y;float z;float vx;float vy;"
    "float vz;float yaw;",
    "actuator_motors": "uint64_t timestamp;float[12] control;",
    "battery_status": "uint64_t timestamp;float voltage_v;float current_a;float remaining;",
    "vehicle_status": "uint64_t timestamp;uint8_t nav_state;",
}
_PUBLISHED_LATER_US = 3_000
_NAV_STATES = {"LOITER": 4, "TAKEOFF": 17, "OFFBOARD": 14, "LAND": 18}


def ulog_message(kind: str, body: bytes) -> bytes:
    """A message of a ULog file."""
    return struct.pack("<HB", len(body), ord(kind)) + body


def ulog_data(topic: str, layout: str, *values: float) -> bytes:
    """A row of a topic."""
    return ulog_message("D", struct.pack("<H" + layout, list(ULOG_TOPICS).index(topic), *values))


def ulog_head() -> bytes:
    """Header, flags, formats, information and subscriptions."""
    parts = [_ULOG_HEADER, ulog_message("B", bytes(40))]
    parts += [ulog_message("F", f"{name}:{fields}".encode()) for name, fields in ULOG_TOPICS.items()]
    key = b"uint32_t ver_sw_release"
    parts.append(ulog_message("I", bytes([len(key)]) + key + struct.pack("<I", 0x011001FF)))
    key = b"char[6] ver_hw"
    parts.append(ulog_message("I", bytes([len(key)]) + key + b"V5_FMU"))
    parts += [ulog_message("A", struct.pack("<BH", 0, index) + name.encode()) for index, name in enumerate(ULOG_TOPICS)]
    return b"".join(parts)


def write_ulog(path: Path, flown: Flown) -> None:
    """The flight as PX4 logs it: estimates at 50 Hz, the rest more slowly."""
    rows: list[tuple[int, bytes]] = []
    for index, state in enumerate(flown.estimates):
        true_us = state.t_ns // 1000
        t_us = true_us + _PUBLISHED_LATER_US
        place = (state.north_m, state.east_m, state.down_m, state.v_north_m_s, state.v_east_m_s, state.v_down_m_s)
        quaternion = quaternion_of(state.roll_rad, state.pitch_rad, state.yaw_rad)
        rows.append((t_us, ulog_data("vehicle_local_position", "QQ6f2?", t_us, true_us, *place, True, True)))
        rows.append((t_us, ulog_data("vehicle_attitude", "QQ4f", t_us, true_us, *quaternion)))
        if index % 5 == 0:
            controls = (0.4, 0.5, 0.45, 0.55, *[float("nan")] * 8)
            rows.append((t_us, ulog_data("actuator_motors", "Q12f", t_us, *controls)))
        if index % 50 == 0:
            rows.append((t_us, ulog_data("battery_status", "Q3f", t_us, 15.8, 12.5, 0.8)))
    for t_ns, target in flown.targets:
        place = (*target[:3], *[float("nan")] * 3, target[3])
        rows.append((t_ns // 1000, ulog_data("vehicle_local_position_setpoint", "Q7f", t_ns // 1000, *place)))
    for t_ns, mode in flown.modes:
        rows.append((t_ns // 1000, ulog_data("vehicle_status", "QB", t_ns // 1000, _NAV_STATES[mode])))
    rows.append((9_000_000, ulog_message("L", b"6" + struct.pack("<Q", 9_000_000) + b"Takeoff detected")))
    # PX4 writes these so that a reader finds its way after damage.
    rows += [(t_s * 1_000_000, ulog_message("S", _ULOG_SYNC)) for t_s in range(round(END_S))]
    path.write_bytes(ulog_head() + b"".join(row for _, row in sorted(rows, key=lambda row: row[0])))


# ArduPilot's messages: type, name, format characters and columns (libraries/AP_Logger, LogStructure.h).
_DATAFLASH = {
    "PARM": (0x81, "QNf", "TimeUS,Name,Value"),
    "MSG": (0x82, "QZ", "TimeUS,Message"),
    "MODE": (0x83, "QMBB", "TimeUS,Mode,ModeNum,Rsn"),
    "XKF1": (0x84, "QBccCfffffff", "TimeUS,C,Roll,Pitch,Yaw,VN,VE,VD,dPD,PN,PE,PD"),
    "PSCN": (0x85, "Qffff", "TimeUS,TPN,PN,TVN,VN"),
    "PSCE": (0x86, "Qffff", "TimeUS,TPE,PE,TVE,VE"),
    "PSCD": (0x87, "Qffff", "TimeUS,TPD,PD,TVD,VD"),
    "RCOU": (0x88, "QHHHHHH", "TimeUS,C1,C2,C3,C4,C5,C6"),
    "BAT": (0x89, "QBffb", "TimeUS,Inst,Volt,Curr,RemPct"),
}
_STRUCT = {"Q": "Q", "N": "16s", "f": "f", "Z": "64s", "M": "B", "B": "B", "b": "b", "c": "h", "C": "H", "H": "H"}
DATAFLASH_SHIFT_M = (0.4, -0.3, 0.2)
"""How far the EKF's origin lies from that of telemetry."""


def dataflash_message(name: str, *values: float | bytes) -> bytes:
    """A message of a dataflash log."""
    number, layout, _ = _DATAFLASH[name]
    return struct.pack("<3B" + "".join(_STRUCT[kind] for kind in layout), 0xA3, 0x95, number, *values)


def _format(name: str, number: int, length: int, layout: str, columns: str) -> bytes:
    fields = (name.encode(), layout.encode(), columns.encode())
    return struct.pack("<3BBB4s16s64s", 0xA3, 0x95, 0x80, number, length, *fields)


def dataflash_head() -> bytes:
    """The formats of all messages."""
    parts = [_format("FMT", 0x80, 89, "BBnNZ", "Type,Length,Name,Format,Columns")]
    for name, (number, layout, columns) in _DATAFLASH.items():
        length = 3 + struct.calcsize("<" + "".join(_STRUCT[kind] for kind in layout))
        parts.append(_format(name, number, length, layout, columns))
    return b"".join(parts)


def write_dataflash(path: Path, flown: Flown) -> None:
    """The flight as ArduCopter logs it, of two EKF cores; motors on outputs 5, 1, 2, 3."""
    parts = [dataflash_head(), dataflash_message("MSG", 1000, b"ArduCopter V4.6.1 (abcdef12)")]
    for output, function in ((5, 33), (1, 34), (2, 35), (3, 36), (4, 0)):
        parts.append(dataflash_message("PARM", 1000, f"SERVO{output}_FUNCTION".encode(), function))
    modes = {"LOITER": 5, "TAKEOFF": 4, "OFFBOARD": 4, "LAND": 9}
    rows = [
        (t_ns // 1000, dataflash_message("MODE", t_ns // 1000, modes[mode], modes[mode], 2))
        for t_ns, mode in flown.modes
    ]
    for index, state in enumerate(flown.estimates):
        t_us = state.t_ns // 1000
        angles = [round(float(np.degrees(angle)) * 100) for angle in (state.roll_rad, state.pitch_rad)]
        yaw = round(float(np.degrees(state.yaw_rad)) % 360 * 100)
        speed = (state.v_north_m_s, state.v_east_m_s, state.v_down_m_s, 0.0)
        place = [
            value - shift
            for value, shift in zip((state.north_m, state.east_m, state.down_m), DATAFLASH_SHIFT_M, strict=True)
        ]
        rows.append((t_us, dataflash_message("XKF1", t_us, 0, *angles, yaw, *speed, *place)))
        rows.append((t_us, dataflash_message("XKF1", t_us, 1, *angles, yaw, *speed, 0.0, 0.0, 0.0)))
        if index % 5 == 0:
            rows.append((t_us, dataflash_message("RCOU", t_us, 1500, 1600, 1700, 1100, 1400, 0)))
        if index % 50 == 0:
            rows.append((t_us, dataflash_message("BAT", t_us, 0, 15.8, 12.5, 80)))
    for t_ns, target in flown.targets:
        for axis, value, shift in zip("NED", target, DATAFLASH_SHIFT_M, strict=False):
            rows.append((t_ns // 1000, dataflash_message(f"PSC{axis}", t_ns // 1000, value - shift, 0.0, 0.1, 0.0)))
    path.write_bytes(b"".join(parts) + b"".join(row for _, row in sorted(rows, key=lambda row: row[0])))


def write_telemetry(path: Path, frames: list[tuple[float, bytes]]) -> None:
    """Frames as a ground station logs them, each after the time [us, Unix] at which it came."""
    path.write_bytes(b"".join(struct.pack(">Q", round((UNIX_S + t_s) * 1e6)) + frame for t_s, frame in frames))


def quaternion_of(roll_rad: float, pitch_rad: float, yaw_rad: float) -> tuple[float, float, float, float]:
    """An attitude as w, x, y, z."""
    cr, cp, cy = (float(np.cos(angle / 2)) for angle in (roll_rad, pitch_rad, yaw_rad))
    sr, sp, sy = (float(np.sin(angle / 2)) for angle in (roll_rad, pitch_rad, yaw_rad))
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )
