"""The MAVLink face over real UDP sockets, in the autopilot's virtual time."""

import math
import socket
import struct
from collections import Counter
from collections.abc import Iterator
from typing import Any

import pytest
from pymavlink.dialects.v20 import all as dialect

from sitl.autopilot import SimAutopilot
from sitl.mavlink import MavlinkFace
from sitl.modes import Mode, Severity
from sitl.udp import UdpLink

STEP_S = 0.004
ACCEPTED, REJECTED, DENIED, UNSUPPORTED = 0, 1, 2, 3


class Station:
    """A ground station or application: sends to the autopilot's port, keeps everything it hears."""

    def __init__(self, address: tuple[str, int] = ("127.0.0.1", 0)) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4_000_000)
        self.socket.bind(address)
        self.socket.setblocking(False)
        self.mavlink: Any = dialect.MAVLink(None, srcSystem=245, srcComponent=190)
        self.heard: list[Any] = []

    @property
    def port(self) -> int:
        return int(self.socket.getsockname()[1])

    def send(self, message: Any, port: int) -> None:
        self.socket.sendto(message.pack(self.mavlink), ("127.0.0.1", port))

    def listen(self) -> None:
        while True:
            try:
                data = self.socket.recv(65535)
            except BlockingIOError:
                return
            self.heard += self.mavlink.parse_buffer(data) or []

    def of(self, kind: str) -> list[Any]:
        return [message for message in self.heard if message.get_type() == kind]


class Link:
    """An autopilot with its face, and the application that it speaks to."""

    def __init__(self) -> None:
        while True:  # the face's own port is 40 above the application's, and may be somebody's
            self.app = Station()
            self.autopilot = SimAutopilot(seed=2)
            try:
                self.face = UdpLink(MavlinkFace(self.autopilot), self.app.port)
                break
            except OSError:
                self.app.socket.close()

        self._beat_s = 0.0

    def beat(self) -> None:
        """Send a ground station's heartbeat."""
        self.app.send(self.app.mavlink.heartbeat_encode(dialect.MAV_TYPE_GCS, 8, 0, 0, 0), self.port)

    @property
    def port(self) -> int:
        return self.app.port + 40

    def run(self, time_s: float) -> None:
        for _ in range(round(time_s / STEP_S)):
            if self.autopilot.boot_s >= self._beat_s:
                self._beat_s += 1.0
                self.beat()
            self.autopilot.step(STEP_S)
            self.face.service()
            self.app.listen()

    def command(self, number: int, *params: float) -> list[int]:
        """Send a COMMAND_LONG; returns the answers to it."""
        n_before = len(self.app.of("COMMAND_ACK"))
        filled = (*params, *[float("nan")] * (7 - len(params)))
        self.app.send(self.app.mavlink.command_long_encode(1, 1, number, 0, *filled), self.port)
        self.run(0.1)
        return [ack.result for ack in self.app.of("COMMAND_ACK")[n_before:] if ack.command == number]

    def read_parameter(self, name: str) -> list[Any]:
        n_before = len(self.app.of("PARAM_VALUE"))
        self.app.send(self.app.mavlink.param_request_read_encode(1, 1, name.encode(), -1), self.port)
        self.run(0.02)
        return self.app.of("PARAM_VALUE")[n_before:]


@pytest.fixture
def link() -> Iterator[Link]:
    link = Link()
    yield link
    link.face.close()
    link.app.socket.close()


def test_streams_run_at_px4s_default_rates(link: Link) -> None:
    link.run(4.5)  # positions are streamed once the estimator is ready
    link.app.heard.clear()
    link.run(10.0)
    counts = Counter(message.get_type() for message in link.app.heard)
    rates_hz = {
        "ATTITUDE": 100,
        "ATTITUDE_QUATERNION": 50,
        "GLOBAL_POSITION_INT": 50,
        "HIGHRES_IMU": 50,
        "LOCAL_POSITION_NED": 30,
        "ODOMETRY": 30,
        "ALTITUDE": 10,
        "VFR_HUD": 10,
        "POSITION_TARGET_LOCAL_NED": 10,
        "TIMESYNC": 10,
        "GPS_RAW_INT": 8,
        "SYS_STATUS": 5,
        "EXTENDED_SYS_STATE": 5,
        "HEARTBEAT": 1,
        "PING": 1,
        "BATTERY_STATUS": 0.5,
        "HOME_POSITION": 0.5,
        "CURRENT_MODE": 0.5,
    }
    assert {kind: counts[kind] / 10 for kind in rates_hz} == pytest.approx(rates_hz, rel=0.03, abs=0.11)


def test_the_heartbeat_does_not_follow_a_change_at_once(link: Link) -> None:
    link.run(5.5)
    armed_s = link.autopilot.boot_s
    assert link.command(400, 1.0) == [ACCEPTED]
    assert not link.app.of("HEARTBEAT")[-1].base_mode & 0x80
    assert link.command(512, 0.0) == [ACCEPTED]
    assert link.app.of("HEARTBEAT")[-1].base_mode == 0x9D
    assert link.autopilot.boot_s - armed_s < 0.5


def test_heartbeats_tell_what_px4_tells(link: Link) -> None:
    link.run(2.0)
    first = link.app.of("HEARTBEAT")[-1]
    link.run(3.0)
    later = link.app.of("HEARTBEAT")[-1]
    assert (first.type, first.autopilot, first.base_mode, first.custom_mode) == (2, 12, 0x1D, 0x03040000)
    assert (first.system_status, later.system_status) == (0, 3)


def test_health_bits_turn_good_when_ready(link: Link) -> None:
    link.run(3.0)
    assert link.app.of("SYS_STATUS")[-1].onboard_control_sensors_health & 0x10000020 == 0x20
    assert not link.app.of("SYS_STATUS")[-1].onboard_control_sensors_present & 0x20
    link.run(1.5)
    status = link.app.of("SYS_STATUS")[-1]
    assert status.onboard_control_sensors_health & 0x10000020 == 0x10000020
    assert status.onboard_control_sensors_present & 0x20


def test_a_mode_change_gets_two_answers(link: Link) -> None:
    link.run(5.0)
    assert link.command(176, 1.0, 4.0, 3.0) == [ACCEPTED, ACCEPTED]


def test_offboard_without_setpoints_in_the_air_is_accepted_then_rejected(link: Link) -> None:
    link.run(5.0)
    assert link.command(400, 1.0) == [ACCEPTED]
    assert link.command(22) == [ACCEPTED]
    link.run(9.0)
    assert link.command(176, 129.0, 6.0, 0.0) == [ACCEPTED, REJECTED]


def test_a_setpoint_and_a_mode_change_in_one_go_start_offboard(link: Link) -> None:
    link.run(5.0)
    link.command(400, 1.0)
    link.command(22)
    link.run(9.0)
    target = (0, 0, 0, 0, 0, 0, 0.0, 0.0)
    setpoint = link.app.mavlink.set_position_target_local_ned_encode(0, 1, 1, 1, 2552, 1.0, 2.0, -3.0, *target)
    link.app.send(setpoint, link.port)
    assert link.command(176, 129.0, 6.0, 0.0) == [ACCEPTED, ACCEPTED]
    assert link.command(512, 436.0) == [ACCEPTED]
    assert link.app.of("CURRENT_MODE")[-1].custom_mode == 0x00060000


def setpoint_message(link: Link, mask: int, yaw_rad: float, frame: int = 1) -> Any:
    rest = (0, 0, 0, 0, 0, 0, yaw_rad, 0.0)
    return link.app.mavlink.set_position_target_local_ned_encode(0, 1, 1, frame, mask, 1.0, 2.0, -3.0, *rest)


def test_a_setpoint_without_yaw_keeps_the_one_before(link: Link) -> None:
    link.run(5.0)
    link.command(400, 1.0)
    link.command(22)
    link.run(9.0)
    link.app.send(setpoint_message(link, 2552, 1.2), link.port)
    link.command(176, 129.0, 6.0, 0.0)
    link.app.send(setpoint_message(link, 2552 | 0x400, 0.0), link.port)
    link.run(0.1)
    assert link.autopilot.mode is Mode.OFFBOARD
    assert link.autopilot.setpoint is not None
    assert link.autopilot.setpoint.yaw_rad == pytest.approx(1.2)


def test_setpoints_in_another_frame_are_refused_and_said_so_once(link: Link) -> None:
    link.run(1.0)
    for _ in range(3):
        link.app.send(setpoint_message(link, 2552, 0.0, frame=8), link.port)
        link.run(0.05)
    assert not link.autopilot.has_seen_setpoints
    link.run(2.0)
    assert ["frame 8" in text.text for text in link.app.of("STATUSTEXT") if text.chunk_seq == 0] == [True]


def test_a_takeoff_altitude_above_sea_level_is_honoured(link: Link) -> None:
    link.run(5.0)
    link.command(400, 1.0)
    altitude_m = link.autopilot.origin.altitude_m + 7.0
    assert link.command(22, *[float("nan")] * 6, altitude_m) == [ACCEPTED]
    link.run(15.0)
    assert link.autopilot.vehicle.height_m == pytest.approx(7.0, abs=1.0)
    assert not any("default" in text.text for text in link.app.of("STATUSTEXT"))


def test_a_takeoff_altitude_below_the_vehicle_gives_way_to_the_default(link: Link) -> None:
    link.run(5.0)
    link.command(400, 1.0)
    link.command(22, *[float("nan")] * 6, 0.0)
    link.run(12.0)
    assert link.autopilot.vehicle.height_m == pytest.approx(2.5, abs=1.0)


@pytest.mark.parametrize(
    ("command", "params", "answer"),
    [
        (31999, (), UNSUPPORTED),
        (300, (0.0, 0.0), DENIED),
        (512, (148.0,), ACCEPTED),
        (512, (397.0,), ACCEPTED),
        (512, (9999.0,), DENIED),
        (401, (), ACCEPTED),
        (510, (30.0,), ACCEPTED),
        (510, (-1.0,), DENIED),
        (510, (1e9,), DENIED),
        (511, (245.0, 1e6), ACCEPTED),
        (511, (9999.0, 1e6), DENIED),
        (400, (0.0,), ACCEPTED),
        (21, (), ACCEPTED),
        (22, (), ACCEPTED),
        (20, (), ACCEPTED),
    ],
)
def test_answers_on_the_ground(link: Link, command: int, params: tuple[float, ...], answer: int) -> None:
    link.run(5.0)
    assert link.command(command, *params) == [answer]


def test_there_is_no_component_metadata_and_that_is_told(link: Link) -> None:
    link.run(1.0)
    link.command(512, 397.0)
    (told,) = [message for message in link.app.heard if message.get_msgId() == -2]  # pymavlink's mark for a stranger
    raw = bytes(told.get_msgbuf())
    # MAVLink 2 drops the trailing zeros of a payload: of time, checksum and name only the time is left.
    assert int.from_bytes(raw[7:10], "little") == 397
    assert len(raw) == 10 + raw[1] + 2
    assert raw[1] <= 4


def test_reboot_while_armed_is_denied(link: Link) -> None:
    link.run(5.0)
    link.command(400, 1.0)
    assert link.command(246, 1.0) == [DENIED]


def test_home_is_denied_before_there_is_one(link: Link) -> None:
    link.run(0.5)
    assert link.command(512, 242.0) == [DENIED]
    link.run(1.0)
    assert link.command(512, 242.0) == [ACCEPTED]
    assert link.app.of("HOME_POSITION")


def test_a_command_int_is_a_command_too(link: Link) -> None:
    link.run(5.0)
    link.app.send(link.app.mavlink.command_int_encode(1, 1, 0, 400, 0, 0, 1.0, 0.0, 0.0, 0.0, 0, 0, 0.0), link.port)
    link.run(0.1)
    assert link.autopilot.is_armed


def test_messages_for_another_system_are_left_alone(link: Link) -> None:
    link.run(5.0)
    link.app.send(link.app.mavlink.command_long_encode(7, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0), link.port)
    link.run(0.1)
    assert not link.autopilot.is_armed
    assert not link.app.of("COMMAND_ACK")


def test_an_interval_can_be_changed_stopped_and_restored(link: Link) -> None:
    link.run(1.0)
    counts = []
    for interval_us in (50_000.0, -1.0, 0.0):
        link.command(511, 30.0, interval_us)
        n_before = len(link.app.of("ATTITUDE"))
        link.run(2.0)
        counts.append(len(link.app.of("ATTITUDE")) - n_before)
    assert counts == [pytest.approx(40, abs=1), 0, pytest.approx(200, abs=2)]


def test_parameters_are_read_by_name_and_integers_travel_bytewise(link: Link) -> None:
    (altitude,) = link.read_parameter("MIS_TAKEOFF_ALT")
    assert (altitude.param_value, altitude.param_type) == (2.5, 9)
    (action,) = link.read_parameter("COM_LOW_BAT_ACT")
    assert action.param_type == 6
    assert struct.unpack("<i", struct.pack("<f", action.param_value))[0] == 3
    assert link.read_parameter("NO_SUCH_PARAM") == []


def test_parameters_are_written_in_their_type_only(link: Link) -> None:
    as_float = struct.unpack("<f", struct.pack("<i", 3))[0]
    link.app.send(link.app.mavlink.param_set_encode(1, 1, b"COM_OBL_RC_ACT", as_float, 6), link.port)
    link.app.send(link.app.mavlink.param_set_encode(1, 1, b"MIS_TAKEOFF_ALT", 12.0, 9), link.port)
    link.app.send(link.app.mavlink.param_set_encode(1, 1, b"COM_OF_LOSS_T", as_float, 6), link.port)
    link.run(0.02)
    written = [message.param_id for message in link.app.of("PARAM_VALUE")]
    assert written == ["COM_OBL_RC_ACT", "MIS_TAKEOFF_ALT"] * 2  # the answer, and the news of the change
    get = link.autopilot.parameters.get
    assert (get("COM_OBL_RC_ACT"), get("MIS_TAKEOFF_ALT"), get("COM_OF_LOSS_T")) == (3.0, 12.0, 1.0)


@pytest.mark.parametrize("value", [-1.0, 1e9, math.nan])
def test_a_parameter_out_of_range_is_answered_with_the_old_value(link: Link, value: float) -> None:
    link.app.send(link.app.mavlink.param_set_encode(1, 1, b"MPC_TKO_RAMP_T", value, 9), link.port)
    link.run(0.02)
    (answer,) = link.app.of("PARAM_VALUE")
    assert (answer.param_id, answer.param_value) == ("MPC_TKO_RAMP_T", 3.0)
    link.run(2.6)
    assert link.app.of("STATUSTEXT")[0].text.startswith("Refused: parameter MPC_TKO_RAMP_T")


def test_the_whole_list_of_parameters_is_sent(link: Link) -> None:
    link.app.send(link.app.mavlink.param_request_list_encode(1, 1), link.port)
    link.run(0.5)
    indices = [message.param_index for message in link.app.of("PARAM_VALUE")]
    assert indices == list(range(link.app.of("PARAM_VALUE")[0].param_count))


def test_long_texts_come_in_chunks_and_end_in_a_tab(link: Link) -> None:
    link.run(1.0)
    assert link.command(400, 1.0) == [REJECTED]
    link.run(1.5)
    texts = link.app.of("STATUSTEXT")
    assert [(text.text, text.chunk_seq) for text in texts] == [
        ("Arming denied: Resolve system health failures firs", 0),
        ("t\t", 1),
    ]
    assert texts[0].id == texts[1].id


def test_pings_and_timesyncs_are_answered(link: Link) -> None:
    link.run(1.0)
    link.app.send(link.app.mavlink.ping_encode(123, 4, 0, 0), link.port)
    link.app.send(link.app.mavlink.timesync_encode(0, 777), link.port)
    link.run(0.02)
    assert (123, 4, 245, 190) in [
        (ping.time_usec, ping.seq, ping.target_system, ping.target_component) for ping in link.app.of("PING")
    ]
    assert next(sync.tc1 for sync in link.app.of("TIMESYNC") if sync.ts1 == 777) > 0


def test_a_second_station_hears_everything_once_it_speaks(link: Link) -> None:
    other = Station()
    link.run(0.5)
    other.listen()
    assert not other.heard
    other.send(other.mavlink.heartbeat_encode(6, 8, 0, 0, 0), link.port)
    link.run(1.2)
    other.listen()
    kinds = {message.get_type() for message in other.heard}
    other.socket.close()
    assert {"HEARTBEAT", "ATTITUDE", "SYS_STATUS"} <= kinds


def test_garbage_is_survived(link: Link) -> None:
    link.app.socket.sendto(bytes(range(256)), ("127.0.0.1", link.port))
    link.app.socket.sendto(b"\xfd" * 40, ("127.0.0.1", link.port))
    link.run(0.1)
    assert link.command(512, 148.0) == [ACCEPTED]


def test_a_taken_port_is_told_in_a_sentence(link: Link) -> None:
    with pytest.raises(OSError, match="choose another port"):
        UdpLink(MavlinkFace(SimAutopilot()), link.app.port)


def test_a_port_without_one_40_above_is_told_in_a_sentence() -> None:
    with pytest.raises(OSError, match="choose a port up to 65495"):
        UdpLink(MavlinkFace(SimAutopilot()), 65500)


def test_texts_wait_for_a_ground_station_and_old_ones_are_lost(link: Link) -> None:
    link.run(4.0)
    link.beat = lambda: None  # type: ignore[method-assign]
    link.run(3.0)
    for number in range(20):
        link.autopilot.say(Severity.INFO, f"text {number}")
    link.run(1.0)
    assert link.app.of("STATUSTEXT") == []
    del link.beat
    link.beat()
    link.run(0.1)
    assert [text.text for text in link.app.of("STATUSTEXT")] == [f"text {number}\t" for number in range(12, 20)]


def test_sticks_come_by_manual_control(link: Link) -> None:
    link.run(1.0)
    link.app.send(link.app.mavlink.manual_control_encode(1, 600, -300, 500, 100, 0), link.port)
    link.run(0.1)
    sticks = link.autopilot.sticks
    assert sticks is not None
    assert (sticks.pitch, sticks.roll, sticks.throttle, sticks.yaw) == (0.6, -0.3, 0.5, 0.1)
    link.run(1.0)
    assert link.autopilot.sticks is None


def test_a_battery_failure_can_be_injected(link: Link) -> None:
    link.run(1.0)
    assert link.command(420, 100, 1, 0) == [ACCEPTED]
    link.run(3.0)
    assert link.autopilot.battery.remaining < 0.1
    assert link.command(420, 1, 1, 0) == [UNSUPPORTED]
