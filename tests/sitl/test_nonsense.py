"""Whatever comes over the link, the autopilot lives: nothing raises, and the vehicle stays finite and the same."""

import hashlib
import math
from collections import Counter
from dataclasses import dataclass, field

import pytest
from pymavlink.dialects.v20 import all as dialect

from sitl.arducopter import ArduCopterFace
from sitl.autopilot import SimAutopilot
from sitl.mavlink import MavlinkFace
from sitl.modes import Landed
from tests.sitl.nonsense import packets

STEP_S = 0.004
PER_STEP = 8


@dataclass
class Outcome:
    """What came of a flight through nonsense: the digest of all that was sent, and how often what was seen."""

    digest: str = ""
    acks: int = 0
    landed: Counter[Landed] = field(default_factory=Counter)


def fly(seed: int, n_packets: int, face_of: type[MavlinkFace] = MavlinkFace) -> Outcome:
    """Fly while `n_packets` come; somebody keeps arming and taking off, so that there is a flight to spoil."""
    autopilot = SimAutopilot(seed=seed)
    face = face_of(autopilot)
    station = dialect.MAVLink(None, srcSystem=245, srcComponent=190)
    digest, outcome, source = hashlib.sha256(), Outcome(), packets(seed)
    while autopilot.boot_s < 18.0:
        autopilot.step(STEP_S)
        face.service()
        if 5.0 <= autopilot.boot_s < 5.0 + STEP_S:
            autopilot.arm()
            autopilot.takeoff()
    for step in range(n_packets // PER_STEP):
        if step % 250 == 0:
            autopilot.battery.has_failed, autopilot.battery.remaining = False, 1.0
            autopilot.parameters.set("SIM_GPS_USED", 10)
            for number in (400, 22):
                face.receive(station.command_long_encode(1, 1, number, 0, 1, *[math.nan] * 6).pack(station))
        for _ in range(PER_STEP):
            face.receive(next(source))
        autopilot.step(STEP_S)
        for packet in face.service():
            digest.update(packet)
            outcome.acks += packet[7] == dialect.MAVLINK_MSG_ID_COMMAND_ACK
        vehicle, estimate = autopilot.vehicle, autopilot.estimate
        state = (*vehicle.position_m, *vehicle.velocity_m_s, *vehicle.quaternion, *vehicle.rates_rad_s)
        assert all(map(math.isfinite, (*state, *estimate.position_m, *estimate.velocity_m_s))), f"after step {step}"
        assert math.dist(vehicle.position_m, (0.0, 0.0, 0.0)) < 1e5
        outcome.landed[autopilot.landed] += 1
    outcome.digest = digest.hexdigest()
    return outcome


def test_every_command_number_is_answered() -> None:
    autopilot = SimAutopilot()
    face = MavlinkFace(autopilot)
    station = dialect.MAVLink(None, srcSystem=245, srcComponent=190)
    n_answers = 0
    for number in range(65536):
        face.receive(station.command_long_encode(1, 1, number, 0, *[math.nan] * 7).pack(station))
        if number % 16 == 15:
            for _ in range(4):
                autopilot.step(STEP_S)
            n_answers += sum(packet[7] == dialect.MAVLINK_MSG_ID_COMMAND_ACK for packet in face.service())
    assert n_answers == 65536 + 1  # a mode is answered twice


def test_a_hundred_thousand_packets_of_nonsense_are_survived() -> None:
    outcome = fly(seed=1, n_packets=100_000)
    assert outcome.acks > 10_000
    n_in_air = sum(n for state, n in outcome.landed.items() if state is not Landed.ON_GROUND)
    assert n_in_air > 1_000


@pytest.mark.parametrize(("seed", "face_of"), [(2, MavlinkFace), (3, MavlinkFace), (4, ArduCopterFace)])
def test_nonsense_does_the_same_every_time(seed: int, face_of: type[MavlinkFace]) -> None:
    assert fly(seed, 8_000, face_of).digest == fly(seed, 8_000, face_of).digest
