"""A vehicle whose MAVLink system is not number 1, as each has its own where several fly: by real MAVSDK."""

import asyncio
import threading
from collections.abc import Iterator

import pytest

from drivers.clock import ScaledClock
from mission.autopilot_mavsdk import MavsdkAutopilot
from mission.records import ClockSync
from sitl.place import Origin
from sitl.server import AutopilotName, SitlSettings, run
from sitl.setup import SETUP
from tests.sitl.test_mavsdk_flight import free_port

pytestmark = pytest.mark.real_time

SYSTEM_ID = 42


@pytest.fixture(params=["px4", "arducopter"])
def connection(request: pytest.FixtureRequest) -> Iterator[str]:
    """Where vehicle 42 is heard."""
    autopilot: AutopilotName = request.param
    port, stop = free_port(), threading.Event()
    parameters = (*(SETUP.items() if autopilot == "px4" else ()), ("MAV_SYS_ID", SYSTEM_ID))
    settings = SitlSettings(port, 1, 0.0, ScaledClock(), 0.0, Origin(), None, parameters, autopilot)
    vehicle = threading.Thread(target=run, args=(settings, stop.is_set))
    vehicle.start()
    yield f"udpin://127.0.0.1:{port}"
    stop.set()
    vehicle.join()


def test_its_clock_is_asked_and_its_state_heard(connection: str) -> None:
    syncs: list[ClockSync] = []

    async def ask() -> None:
        autopilot = MavsdkAutopilot(connection, ScaledClock(), lambda text: None, syncs.append)
        try:
            await autopilot.connect()
            for _ in range(200):
                if len(syncs) >= 3 and autopilot.state is not None:
                    break
                await asyncio.sleep(0.1)
            assert autopilot.state is not None
        finally:
            await autopilot.close()

    asyncio.run(ask())
    assert len(syncs) >= 3
    apart_ns = [sync.boot_minus_flight_ns for sync in syncs]
    assert max(apart_ns) - min(apart_ns) < 1_000_000_000  # it is one clock, whatever the link's delay
