"""Real MAVSDK flies the vehicle behind its ArduCopter face, from boot to disarmed."""

import multiprocessing
import os
import subprocess
import sys
import time

import pytest

from drivers.clock import ScaledClock
from sitl.place import Origin
from sitl.pose import PoseBlock
from sitl.server import SitlSettings, run
from tests.sitl.test_mavsdk_flight import ROOT, free_port

pytestmark = pytest.mark.real_time

SPEED = 4.0


def test_mavsdk_flies_it_when_it_asks_for_streams() -> None:
    port, context = free_port(), multiprocessing.get_context("spawn")
    stop, pose_block = context.Event(), PoseBlock.create()
    clock = ScaledClock(SPEED, time.monotonic_ns())
    settings = SitlSettings(port, 1, 0.0, clock, 0.0, Origin(), pose_block.name, autopilot="arducopter")
    vehicle = context.Process(target=run, args=(settings, stop.is_set))
    vehicle.start()
    try:
        flown = subprocess.run(
            [sys.executable, "-m", "tests.sitl.fly_arducopter", f"udpin://127.0.0.1:{port}"],
            capture_output=True,
            text=True,
            check=False,
            cwd=ROOT,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
            timeout=120,
        )
        pose = pose_block.read()
    finally:
        stop.set()
        vehicle.join(10)
        vehicle.kill()
        pose_block.close()
    reached = [line.removeprefix("reached: ") for line in flown.stdout.splitlines() if line.startswith("reached: ")]
    wanted = ["ready", "guided", "at height", "20 m north", "holding", "landed", "disarmed"]
    assert (reached, flown.returncode) == (wanted, 0), flown.stdout + flown.stderr
    assert pose is not None
    assert pose.north_m == pytest.approx(20.0, abs=2.0)
