"""MAVLink packets that no station in its right mind sends, from a seed."""

import math
import random
from collections.abc import Iterator
from typing import Any

from pymavlink.dialects.v20 import all as dialect
from pymavlink.generator.mavcrc import x25crc

ODD = (math.nan, math.inf, -math.inf, 3.4e38, -3.4e38, 1e-40, -1.0, 0.0, 1.0, 2.0**31, -(2.0**31), 21196.0, 1e6, 0.5)
KINDS = sorted(dialect.mavlink_map)
HANDLED = (4, 11, 20, 21, 23, 66, 69, 70, 75, 76, 84, 86, 111)  # what an autopilot takes, and so the likely ones
HARMLESS, POWERFUL = (22, 187, 246, 300, 401, 510, 511, 512, 520), (20, 21, 176, 400, 420)
PARAMETERS = (b"MPC_THR_MIN", b"MPC_XY_P", b"COM_OF_LOSS_T", b"SIM_GPS_USED", b"GF_ACTION", b"NOT_A_ONE", b"\xff\x00")


def packets(seed: int) -> Iterator[bytes]:
    """Packets without end: broken ones, and whole ones that mean nonsense."""
    draw = random.Random(seed)
    mavlink: Any = dialect.MAVLink(None, srcSystem=255, srcComponent=190)
    makers = (noise, truncated, flipped, random_payload, command, setpoint, parameter, several)
    while True:
        yield draw.choice(makers)(draw, mavlink)


def noise(draw: random.Random, mavlink: Any) -> bytes:
    """Bytes, some of which look like a packet's begin."""
    begin = draw.choice((b"", b"\xfd", b"\xfe", b"\xfd\xff\x00"))
    return begin + draw.randbytes(draw.randrange(0, 300))


def truncated(draw: random.Random, mavlink: Any) -> bytes:
    """A packet's beginning."""
    whole = random_payload(draw, mavlink)
    return whole[: draw.randrange(len(whole))]


def flipped(draw: random.Random, mavlink: Any) -> bytes:
    """A packet with one wrong bit."""
    broken = bytearray(draw.choice((command, setpoint, parameter))(draw, mavlink))
    broken[draw.randrange(len(broken))] ^= 1 << draw.randrange(8)
    return bytes(broken)


def random_payload(draw: random.Random, mavlink: Any) -> bytes:
    """A whole message of any kind, filled by chance; its checksum is right."""
    kind = draw.choice(HANDLED) if draw.random() < 0.5 else draw.choice(KINDS)
    message = dialect.mavlink_map[kind]
    payload = draw.randbytes(draw.randrange(1, 256)) if draw.random() < 0.3 else b""
    payload = payload or draw.randbytes(message.unpacker.size)
    head = bytes((len(payload), 0, 0, draw.randrange(256), draw.choice((1, 245, 255)), draw.randrange(256)))
    body = head + kind.to_bytes(3, "little") + payload
    checksum = x25crc(body + bytes((message.crc_extra,))).crc
    return b"\xfd" + body + checksum.to_bytes(2, "little")


def command(draw: random.Random, mavlink: Any) -> bytes:
    """Any command number with odd parameters, sometimes for somebody else."""
    number = draw.choice(HARMLESS) if draw.random() < 0.5 else draw.randrange(65536)
    if draw.random() < 0.005:  # more of these would leave no flight to spoil
        number = draw.choice(POWERFUL)
    target = draw.choice((1, 1, 1, 0, 7)), draw.choice((1, 1, 0, 99))
    odd = [draw.choice(ODD) for _ in range(7)]
    if draw.random() < 0.2:
        where = [draw.choice((0, -(2**31), 2**31 - 1, 473977420)) for _ in range(2)]
        message = mavlink.command_int_encode(*target, draw.randrange(256), number, 0, 0, *odd[:4], *where, odd[6])
    else:
        message = mavlink.command_long_encode(*target, number, 0, *odd)
    return bytes(message.pack(mavlink))


def setpoint(draw: random.Random, mavlink: Any) -> bytes:
    """A position setpoint that is not one, or the pilot's sticks."""
    if draw.random() < 0.2:
        sticks = [draw.choice((-32768, -1000, 0, 500, 1000, 32767)) for _ in range(4)]
        return bytes(mavlink.manual_control_encode(draw.choice((0, 1, 9)), *sticks, 0).pack(mavlink))
    mask, frame = draw.choice((2552, 0, 0xFFFF, draw.randrange(65536))), draw.choice((1, 1, 1, 0, 8, 255))
    odd = [draw.choice((*ODD, draw.uniform(-20, 20))) for _ in range(11)]
    message = mavlink.set_position_target_local_ned_encode(0, 1, 1, frame, mask, *odd)
    return bytes(message.pack(mavlink))


def parameter(draw: random.Random, mavlink: Any) -> bytes:
    """A parameter written or read that is not there, or of another type."""
    name = draw.choice(PARAMETERS)
    choice = draw.random()
    if choice < 0.6:
        message = mavlink.param_set_encode(1, 1, name, draw.choice(ODD), draw.choice((6, 9, 0, 255)))
    elif choice < 0.99:
        message = mavlink.param_request_read_encode(1, 1, name, draw.choice((-1, 0, 5, 32767, -32768)))
    else:
        message = mavlink.param_request_list_encode(1, 1)
    return bytes(message.pack(mavlink))


def several(draw: random.Random, mavlink: Any) -> bytes:
    """Many packets in one datagram."""
    makers = (noise, truncated, flipped, command, setpoint, parameter)
    return b"".join(draw.choice(makers)(draw, mavlink) for _ in range(draw.randrange(2, 5)))
