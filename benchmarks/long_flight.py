"""A flight at 1x for as long as a benchmark wants: all that flies is real, the vehicle simulated, its pack endless."""

import contextlib
import functools
import math
import multiprocessing
import os
import signal
from collections.abc import Iterator
from multiprocessing.synchronize import Event as ProcessEvent
from pathlib import Path

from benchmarks.line_camera import LineCamera
from drivers.clock import ScaledClock
from mission.flight import FlightSetup
from mission.plan_file import MissionFile, read_mission
from mission.simulated.scenario import Scenario
from mission.simulated.simulation import free_udp_port, sitl_settings
from sitl import autopilot
from sitl.battery import Battery
from sitl.pose import PoseBlock
from sitl.server import SitlSettings, run
from sitl.world.file import load_world

_LEG_M, _LEG_S = 30.0, 19.0  # with its turn
_MAX_LEGS = 96  # of the plan's 200 tasks
_HEAD = """\
version: 1
name: long_flight
tasks:
  - {task: takeoff, altitude_m: 5}
  - {task: ascend, altitude_m: 16}
  - {task: move_until}
  - {task: align, turn: right}
"""
_LEG = f"  - {{task: follow_lines, distance_m: {_LEG_M:g}}}\n  - {{task: rotate, angle_deg: 180}}\n"
_TAIL = "  - {task: return}\nvehicle: {battery_wh: 10000}\n"


class EndlessBattery(Battery):
    """A pack that is always full."""

    def step(self, dt_s: float, motor_power_w: float) -> None:
        """Draw, and charge again."""
        super().step(dt_s, motor_power_w)
        self.remaining = 1.0


def write_mission(folder: Path, flight_s: float) -> MissionFile:
    """A mission out and back along the line again and again, for about `flight_s` [s]; half an hour at most."""
    path = folder / "long_flight.yaml"
    n_legs = min(_MAX_LEGS, 2 * math.ceil(flight_s / _LEG_S / 2))
    path.write_text(_HEAD + _LEG * n_legs + _TAIL, encoding="utf-8")
    return read_mission(path)


@contextlib.contextmanager
def long_flight(folder: Path, flight_s: float, rate_hz: float) -> Iterator[FlightSetup]:
    """A simulated vehicle at 1x in its own process, and the setup of a flight with it; `rate_hz` is the camera's."""
    mission = write_mission(folder, flight_s)
    clock, port, poses = ScaledClock(), free_udp_port(), PoseBlock.create()
    context = multiprocessing.get_context("spawn")
    stop = context.Event()
    settings = sitl_settings(load_world(), Scenario(wind_m_s=2.0), clock, port, poses.name)
    vehicle = context.Process(target=_serve, args=(settings, stop), name="vehicle", daemon=True)
    vehicle.start()
    try:
        yield FlightSetup(
            mission=mission,
            connection=f"udpin://127.0.0.1:{port}",
            open_camera=functools.partial(LineCamera, poses.name, mission.camera, rate_hz),
            clock=clock,
            log_folder=folder,
            metadata={"command": "benchmark"},
        )
    finally:
        stop.set()
        vehicle.join(5.0)
        vehicle.kill()
        poses.close()


def _serve(settings: SitlSettings, stop: ProcessEvent) -> None:
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    parent = os.getppid()
    autopilot.Battery = EndlessBattery  # type: ignore[misc]
    run(settings, lambda: stop.is_set() or os.getppid() != parent)
