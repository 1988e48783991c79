"""The vehicle's process: it keeps to the flight's clock, publishes the truth and lets go of everything."""

import math
import socket
import time

import pytest

from drivers.clock import NS_PER_S, ScaledClock
from sitl.pose import PoseBlock
from sitl.server import SitlSettings, SitlSummary, run


class StopAfter:
    """Says stop once the flight's clock has passed `flight_s`."""

    def __init__(self, clock: ScaledClock, flight_s: float) -> None:
        self._clock = clock
        self._end_ns = clock.now_ns() + round(flight_s * NS_PER_S)

    def __call__(self) -> bool:
        return self._clock.now_ns() >= self._end_ns


def settings(clock: ScaledClock, port: int, pose_block: str | None = None) -> SitlSettings:
    return SitlSettings(port, 1, 3.0, clock, 0.8, 47.0, 8.0, 400.0, pose_block)


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


def test_a_clock_that_no_machine_can_follow_shows_in_the_achieved_speed() -> None:
    clock = ScaledClock(1e5, time.monotonic_ns())
    summary = run(settings(clock, free_port()), StopAfter(clock, 2e4))
    assert summary.achieved_speed < 5e4


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
