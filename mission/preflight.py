"""Before arming: connect, and wait until the vehicle can arm and vision sees."""

import asyncio
from collections.abc import Callable

from drivers.clock import Clock
from mission.autopilot import Autopilot, AutopilotError, FlightMode, LandedState, VehicleState
from mission.eyes import Eyes

_POLL_S = 0.2


def not_at_rest(state: VehicleState) -> str | None:
    """Why a vehicle must not be armed by us now, in words; None when it stands disarmed on the ground.

    A vehicle that is armed or in the air is in somebody's hands: arming and take-off would take it from them.
    """
    if state.is_armed:
        return "the vehicle to be disarmed (it is armed: somebody may be flying it)"
    if state.landed is not LandedState.ON_GROUND:
        return "the vehicle to stand on the ground"
    return None


def is_handed_over(state: VehicleState) -> bool:
    """Whether a pilot has left a flying vehicle hovering in hold mode, from where a mission may be resumed."""
    return state.is_armed and state.landed is LandedState.IN_AIR and state.mode is FlightMode.HOLD


async def wait_until_ready(
    autopilot: Autopilot,
    eyes: Eyes,
    clock: Clock,
    time_limit_s: float,
    is_stopped: Callable[[], bool],
    tell: Callable[[tuple[str, ...]], None],
    *,
    may_fly: bool = False,
) -> list[str]:
    """Connect and wait; returns what is still missing after `time_limit_s` [s, wall], empty when all is ready.

    Compiling and connecting take wall time, however fast the flight's clock runs. Returns early when `is_stopped`, and
    when vision or the link has failed for good; `tell` hears what is being waited for.
    """
    loop = asyncio.get_running_loop()
    limit_s = loop.time() + time_limit_s
    connecting = asyncio.create_task(autopilot.connect())
    try:
        while not is_stopped():
            if eyes.failure is not None:
                return [eyes.failure]
            if connecting.done():
                connecting.result()
                missing = _missing(autopilot, eyes, may_fly=may_fly)
            else:
                missing = ["an autopilot on the link"]
            eyes.take()
            tell(tuple(missing))
            if not missing or loop.time() > limit_s:
                return missing
            await asyncio.sleep(clock.wall_s(_POLL_S))
    except AutopilotError as error:
        return [str(error)]
    finally:
        connecting.cancel()
        await asyncio.gather(connecting, return_exceptions=True)
    return ["the operator asked to stop"]


def _missing(autopilot: Autopilot, eyes: Eyes, *, may_fly: bool) -> list[str]:
    missing = autopilot.missing_health()
    state = autopilot.state
    rest = "telemetry" if state is None else not_at_rest(state)
    if may_fly and state is not None and not is_handed_over(state):
        rest = rest and f"{rest}, or to hover in hold mode"
    elif may_fly and rest is not None and state is not None:
        rest = None
    if rest is not None:
        missing.append(rest)
    if eyes.missing is not None:
        missing.append(eyes.missing)
    return missing
