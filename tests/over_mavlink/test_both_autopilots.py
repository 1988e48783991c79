"""The same mission file flies unchanged with PX4 and with ArduCopter, by real MAVSDK."""

import multiprocessing
import subprocess
import sys
import time
from pathlib import Path

import pytest

from drivers.clock import ScaledClock
from sitl.place import Origin
from sitl.pose import PoseBlock
from sitl.server import AutopilotName, SitlSettings, run
from sitl.setup import SETUP
from tests.sitl.test_mavsdk_flight import free_port
from tests.support.command_line import ROOT
from tests.support.flights import START_YAW_RAD

pytestmark = pytest.mark.real_time

SPEED = 4.0


@pytest.mark.parametrize("autopilot", ["px4", "arducopter"])
def test_follow_line_flies_unchanged(autopilot: AutopilotName, tmp_path: Path) -> None:
    port, context = free_port(), multiprocessing.get_context("spawn")
    stop, pose_block, clock = context.Event(), PoseBlock.create(), ScaledClock(SPEED, time.monotonic_ns())
    parameters = tuple(SETUP.items()) if autopilot == "px4" else ()
    settings = SitlSettings(port, 1, 0.0, clock, START_YAW_RAD, Origin(), pose_block.name, parameters, autopilot)
    vehicle = context.Process(target=run, args=(settings, stop.is_set))
    vehicle.start()
    try:
        program = [sys.executable, "-m", "tests.over_mavlink.program"]
        arguments = [str(port), str(SPEED), str(clock.epoch_ns), str(tmp_path), "missions/follow_line.yaml", "wait"]
        flown = subprocess.run(program + arguments, cwd=ROOT, capture_output=True, text=True, check=False, timeout=180)
        pose = pose_block.read()
    finally:
        stop.set()
        vehicle.join(10)
        vehicle.kill()
        pose_block.close()
    assert "ended completed landed and disarmed" in flown.stdout, flown.stdout + flown.stderr
    assert pose is not None
    assert (pose.north_m, pose.east_m, pose.down_m) == pytest.approx((0.0, 0.0, 0.0), abs=2.0)
