"""The simulated PX4 in this process, stepped in time with the wall clock, while a program flies it and dies."""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from drivers.clock import NS_PER_S, ScaledClock
from sitl.autopilot import SimAutopilot
from sitl.mavlink import MavlinkFace
from sitl.modes import Mode
from sitl.parameters import Parameters
from sitl.setup import SETUP
from sitl.udp import UdpLink
from sitl.vehicle import Vehicle
from tests.sitl.test_mavsdk_flight import free_port
from tests.support.command_line import ROOT
from tests.support.flights import START_YAW_RAD

SPEED = 4.0
_STEP_S = 0.004
_STOP_LIMIT_S = 60.0
_SETTLE_S = 3.0
_LAND_LIMIT_S = 40.0
_END_LIMIT_S = 60.0


@dataclass(frozen=True)
class Outcome:
    """What the vehicle did after its program stopped; times are wall time [s] since then.

    `offboard_s` is for how long it stayed in offboard (0: it was not), None if it did not leave it; `died_s` when the
    program was gone; `is_down` whether it stands disarmed on the ground at the end, if that was waited for.
    """

    mode_at_stop: Mode
    offboard_s: float | None
    died_s: float | None
    exit_code: int | None
    words: str
    is_down: bool


class Program:
    """The flying program as a process, and what it said."""

    def __init__(self, port: int, clock: ScaledClock, folder: Path, task: str, how: str) -> None:
        command = [sys.executable, "-m", "tests.over_mavlink.program"]
        arguments = [str(port), str(clock.speed), str(clock.epoch_ns), str(folder), task, how]
        self.process = subprocess.Popen(
            command + arguments, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        self.stopped_ns: int | None = None
        self.words: list[str] = []
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.words.append(line)
            if line.startswith("stopped "):
                self.stopped_ns = int(line.split()[1])

    def close(self) -> str:
        """End it, if it has not ended; returns everything it said."""
        if self.process.poll() is None:
            self.process.kill()
        _, errors = self.process.communicate()
        return "".join(self.words) + errors


def is_down(sim: SimAutopilot) -> bool:
    """Whether the vehicle stands disarmed on the ground."""
    return not sim.is_armed and sim.vehicle.is_on_ground


@dataclass
class Struck:
    """What came of a fault of the vehicle's: how the program ended, in which mode the vehicle was then, and later."""

    words: str
    mode_at_end: Mode
    is_down: bool


def kill_and_resume(folder: Path, mission: str, kill_s: float, away_s: float) -> Struck:
    """Kill -9 a program `kill_s` of flight time after its start, and let another take its journal up `away_s` later."""
    clock = ScaledClock(SPEED, time.monotonic_ns())
    sim = SimAutopilot(Vehicle(yaw_rad=START_YAW_RAD), parameters=Parameters(SETUP), speed=SPEED)
    port = free_port()
    with UdpLink(MavlinkFace(sim), port) as link:
        first = Program(port, clock, folder, mission, "wait")
        _step_until(sim, link, clock, lambda: first.process.poll() is not None or sim.boot_s > kill_s, kill_s)
        words = first.close()
        back_s = sim.boot_s + away_s
        _step_until(sim, link, clock, lambda: sim.boot_s > back_s, away_s)
        second = Program(port, clock, folder, mission, "resume")
        _step_until(sim, link, clock, lambda: second.process.poll() is not None, _END_LIMIT_S)
        words += second.close()
        mode_at_end = sim.mode
    return Struck(words, mode_at_end, is_down(sim))


Strike = Callable[[SimAutopilot, UdpLink], None]
"""Does a fault to the vehicle. Called again and again until the program has ended."""


def strike(folder: Path, task: str, do: Strike) -> Struck:
    """Fly the mission for `task`, do something to the vehicle in it, and see how program and vehicle end."""
    clock = ScaledClock(SPEED, time.monotonic_ns())
    sim = SimAutopilot(Vehicle(yaw_rad=START_YAW_RAD), parameters=Parameters(SETUP), speed=SPEED)
    port = free_port()
    with UdpLink(MavlinkFace(sim), port) as link:
        program = Program(port, clock, folder, task, "wait")
        try:
            _step_until(sim, link, clock, lambda: program.stopped_ns is not None, _STOP_LIMIT_S)
            assert program.stopped_ns is not None, f"the program never came to {task}: {program.close()}"

            def is_over() -> bool:
                do(sim, link)
                return program.process.poll() is not None

            _step_until(sim, link, clock, is_over, _END_LIMIT_S)
            mode_at_end = sim.mode
        finally:
            words = program.close()

        def is_settled() -> bool:
            return is_down(sim) or mode_at_end is sim.mode is Mode.LOITER

        _step_until(sim, link, clock, is_settled, _LAND_LIMIT_S)
    return Struck(words, mode_at_end, is_down(sim))


def observe(folder: Path, task: str, how: str, *, until_landed: bool = False) -> Outcome:
    """Fly to `task`, let the program stop there as `how` says (kill, stop: by a signal), and see what comes of it."""
    clock = ScaledClock(SPEED, time.monotonic_ns())
    sim = SimAutopilot(Vehicle(yaw_rad=START_YAW_RAD), parameters=Parameters(SETUP), speed=SPEED)
    port = free_port()
    signals = {"kill": signal.SIGKILL, "stop": signal.SIGSTOP}
    with UdpLink(MavlinkFace(sim), port) as link:
        program = Program(port, clock, folder, task, "wait" if how in signals else how)
        try:
            _step_until(sim, link, clock, lambda: program.stopped_ns is not None, _STOP_LIMIT_S)
            stopped_ns = program.stopped_ns
            if stopped_ns is None:
                raise AssertionError(f"the program never came to {task}: {program.close()}")
            if how in signals:
                stopped_ns = time.monotonic_ns()
                os.kill(program.process.pid, signals[how])
            mode_at_stop = sim.mode
            left_ns = stopped_ns if sim.mode is not Mode.OFFBOARD else None
            died_ns = None
            began_ns = time.monotonic_ns()

            def look() -> bool:
                nonlocal left_ns, died_ns
                now_ns = time.monotonic_ns()
                if left_ns is None and sim.mode is not Mode.OFFBOARD:
                    left_ns = now_ns
                if died_ns is None and program.process.poll() is not None:
                    died_ns = now_ns
                is_settled = now_ns - began_ns > _SETTLE_S * NS_PER_S
                return is_settled and (not until_landed or not sim.is_armed)

            _step_until(sim, link, clock, look, _LAND_LIMIT_S)
        finally:
            words = program.close()
    return Outcome(
        mode_at_stop,
        None if left_ns is None else (left_ns - stopped_ns) / NS_PER_S,
        None if died_ns is None else (died_ns - stopped_ns) / NS_PER_S,
        program.process.returncode,
        words,
        is_down(sim),
    )


def _step_until(
    sim: SimAutopilot, link: UdpLink, clock: ScaledClock, is_over: Callable[[], bool], limit_s: float
) -> None:
    limit_ns = time.monotonic_ns() + round(limit_s * NS_PER_S)
    while not is_over() and time.monotonic_ns() < limit_ns:
        due_s = (clock.now_ns() - clock.epoch_ns) / NS_PER_S
        if due_s - sim.boot_s > 1.0:  # a machine that was away for a while does not make up for it
            sim.boot_s = due_s
        while sim.boot_s + _STEP_S <= due_s:
            sim.step(_STEP_S)
            link.service()
        time.sleep(0.001)
