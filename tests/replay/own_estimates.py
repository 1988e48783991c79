"""Guidance alone, flown again: on what vision told in flight."""

import math

from mission.log.reader import Flight
from mission.plan import MissionPlan
from mission.replay.guidance import ReplayedTick, replay_guidance
from mission.replay.pairing import Moments, moments_of


def replay_own_estimates(flight: Flight, paired: Moments | None = None) -> list[ReplayedTick]:
    """Each tick of a flight with the flight's own estimates; by default paired as the product pairs them."""
    assert flight.camera is not None
    plan = MissionPlan.model_validate_json(flight.attachments["plan.json"])
    moments = moments_of(flight) if paired is None else paired
    return list(replay_guidance(flight, plan, flight.camera, moments.moments))


def distance_m(tick: ReplayedTick) -> float:
    """How far today's setpoint is from the flown one."""
    flown, now = tick.flown, tick.replayed
    return math.dist((flown.north_m, flown.east_m, flown.down_m), (now.north_m, now.east_m, now.down_m))
