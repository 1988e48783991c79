"""Real MAVSDK flies the simulated vehicle, and what happens is in the order in which PX4 does it."""

import json
import multiprocessing
import os
import socket
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import all as dialect

from drivers.clock import ScaledClock
from sitl.place import Origin
from sitl.pose import PoseBlock
from sitl.server import SitlSettings, run

pytestmark = pytest.mark.real_time

ROOT = Path(__file__).parents[2]
GOLDEN = json.loads((Path(__file__).parent / "golden" / "px4_a_nominal.json").read_text())
SPEED = 4.0
# What the application commands in flight; the rest depends on when MAVSDK finds the vehicle.
FLIGHT_COMMANDS = (400, 22, 176, 21)


@dataclass
class Flown:
    """A flight as a second station heard it, and what the application printed."""

    returncode: int
    printed: str
    messages: list[Any]
    true_north_m: float

    def of(self, kind: str) -> list[Any]:
        return [message for message in self.messages if message.get_type() == kind]


def free_port() -> int:
    """A UDP port that is free, and so is the one that the simulated autopilot speaks from."""
    while True:
        with (
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one,
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other,
        ):
            one.bind(("127.0.0.1", 0))
            port = int(one.getsockname()[1])
            try:
                other.bind(("127.0.0.1", port + 40))
            except (OSError, OverflowError):
                continue
            return port


def listen(station: socket.socket, mavlink: Any, application: "subprocess.Popen[str]", port: int) -> list[Any]:
    """Hear everything until the application has ended."""
    messages: list[Any] = []
    hello_s = 0.0
    while application.poll() is None:
        if time.monotonic() > hello_s:  # the vehicle's process may still be starting
            station.sendto(mavlink.heartbeat_encode(6, 8, 0, 0, 0).pack(mavlink), ("127.0.0.1", port + 40))
            hello_s = time.monotonic() + 0.2
        try:
            messages += mavlink.parse_buffer(station.recv(65535)) or []
        except TimeoutError:
            continue
    return messages


@pytest.fixture(scope="module")
def flown() -> Flown:
    port, context = free_port(), multiprocessing.get_context("spawn")
    stop, pose_block = context.Event(), PoseBlock.create()
    clock = ScaledClock(SPEED, time.monotonic_ns())
    settings = SitlSettings(port, 1, 0.0, clock, 0.0, Origin(), pose_block.name)
    vehicle = context.Process(target=run, args=(settings, stop.is_set))
    vehicle.start()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as station:
        station.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4_000_000)
        station.settimeout(0.1)
        mavlink = dialect.MAVLink(None, srcSystem=255, srcComponent=190)
        mavlink.robust_parsing = True
        application = subprocess.Popen(
            [sys.executable, str(ROOT / "examples/fly_offboard.py"), "--connection", f"udpin://127.0.0.1:{port}"],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env={**os.environ, "PYTHONPATH": ""},
        )
        try:
            messages = listen(station, mavlink, application, port)
            printed, _ = application.communicate()
            pose = pose_block.read()
        finally:
            application.kill()
            stop.set()
            vehicle.join(10)
            vehicle.kill()
            pose_block.close()
    assert vehicle.exitcode == 0
    return Flown(application.returncode, printed, messages, pose.north_m if pose else 0.0)


def changes(values: list[Any]) -> list[Any]:
    """`values` without repetitions in a row."""
    return [value for n, value in enumerate(values) if n == 0 or value != values[n - 1]]


def test_the_example_flies_to_its_end(flown: Flown) -> None:
    assert flown.returncode == 0, flown.printed
    reached = [line.removeprefix("reached: ") for line in flown.printed.splitlines() if line.startswith("reached: ")]
    assert reached == [
        "healthy and armable",
        "taking off",
        "holding at height",
        "offboard",
        "20 m north",
        "turned by 90 degrees",
        "holding",
        "landed",
        "disarmed",
    ]
    assert flown.true_north_m == pytest.approx(20.0, abs=2.0)


def test_a_flight_that_cannot_begin_ends_in_a_sentence() -> None:
    done = subprocess.run(
        [sys.executable, str(ROOT / "examples/fly_offboard.py"), "--connection", "no-such-link"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    assert "The flight ended early: " in done.stderr
    assert "Traceback" not in done.stderr


def test_modes_and_armed_states_come_in_px4s_order(flown: Flown) -> None:
    ours = changes([[m.custom_mode, m.base_mode, m.system_status] for m in flown.of("HEARTBEAT")])
    recorded = [row[1:] for row in GOLDEN["heartbeats"]]
    # Whether the station hears a heartbeat before the estimator is ready depends on when it joined.
    assert [row for row in ours if row[2] != 0] == [row for row in recorded if row[2] != 0]


def test_landed_states_come_in_px4s_order(flown: Flown) -> None:
    ours = changes([message.landed_state for message in flown.of("EXTENDED_SYS_STATE")])
    assert ours == [state for _, state in GOLDEN["landed_states"]]


def test_commands_get_px4s_answers(flown: Flown) -> None:
    ours = [[m.command, m.result] for m in flown.of("COMMAND_ACK") if m.command in FLIGHT_COMMANDS]
    recorded = [row[1:] for row in GOLDEN["acknowledgements"] if row[1] in FLIGHT_COMMANDS]
    assert ours == recorded[: len(ours)]
    # The recorded application also disarmed the vehicle that had disarmed itself.
    assert recorded[len(ours) :] == [[400, 0]]


def test_status_texts_are_px4s(flown: Flown) -> None:
    assert [[m.severity, m.text] for m in flown.of("STATUSTEXT")] == [row[1:] for row in GOLDEN["status_texts"]]
