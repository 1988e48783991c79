"""What MAVSDK asks before arming, against the simulated vehicle over UDP."""

import asyncio
import threading
from collections.abc import Iterator

import pytest

from drivers.clock import ScaledClock
from mission.autopilot import AutopilotKind
from mission.autopilot_mavsdk import MavsdkAutopilot
from mission.simulated.scenario import Scenario
from mission.simulated.simulation import free_udp_port, sitl_settings
from sitl.server import run
from sitl.world.file import load_world


@pytest.fixture
def connection() -> Iterator[str]:
    """Where a simulated vehicle is heard, at twice real time."""
    port, stop = free_udp_port(), threading.Event()
    settings = sitl_settings(load_world(None), Scenario(), ScaledClock(2.0), port, None)
    thread = threading.Thread(target=run, args=(settings, stop.is_set))
    thread.start()
    yield f"udpin://127.0.0.1:{port}"
    stop.set()
    thread.join()


def test_it_tells_who_flies_its_parameters_and_its_position(connection: str) -> None:
    async def ask() -> None:
        autopilot = MavsdkAutopilot(connection, ScaledClock(), lambda text: None)
        try:
            await autopilot.connect()
            identity = await autopilot.identify()
            assert (identity.kind, identity.version) == (AutopilotKind.PX4, "1.16.1")
            assert int(identity.uid, 16) > 0
            names = ("COM_OBL_RC_ACT", "MPC_XY_VEL_MAX", "NO_SUCH_NAME")
            assert await autopilot.read_parameters(names) == {"COM_OBL_RC_ACT": 3.0, "MPC_XY_VEL_MAX": 12.0}
            for _ in range(200):
                if autopilot.state is not None and not autopilot.missing_health():
                    break
                await asyncio.sleep(0.1)
            assert autopilot.state is not None
            assert autopilot.state.is_position_ok
        finally:
            await autopilot.close()

    asyncio.run(ask())


def test_a_reading_that_nobody_waits_for_any_more_does_not_outlive_the_link(connection: str) -> None:
    async def ask() -> None:
        autopilot = MavsdkAutopilot(connection, ScaledClock(), lambda text: None)
        await autopilot.connect()
        reading = asyncio.create_task(autopilot.read_parameters(["NO_SUCH_NAME"]))
        await asyncio.sleep(0.5)
        reading.cancel()
        await asyncio.gather(reading, return_exceptions=True)
        began_s = asyncio.get_running_loop().time()
        await autopilot.close()
        assert asyncio.get_running_loop().time() - began_s > 1.0  # MAVSDK asks for 3 s

    asyncio.run(ask())
