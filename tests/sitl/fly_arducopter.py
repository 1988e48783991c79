"""Real MAVSDK flies an ArduCopter: python -m tests.sitl.fly_arducopter CONNECTION. Run by test_mavsdk_arducopter.

What a companion has to do otherwise than with PX4 is what this program does otherwise than examples/fly_offboard.py.
"""

import asyncio
import math
import sys

from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.offboard import OffboardAsync, PositionNedYaw
from mavsdk.asyncio.plugins.telemetry import FlightMode, LandedState, TelemetryAsync

from examples.fly_offboard import FIND_S, LEG_M, say, until


async def fly(connection: str) -> None:
    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.COMPANION_COMPUTER))
    await mavsdk.add_any_connection(connection)
    system = await mavsdk.first_autopilot(FIND_S)
    assert system is not None
    action, offboard, telemetry = ActionAsync(system), OffboardAsync(system), TelemetryAsync(system)
    # Nothing is streamed until it is asked for, and so health would never turn good.
    await telemetry.set_rate_health(5.0)
    await telemetry.set_rate_position_velocity_ned(20.0)
    await telemetry.set_rate_attitude_euler(20.0)
    await telemetry.set_rate_position(5.0)
    await telemetry.set_rate_landed_state(5.0)
    await until(
        telemetry.subscribe_health(),
        lambda h: h.is_global_position_ok and h.is_home_position_ok and h.is_armable,
        "ready",
    )
    await action.set_takeoff_altitude(8.0)
    await action.arm()
    await action.takeoff()  # MAVSDK goes to GUIDED for it, which it calls OFFBOARD, and which it stays
    await until(telemetry.subscribe_flight_mode(), lambda mode: mode == FlightMode.OFFBOARD, "guided")
    await until(
        telemetry.subscribe_position_velocity_ned(),
        lambda now: now.position.down_m < -7.0 and abs(now.velocity.down_m_s) < 0.3,
        "at height",
    )
    start = (await telemetry.position_velocity_ned()).position
    await offboard.set_position_ned(PositionNedYaw(start.north_m, start.east_m, start.down_m, 0.0))
    await offboard.start()
    target_m = start.north_m + LEG_M
    await offboard.set_position_ned(PositionNedYaw(target_m, start.east_m, start.down_m, 0.0))
    await until(
        telemetry.subscribe_position_velocity_ned(),
        lambda now: math.hypot(now.position.north_m - target_m, now.velocity.north_m_s) < 1.0,
        "20 m north",
    )
    await offboard.stop()
    await until(telemetry.subscribe_flight_mode(), lambda mode: mode == FlightMode.HOLD, "holding")
    await action.land()
    await until(telemetry.subscribe_landed_state(), lambda state: state == LandedState.ON_GROUND, "landed")
    await until(telemetry.subscribe_armed(), lambda is_armed: not is_armed, "disarmed")
    for plugin in (offboard, action, telemetry):
        plugin.destroy()
    mavsdk.destroy()
    say("end")


if __name__ == "__main__":
    asyncio.run(fly(sys.argv[1]))
