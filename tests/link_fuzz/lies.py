"""MAVLink packets for an application that listens: broken ones, and whole ones that are lies, from a seed."""

import random
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from pymavlink.dialects.v20 import all as dialect
from pymavlink.generator.mavcrc import x25crc

from tests.sitl.nonsense import KINDS, noise

TELLING = (0, 1, 2, 4, 20, 22, 24, 30, 31, 32, 33, 36, 39, 44, 47, 49, 65, 66, 74, 76, 77, 85, 87, 110, 132, 141, 147)
TELLING = (*TELLING, 148, 230, 241, 242, 245, 253, 259, 262, 280, 283, 322, 324, 340)
"""What applications take in, and so the likely ones."""


STEERING = (0, 1, 24, 30, 31, 32, 33, 49, 61, 63, 74, 83, 85, 87, 109, 141, 147, 230, 242, 245)
"""What tells of mode, place, attitude, health or charge: such a lie may rightly end a flight."""

VEHICLE = (1, 1)
"""System and component of the vehicle that is flown."""

Maker = Callable[[random.Random], bytes]


def strangers_lies(seed: int) -> Iterator[bytes]:
    """Packets without end from everybody but the vehicle's system."""
    draw = random.Random(seed)

    def who() -> tuple[int, int]:
        return draw.choice((0, 2, 3, 7, 42, 245, 255)), draw.choice((1, 1, 100, 154, 190, 191, draw.randrange(256)))

    def alarm(draw: random.Random) -> bytes:
        """Another autopilot that is in an emergency, or flies elsewhere."""
        station = dialect.MAVLink(None, srcSystem=draw.choice((2, 3, 7)), srcComponent=1)
        if draw.random() < 0.5:
            return bytes(station.heartbeat_encode(2, 12, 209, 0x04030000, draw.choice((5, 6))).pack(station))
        place = [draw.uniform(-50.0, 50.0) for _ in range(11)]
        return bytes(station.position_target_local_ned_encode(0, 1, 2552, *place).pack(station))

    makers = (*_broken(lambda: KINDS, who), lambda draw: lie(draw, TELLING, who()), alarm)
    while True:
        yield draw.choice(makers)(draw)


def vehicles_lies(seed: int, *, is_steering: bool) -> Iterator[bytes]:
    """Packets without end in the vehicle's own name; those that `STEERING` has only if `is_steering`."""
    draw = random.Random(seed)
    kinds = KINDS if is_steering else [kind for kind in KINDS if kind not in STEERING]
    likely = [kind for kind in TELLING if kind in kinds]
    makers = (*_broken(lambda: kinds, lambda: VEHICLE), lambda draw: lie(draw, likely, VEHICLE))
    while True:
        yield draw.choice(makers)(draw)


def lie(draw: random.Random, kinds: Sequence[int], who: tuple[int, int]) -> bytes:
    """A whole message of one of `kinds` from system and component `who`, filled by chance; its checksum is right."""
    kind = draw.choice(kinds)
    message = dialect.mavlink_map[kind]
    size = message.unpacker.size if draw.random() < 0.7 else draw.randrange(1, 256)
    body = bytes((size, 0, 0, draw.randrange(256), *who)) + kind.to_bytes(3, "little") + draw.randbytes(size)
    return b"\xfd" + body + x25crc(body + bytes((message.crc_extra,))).crc.to_bytes(2, "little")


def _broken(kinds: Callable[[], Sequence[int]], who: Callable[[], tuple[int, int]]) -> tuple[Maker, ...]:
    """What makes packets that are no packets, that are cut off, or have a wrong bit, and whole ones of any kind."""

    def nothing(draw: random.Random) -> bytes:
        mavlink: Any = None
        return noise(draw, mavlink)

    def whole(draw: random.Random) -> bytes:
        return lie(draw, kinds(), who())

    def cut(draw: random.Random) -> bytes:
        packet = whole(draw)
        return packet[: draw.randrange(len(packet))]

    def flipped(draw: random.Random) -> bytes:
        packet = bytearray(whole(draw))
        packet[draw.randrange(len(packet))] ^= 1 << draw.randrange(8)
        return bytes(packet)

    return nothing, whole, cut, flipped
