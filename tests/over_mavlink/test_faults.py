"""Some of the fault matrix over real MAVLink and real MAVSDK; all of it is flown in virtual time by tests/faults."""

from pathlib import Path

import pytest

from sitl.autopilot import SimAutopilot
from sitl.modes import Mode
from sitl.udp import UdpLink
from tests.over_mavlink.observed_flight import strike

pytestmark = pytest.mark.real_time

TASK = "follow_lines"


class Once:
    """Does something to the vehicle the first time it is called."""

    def __init__(self, act: str) -> None:
        self._act = act
        self._is_done = False

    def __call__(self, sim: SimAutopilot, link: UdpLink) -> None:
        if self._is_done:
            return
        self._is_done = True
        if self._act == "pilot_hold":
            sim.set_mode(Mode.LOITER)
        elif self._act == "battery_low":
            sim.battery.remaining = 0.2
        elif self._act == "gps_lost":
            sim.set_parameter("SIM_GPS_USED", 0)
        elif self._act == "uplink_lost":
            link._face.receive = lambda data: None  # type: ignore[method-assign]  # nothing arrives any more
        elif self._act == "kill_switch":
            sim.disarm(is_forced=True)


def second_controller(sim: SimAutopilot, link: UdpLink) -> None:
    n, e, d = sim.estimate.position_m
    sim.set_position_setpoint(n, e, d - 5.0, 0.0)


@pytest.mark.parametrize(
    ("fault", "words", "mode", "is_down"),
    [
        ("pilot_hold", "ended taken_over takeover", Mode.LOITER, False),
        ("kill_switch", "ended failed disarmed", None, True),
        ("battery_low", "ended failed battery low", None, True),
        ("uplink_lost", "ended taken_over autopilot failsafe", Mode.RTL, True),
        ("gps_lost", "ended taken_over autopilot failsafe", Mode.ALTCTL, True),
    ],
)
def test_a_fault_over_mavlink_ends_as_in_the_matrix(
    fault: str, words: str, mode: Mode | None, is_down: bool, tmp_path: Path
) -> None:
    struck = strike(tmp_path, TASK, Once(fault))
    assert words in struck.words
    assert mode in (None, struck.mode_at_end)
    assert struck.is_down == is_down


def test_a_second_controller_over_mavlink_is_noticed(tmp_path: Path) -> None:
    struck = strike(tmp_path, TASK, second_controller)
    assert "ended failed second controller" in struck.words
    assert struck.is_down
