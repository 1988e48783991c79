"""Fly a 20 m offboard leg and a quarter turn with MAVSDK: arm, take off, go, turn, land, and wait for the disarm.

Works against PX4 SITL and against lineflight's simulated vehicle, and needs nothing but `mavsdk`:

    python examples/fly_offboard.py --connection udpin://0.0.0.0:14540
"""

import argparse
import asyncio
import contextlib
import math
import sys
from collections.abc import AsyncIterator, Callable
from typing import TypeVar

from mavsdk.asyncio import ComponentType, Configuration, Mavsdk, MavsdkError
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.offboard import OffboardAsync, PositionNedYaw
from mavsdk.asyncio.plugins.telemetry import FlightMode, LandedState, PositionVelocityNed, TelemetryAsync

T = TypeVar("T")

TAKEOFF_M = 10.0
LEG_M = 20.0
FIND_S = 20.0
WAIT_S = 120.0
ANSWER_S = 5.0


def say(text: str) -> None:
    """Tell the person who watches."""
    print(text, flush=True)


async def until(stream: AsyncIterator[T], is_reached: Callable[[T], bool], what: str) -> T:
    """Wait until `stream` says something that is wanted; raises TimeoutError after WAIT_S [s] of wall time."""
    async with asyncio.timeout(WAIT_S):
        async for value in stream:
            if is_reached(value):
                say(f"reached: {what}")
                return value
    raise ConnectionError(f"the stream ended before {what}")


async def fly(connection: str) -> None:
    """Fly the example over a MAVSDK connection URL; raises what MAVSDK raises, ConnectionError and TimeoutError."""
    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.COMPANION_COMPUTER))
    try:
        await mavsdk.add_any_connection(connection)
        system = await mavsdk.first_autopilot(FIND_S)
        if system is None:
            raise ConnectionError(f"no autopilot on {connection} within {FIND_S:.0f} s; start it, or check the port")
        action, offboard, telemetry = ActionAsync(system), OffboardAsync(system), TelemetryAsync(system)
        try:
            await prepare(action, telemetry)
            try:
                await fly_leg_and_turn(action, offboard, telemetry)
                await land(action, telemetry)
            except BaseException:  # Ctrl-C too: whatever it was, nobody is left to fly
                await come_down(action)
                raise
        finally:
            for plugin in (offboard, action, telemetry):
                plugin.destroy()
    finally:
        mavsdk.destroy()


async def prepare(action: ActionAsync, telemetry: TelemetryAsync) -> None:
    """Wait until the vehicle may arm, set it up, and arm it."""
    await until(
        telemetry.subscribe_health(),
        lambda h: h.is_global_position_ok and h.is_home_position_ok and h.is_armable,
        "healthy and armable",
    )
    await telemetry.set_rate_position_velocity_ned(20.0)
    await telemetry.set_rate_battery(2.0)
    await action.set_takeoff_altitude(TAKEOFF_M)
    await action.arm()
    say("armed")


async def fly_leg_and_turn(action: ActionAsync, offboard: OffboardAsync, telemetry: TelemetryAsync) -> None:
    """Take off, fly the leg north, turn, and hold."""
    await action.takeoff()
    await until(telemetry.subscribe_flight_mode(), lambda mode: mode == FlightMode.TAKEOFF, "taking off")
    await until(telemetry.subscribe_flight_mode(), lambda mode: mode == FlightMode.HOLD, "holding at height")

    start = (await telemetry.position_velocity_ned()).position
    yaw_deg = (await telemetry.attitude_euler()).yaw_deg
    await offboard.set_position_ned(PositionNedYaw(start.north_m, start.east_m, start.down_m, yaw_deg))
    await offboard.start()
    # start() may return although the autopilot refused, so its mode is what counts.
    await until(telemetry.subscribe_flight_mode(), lambda mode: mode == FlightMode.OFFBOARD, "offboard")
    north_m = start.north_m + LEG_M
    await offboard.set_position_ned(PositionNedYaw(north_m, start.east_m, start.down_m, yaw_deg))

    def is_there(now: PositionVelocityNed) -> bool:
        return (
            math.hypot(now.position.north_m - north_m, now.position.east_m - start.east_m) < 1.0
            and math.hypot(now.velocity.north_m_s, now.velocity.east_m_s) < 1.0
        )

    await until(telemetry.subscribe_position_velocity_ned(), is_there, f"{LEG_M:.0f} m north")
    turned_deg = yaw_deg + 90.0
    await offboard.set_position_ned(PositionNedYaw(north_m, start.east_m, start.down_m, turned_deg))
    await until(
        telemetry.subscribe_attitude_euler(),
        lambda attitude: abs(math.remainder(attitude.yaw_deg - turned_deg, 360.0)) < 3.0,
        "turned by 90 degrees",
    )
    await offboard.stop()
    await until(telemetry.subscribe_flight_mode(), lambda mode: mode == FlightMode.HOLD, "holding")


async def land(action: ActionAsync, telemetry: TelemetryAsync) -> None:
    """Land, and wait for the disarm."""
    await action.land()
    await until(telemetry.subscribe_landed_state(), lambda state: state == LandedState.ON_GROUND, "landed")
    await until(telemetry.subscribe_armed(), lambda is_armed: not is_armed, "disarmed")


async def come_down(action: ActionAsync) -> None:
    """Hold, then land, as far as the autopilot answers; it goes on landing when nobody listens any more."""
    for order in (action.hold, action.land):
        with contextlib.suppress(MavsdkError, TimeoutError):
            await asyncio.wait_for(order(), ANSWER_S)


def main() -> None:
    """Read the command line and fly; exits with 1 and a sentence when that fails."""
    parser = argparse.ArgumentParser(description="Fly a 20 m offboard leg and a quarter turn with MAVSDK.")
    parser.add_argument("--connection", default="udpin://0.0.0.0:14540", help="MAVSDK connection URL")
    try:
        asyncio.run(fly(parser.parse_args().connection))
    except KeyboardInterrupt:
        sys.exit("The flight was interrupted; the vehicle was told to land if it was armed.")
    except TimeoutError:
        sys.exit(f"The flight ended early: what comes next was not reached within {WAIT_S:.0f} s.")
    except (MavsdkError, ConnectionError) as error:
        sys.exit(f"The flight ended early: {error}.")


if __name__ == "__main__":
    main()
