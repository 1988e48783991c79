"""A short flight over real MAVLink, at whose port another station throws packets."""

import contextlib
import json
import multiprocessing
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pymavlink.dialects.v20 import all as dialect

from drivers.clock import ScaledClock
from sitl.place import Origin
from sitl.server import SitlSettings, run
from sitl.setup import SETUP

ROOT = Path(__file__).parents[2]
SPEED = 2.5
PER_BURST, BURST_S = 100, 0.01  # a receive buffer holds the packets of two bursts
MISSION = """\
version: 1
name: short
tasks:
  - {task: takeoff, altitude_m: 4}
  - {task: move_forward, distance_m: 5}
  - {task: rotate, angle_deg: 90}
  - {task: hold, duration_s: 10}
  - {task: land}
camera: {width_px: 160, height_px: 120}
"""


@dataclass
class Ended:
    """What became of a flight: what the program said, how it ended, and the last heartbeats of the vehicle."""

    returncode: int = 0
    said: list[dict[str, Any]] = field(default_factory=list)
    err: str = ""
    n_sent: int = 0
    n_lost: int = 0
    heartbeats: list[Any] = field(default_factory=list)

    @property
    def outcome(self) -> dict[str, Any]:
        """The program's last words, once its flight was over."""
        assert self.said, self.err
        assert "result" in self.said[-1], (self.said, self.err)
        return self.said[-1]


@contextlib.contextmanager
def _vehicle(port: int, clock: ScaledClock) -> Iterator[None]:
    """A simulated vehicle in a process of its own."""
    context = multiprocessing.get_context("spawn")
    stop = context.Event()
    settings = SitlSettings(port, 1, 0.0, clock, 0.0, Origin(), None, tuple(SETUP.items()))
    process = context.Process(target=run, args=(settings, stop.is_set))
    process.start()
    try:
        yield
    finally:
        stop.set()
        process.join(10)
        process.kill()
        process.join()


def _send(packets: list[bytes], port: int, is_over: threading.Event) -> tuple[int, int]:
    """Send at a pace that the receiver can bear, until all are sent or the flight is over.

    Returns how many were sent, and how many of them found the port's buffer full.
    """
    n_sent = n_lost = 0
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as station:
        while n_sent < len(packets) and not is_over.wait(BURST_S):
            for packet in packets[n_sent : n_sent + PER_BURST]:
                with contextlib.suppress(ConnectionRefusedError):  # the program has let go of the port
                    station.sendto(packet, ("127.0.0.1", port))
                n_sent += 1
            if n_sent % (10 * PER_BURST) == 0:
                n_lost = max(n_lost, _count_lost(port))
    return n_sent, n_lost


def _count_lost(port: int) -> int:
    """The packets that the kernel dropped at a UDP port, because its buffer was full."""
    rows = [line.split() for line in Path("/proc/net/udp").read_text(encoding="ascii").splitlines()[1:]]
    return sum(int(row[-1]) for row in rows if row[1].endswith(f":{port:04X}"))


def _watch(port: int, time_s: float) -> list[Any]:
    """The vehicle's heartbeats of some time [s, wall]."""
    mavlink = dialect.MAVLink(None, srcSystem=255, srcComponent=190)
    mavlink.robust_parsing = True
    heard: list[Any] = []
    end_s = time.monotonic() + time_s
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as station:
        station.settimeout(0.1)
        station.sendto(mavlink.heartbeat_encode(6, 8, 0, 0, 0).pack(mavlink), ("127.0.0.1", port + 40))
        while time.monotonic() < end_s:
            with contextlib.suppress(TimeoutError):
                heard += mavlink.parse_buffer(station.recv(65535)) or []
    return [message for message in heard if message.get_type() == "HEARTBEAT"]


def fly_through(packets: list[bytes], port: int, folder: Path) -> Ended:
    """Fly a short mission; once it is in the air, `packets` come."""
    ended, over = Ended(), threading.Event()
    clock = ScaledClock(SPEED, time.monotonic_ns())
    path = folder / "short.yaml"
    path.write_text(MISSION, encoding="utf-8")
    arguments = [str(path), str(port), f"{clock.speed}", f"{clock.epoch_ns}"]
    with _vehicle(port, clock), ThreadPoolExecutor(1) as pool, (folder / "err.txt").open("w+", errors="replace") as err:
        sending = None
        command = [sys.executable, "-X", "faulthandler", "-m", "tests.link_fuzz.pilot_program", *arguments]
        with subprocess.Popen(
            command, cwd=ROOT, stdout=subprocess.PIPE, stderr=err, text=True, errors="replace", start_new_session=True
        ) as program:
            try:
                assert program.stdout is not None
                for line in program.stdout:
                    with contextlib.suppress(json.JSONDecodeError):  # MAVSDK prints, too
                        ended.said.append(json.loads(line))
                    if "move_forward" in line and sending is None:
                        sending = pool.submit(_send, packets, port, over)
                ended.returncode = program.wait(60)
            finally:
                over.set()
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(program.pid, signal.SIGKILL)
        ended.n_sent, ended.n_lost = (0, 0) if sending is None else sending.result()
        ended.heartbeats = _watch(port, 3.0)
        err.seek(0)
        ended.err = err.read()
    return ended
