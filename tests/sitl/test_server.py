"""The vehicle's process: it keeps to the flight's clock, publishes the truth and lets go of everything."""

import itertools
import math
import socket
import time
from dataclasses import replace

import pytest
from pymavlink.dialects.v20 import all as dialect

from drivers.clock import NS_PER_S, ScaledClock
from sitl.contact import Obstacles
from sitl.place import Origin
from sitl.pose import PoseBlock
from sitl.server import AutopilotName, SitlSettings, SitlSummary, run
from sitl.world.file import load_world

pytestmark = pytest.mark.real_time


class StopAfter:
    """Says stop once the flight's clock has passed `flight_s`."""

    def __init__(self, clock: ScaledClock, flight_s: float) -> None:
        self._clock = clock
        self._end_ns = clock.now_ns() + round(flight_s * NS_PER_S)

    def __call__(self) -> bool:
        return self._clock.now_ns() >= self._end_ns


def settings(clock: ScaledClock, port: int, pose_block: str | None = None) -> SitlSettings:
    return SitlSettings(port, 1, 3.0, clock, 0.8, Origin(0.82, 0.14, 400.0), pose_block)


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def test_it_publishes_the_true_pose_in_flight_time() -> None:
    clock, block = ScaledClock(10.0, time.monotonic_ns()), PoseBlock.create()
    began_ns = clock.now_ns()
    summary = run(settings(clock, free_port(), block.name), StopAfter(clock, 2.0))
    pose = block.read()
    block.close()
    assert pose is not None
    # Never ahead of the clock; how far behind is the machine's business.
    assert began_ns < pose.t_ns <= clock.now_ns()
    assert (pose.north_m, pose.east_m, pose.down_m) == (0.0, 0.0, 0.0)
    assert pose.yaw_rad == pytest.approx(0.8)
    assert 0.0 < summary.simulated_s <= (clock.now_ns() - began_ns) / NS_PER_S


class StalledClock(ScaledClock):
    """Stands still but for one jump of `jump_s` [s], as for a machine that was busy elsewhere."""

    def __init__(self, jump_s: float) -> None:
        super().__init__()
        object.__setattr__(self, "_readings_ns", itertools.chain([0], itertools.repeat(round(jump_s * NS_PER_S))))

    def now_ns(self) -> int:
        return next(self._readings_ns)  # type: ignore[attr-defined]

    def wall_s(self, flight_s: float) -> float:
        return 0.0


@pytest.mark.parametrize(("late_s", "caught_up_s"), [(0.2, 0.2), (10.0, 0.25)])
def test_a_short_delay_is_caught_up_and_a_long_one_forgiven(late_s: float, caught_up_s: float) -> None:
    stops = iter([False] * 20 + [True])
    summary = run(settings(StalledClock(late_s), free_port()), lambda: next(stops))
    assert summary.simulated_s == pytest.approx(caught_up_s, abs=0.005)


def test_the_port_is_free_again_afterwards() -> None:
    clock, port = ScaledClock(10.0, time.monotonic_ns()), free_port()
    for _ in range(2):
        assert run(settings(clock, port), StopAfter(clock, 0.1)).wall_s > 0.0


def test_a_missing_pose_block_is_an_error() -> None:
    clock = ScaledClock()
    with pytest.raises(FileNotFoundError):
        run(settings(clock, free_port(), "no-such-block"), lambda: True)


def test_speed_is_flight_time_over_wall_time() -> None:
    assert SitlSummary(20.0, 5.0).achieved_speed == 4.0
    assert math.isfinite(SitlSummary(0.0, 0.0).achieved_speed)


def test_it_flies_in_the_world_that_is_named_and_says_what_it_came_near_to() -> None:
    clock = ScaledClock(10.0, time.monotonic_ns())
    began_ns = clock.now_ns()
    stops = StopAfter(clock, 30.0)
    there = run(replace(settings(clock, free_port()), world="medium_voltage", airframe="x500"), stops)
    assert there.testimony is not None
    assert there.testimony.contact is None
    assert there.testimony.conductor is not None
    from_the_start_m = Obstacles(load_world("medium_voltage")).clearance((0.0, 0.0, 0.0)).conductor_m
    assert there.testimony.conductor.distance_m == from_the_start_m
    assert began_ns < there.testimony.conductor.t_ns <= clock.now_ns()
    nowhere = run(settings(clock, free_port()), StopAfter(clock, 1.0))
    assert nowhere.testimony is not None
    assert nowhere.testimony.conductor is None


@pytest.mark.parametrize(("autopilot", "number"), [("px4", 12), ("arducopter", 3)])
def test_it_shows_the_face_that_was_asked_for(autopilot: AutopilotName, number: int) -> None:
    clock = ScaledClock(10.0, time.monotonic_ns())
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as application:
        application.bind(("127.0.0.1", 0))
        port = int(application.getsockname()[1])
        run(replace(settings(clock, port), autopilot=autopilot), StopAfter(clock, 1.0))
        application.setblocking(False)
        mavlink = dialect.MAVLink(None)
        heard = [message for _ in range(1000) for message in mavlink.parse_buffer(_datagram(application)) or []]
    (beat, *_) = [message for message in heard if message.get_type() == "HEARTBEAT"]
    assert beat.autopilot == number


def _datagram(application: socket.socket) -> bytes:
    try:
        return application.recv(65535)
    except BlockingIOError:
        return b""
