"""The simulated vehicle behind an ArduCopter's face: as recorded, and where it differs from PX4."""

import math
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import all as dialect

from sitl.arducopter import ArduCopterFace
from sitl.arducopter_facts import CopterMode
from sitl.autopilot import SimAutopilot
from sitl.modes import Landed
from tests.sitl.comparison import differences
from tests.sitl.replay import load, play_arducopter

STEP_S = 0.004
ACCEPTED, FAILED = 0, 4

EXCEPTIONS = {
    "parameter ": "a station's parameters are told when ArduCopter itself changes them: calibration and statistics",
    "message_ack 245 0x200 ": "the recording lacks one of the requests",
    "heartbeat 0 89 1": "what it told before its boot time is known",
    "heartbeat 0 81 1": "the same",
    "text 6 (EKF3 IMU1 is using GPS|RC7|EKF3 IMU. MAG0 in-flight|SIM Hit)": "of what is not simulated",
}


def test_it_answers_as_recorded() -> None:
    record = load(Path(__file__).parent / "golden" / "arducopter" / "ap_nominal.json")
    found = differences(record, play_arducopter(record), EXCEPTIONS)
    assert not found, "\n".join(["", *found])


class Station:
    """An application and the face, without a socket."""

    def __init__(self) -> None:
        self.autopilot = SimAutopilot(seed=3)
        self.face = ArduCopterFace(self.autopilot)
        self.mavlink: Any = dialect.MAVLink(None, srcSystem=245, srcComponent=190)
        self.heard: list[Any] = []

    def run(self, time_s: float) -> None:
        for _ in range(round(time_s / STEP_S)):
            self.autopilot.step(STEP_S)
            for packet in self.face.service():
                self.heard += self.mavlink.parse_buffer(packet) or []

    def of(self, kind: str) -> list[Any]:
        return [message for message in self.heard if message.get_type() == kind]

    def send(self, message: Any) -> None:
        self.face.receive(message.pack(self.mavlink))

    def command(self, number: int, *params: float) -> list[int]:
        n_before = len(self.of("COMMAND_ACK"))
        self.send(self.mavlink.command_long_encode(1, 1, number, 0, *params, *[0.0] * (7 - len(params))))
        self.run(STEP_S)
        return [ack.result for ack in self.of("COMMAND_ACK")[n_before:]]

    def set_mode(self, mode: int) -> list[int]:
        return self.command(176, 1, mode)

    def take_off(self) -> None:
        self.run(42.0 - self.autopilot.boot_s)
        assert self.command(400, 1) == [ACCEPTED]
        assert self.set_mode(CopterMode.GUIDED) == [ACCEPTED]
        assert self.command(22, 0, 0, 0, 0, 0, 0, 8.0) == [ACCEPTED]
        self.run(14.0)

    def aim(self, n: float, e: float, d: float, mask: int = 2552) -> None:
        odd = [0.0] * 6
        self.send(self.mavlink.set_position_target_local_ned_encode(0, 1, 1, 1, mask, n, e, d, *odd, 0.5, 0.0))


@pytest.fixture
def station() -> Station:
    return Station()


def test_nothing_but_the_heartbeat_comes_unasked(station: Station) -> None:
    station.run(9.0)
    assert {message.get_type() for message in station.heard} == {"HEARTBEAT", "STATUSTEXT", "TIMESYNC"}
    assert station.command(511, 30, 100000) == [ACCEPTED]
    station.run(2.0)
    assert len(station.of("ATTITUDE")) == pytest.approx(20, abs=2)


def test_a_data_stream_can_be_asked_for_and_ended(station: Station) -> None:
    station.run(3.0)
    station.send(station.mavlink.request_data_stream_encode(1, 1, 6, 10, 1))
    station.run(2.0)
    n_heard = len(station.of("LOCAL_POSITION_NED"))
    assert n_heard == pytest.approx(20, abs=2)
    station.send(station.mavlink.request_data_stream_encode(1, 1, 6, 0, 0))
    station.run(2.0)
    assert len(station.of("LOCAL_POSITION_NED")) <= n_heard + 1


def test_the_heartbeat_follows_a_change_at_once(station: Station) -> None:
    station.run(42.5)
    assert station.set_mode(CopterMode.GUIDED) == [ACCEPTED]
    station.run(0.05)
    assert station.of("HEARTBEAT")[-1].custom_mode == CopterMode.GUIDED


def test_a_takeoff_needs_guided_and_arming(station: Station) -> None:
    station.run(42.0)
    assert station.command(22, 0, 0, 0, 0, 0, 0, 8.0) == [FAILED]
    assert station.command(400, 1) == [ACCEPTED]
    assert station.command(22, 0, 0, 0, 0, 0, 0, 8.0) == [FAILED]
    assert station.set_mode(CopterMode.GUIDED) == [ACCEPTED]
    assert station.command(22, 0, 0, 0, 0, 0, 0, 8.0) == [ACCEPTED]
    station.run(14.0)
    assert station.autopilot.vehicle.height_m == pytest.approx(8.0, abs=1.0)
    assert station.face.mode is CopterMode.GUIDED


@pytest.mark.parametrize("mode", [CopterMode.GUIDED, CopterMode.LOITER, CopterMode.RTL, 99, math.nan])
def test_a_mode_that_needs_a_position_is_refused_without_one(station: Station, mode: float) -> None:
    station.run(10.0)
    assert station.set_mode(mode) == [FAILED]  # type: ignore[arg-type]
    assert station.command(400, 1) == [FAILED]


def test_guided_flies_to_a_setpoint_and_stays_when_they_stop(station: Station) -> None:
    station.take_off()
    station.aim(10.0, 5.0, -8.0)
    station.run(70.0)  # longer than any COM_OF_LOSS_T
    assert station.face.mode is CopterMode.GUIDED
    assert math.dist(station.autopilot.vehicle.position_m, (10.0, 5.0, -8.0)) < 1.5


@pytest.mark.parametrize("mask", [0x0DF8 | 0x7, 0xFFFF])
def test_other_setpoints_are_ignored(station: Station, mask: int) -> None:
    station.take_off()
    station.aim(30.0, 30.0, -20.0, mask)
    station.run(5.0)
    assert math.hypot(*station.autopilot.vehicle.position_m[:2]) < 2.0


def test_setpoints_are_ignored_outside_guided(station: Station) -> None:
    station.take_off()
    assert station.set_mode(CopterMode.BRAKE) == [ACCEPTED]
    station.aim(30.0, 30.0, -20.0)
    station.run(5.0)
    assert station.face.mode is CopterMode.BRAKE
    assert math.hypot(*station.autopilot.vehicle.position_m[:2]) < 2.0


def test_a_landing_disarms_and_stays_in_land(station: Station) -> None:
    station.take_off()
    assert station.command(21) == [ACCEPTED]
    assert station.face.landed is Landed.LANDING
    station.run(40.0)
    beat = station.of("HEARTBEAT")[-1]
    assert (beat.custom_mode, beat.base_mode, beat.system_status) == (CopterMode.LAND, 0x59, 3)
    assert [text.text for text in station.of("STATUSTEXT")][-2:] == ["Arming motors", "Disarming motors"]
    assert station.command(400, 1) == [FAILED]


def test_parameters_are_its_own_and_travel_as_numbers(station: Station) -> None:
    station.send(station.mavlink.param_set_encode(1, 1, b"FENCE_ENABLE", 1.0, 2))
    station.send(station.mavlink.param_request_read_encode(1, 1, b"MIS_TAKEOFF_ALT", -1))
    station.run(0.1)
    (answer,) = station.of("PARAM_VALUE")
    assert (answer.param_id, answer.param_value) == ("FENCE_ENABLE", 1.0)
    station.send(station.mavlink.param_request_list_encode(1, 1))
    station.run(0.2)
    assert [value.param_index for value in station.of("PARAM_VALUE")[1:]] == list(range(answer.param_count))
