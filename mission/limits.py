"""Which setpoints must never be sent, whatever a task wants. Pure."""

import math
from dataclasses import dataclass

from mission.autopilot import Setpoint


@dataclass(frozen=True, slots=True)
class SetpointLimits:
    """The fence around the take-off point, and how far a setpoint may be from the vehicle [m].

    A setpoint may stand beyond the fence by the leash: it runs ahead of the vehicle, whose place the fence is for.
    """

    leash_m: float
    max_distance_m: float
    max_altitude_m: float


LOWEST_M = 0.5
"""Below this only the autopilot's own modes go: to land."""

SINK_MARGIN_M = 1.0
"""A task may sink so far below the height that it began at, or goes to."""


def unsafe(setpoint: Setpoint, start: Setpoint, floor_m: float, limits: SetpointLimits) -> str | None:
    """Why a setpoint must not be sent, in a sentence; None where it may.

    `start` is the take-off point, and `floor_m` the height above it that the task must stay above: below may be the
    line, whatever a task that goes wrong wants.
    """
    if not all(map(math.isfinite, (setpoint.north_m, setpoint.east_m, setpoint.down_m, setpoint.yaw_rad))):
        return "a setpoint was not a number"
    distance_m = math.hypot(setpoint.north_m - start.north_m, setpoint.east_m - start.east_m)
    if distance_m > limits.max_distance_m + limits.leash_m:
        return f"a setpoint was {distance_m:.0f} m from the take-off point, outside the fence"
    altitude_m = start.down_m - setpoint.down_m
    if altitude_m > limits.max_altitude_m + limits.leash_m:
        return f"a setpoint was {altitude_m:.0f} m high, above the fence"
    if altitude_m < floor_m:
        return f"a setpoint was {altitude_m:.1f} m high, but the task has to stay above {floor_m:.1f} m"
    return None


def floor_m(*heights_m: float) -> float:
    """What a task must stay above that begins and ends at these heights above the take-off point [m]."""
    return max(LOWEST_M, min(heights_m) - SINK_MARGIN_M)
