"""Safety: from what is observed to events, and from events to the one reaction that counts. Pure functions.

docs/safety.md explains the table. A takeover by the pilot outranks everything and is never fought.
"""

import enum
import math
from collections.abc import Mapping
from dataclasses import dataclass

from drivers.clock import NS_PER_S
from mission.autopilot import FlightMode, VehicleState


class Reaction(enum.StrEnum):
    """What the executive does about an event, mildest first."""

    CONTINUE = "continue"
    RETURN = "return"
    LAND_CLEAR = "land_clear"
    LAND = "land"
    GIVE_UP_CONTROL = "give_up_control"


class Hazard(enum.StrEnum):
    """Everything that safety watches for."""

    TAKEOVER = "takeover"
    DISARMED = "disarmed"
    LINK_LOST = "link_lost"
    TELEMETRY_STALE = "telemetry_stale"
    COMMAND_REFUSED = "command_refused"
    INTERNAL_ERROR = "internal_error"
    BATTERY_CRITICAL = "battery_critical"
    INTERRUPTED = "interrupted"
    GEOFENCE = "geofence"
    VISION_DEAD = "vision_dead"
    TASK_TIMED_OUT = "task_timed_out"
    TASK_FAILED = "task_failed"
    BATTERY_LOW = "battery_low"
    LINE_LOST = "line_lost"


PRIORITY: tuple[Hazard, ...] = tuple(Hazard)
"""The most urgent first: when several hazards stand at once, the first of this order decides."""

FIXED_REACTIONS: Mapping[Hazard, Reaction] = {
    # The pilot has the vehicle.
    Hazard.TAKEOVER: Reaction.GIVE_UP_CONTROL,
    # A kill switch, or the autopilot: whoever arms again must not meet our setpoints.
    Hazard.DISARMED: Reaction.GIVE_UP_CONTROL,
    # Nothing we send arrives, or nothing tells us what it does: the autopilot's own failsafe acts when we fall silent.
    Hazard.LINK_LOST: Reaction.GIVE_UP_CONTROL,
    Hazard.TELEMETRY_STALE: Reaction.GIVE_UP_CONTROL,
    # The autopilot or we cannot do what the mission needs, but the vehicle still obeys the simplest commands.
    Hazard.COMMAND_REFUSED: Reaction.LAND_CLEAR,
    Hazard.INTERNAL_ERROR: Reaction.LAND_CLEAR,
}
"""The reactions that no mission file can change; the others stand in the plan's safety.reactions."""


@dataclass(frozen=True, slots=True)
class SafetyLimits:
    """The limits that the observation is held against; distances from the take-off point, battery 0 to 1."""

    max_distance_m: float
    max_altitude_m: float
    line_lost_s: float
    telemetry_stale_s: float
    battery_low: float
    battery_critical: float


@dataclass(frozen=True, slots=True)
class SafetyInput:
    """What safety looks at in one tick. Distances are from the take-off point, times are flight time.

    `allowed_modes` are the flight modes that our own last command explains, and `is_going_down` says that it was to
    land or to return; `was_armed` that the vehicle was seen armed in this flight. `needs_line` is true for tasks that
    steer by the line, and `line_seen_ns` is the capture time of the newest estimate, or the task's start before the
    first. `task_failure`, `refusal` (of a command, by the autopilot) and `internal_error` are sentences, None where all
    is well.
    """

    now_ns: int
    state: VehicleState
    allowed_modes: frozenset[FlightMode]
    distance_m: float
    altitude_m: float
    was_armed: bool
    is_going_down: bool
    task_age_s: float
    task_limit_s: float
    needs_line: bool
    line_seen_ns: int
    needs_vision: bool
    vision_failure: str | None
    task_failure: str | None
    refusal: str | None
    internal_error: str | None
    is_interrupted: bool


def find_hazards(seen: SafetyInput, limits: SafetyLimits) -> dict[Hazard, str]:
    """Every hazard that stands now, most urgent first, each with a sentence for a person."""
    state = seen.state
    age_s = (seen.now_ns - state.t_ns) / NS_PER_S
    unseen_s = (seen.now_ns - seen.line_seen_ns) / NS_PER_S
    battery = math.inf if state.battery is None else state.battery
    found: dict[Hazard, str] = {}
    if state.mode not in seen.allowed_modes:
        found[Hazard.TAKEOVER] = f"the vehicle is in {state.mode} mode, which our last command does not explain"
    if seen.was_armed and not state.is_armed and not seen.is_going_down:
        found[Hazard.DISARMED] = "the vehicle was disarmed in mid-mission"
    if not state.is_connected:
        found[Hazard.LINK_LOST] = "the autopilot's heartbeat is missing"
    elif age_s > limits.telemetry_stale_s:
        found[Hazard.TELEMETRY_STALE] = f"the newest position is {age_s:.1f} s old"
    if seen.refusal is not None:
        found[Hazard.COMMAND_REFUSED] = seen.refusal
    if seen.internal_error is not None:
        found[Hazard.INTERNAL_ERROR] = seen.internal_error
    if battery <= limits.battery_critical:
        found[Hazard.BATTERY_CRITICAL] = f"the battery is at {battery:.0%}"
    if seen.is_interrupted:
        found[Hazard.INTERRUPTED] = "the operator asked to stop"
    if seen.is_going_down:
        pass  # the autopilot chooses its own way home, and RTL_RETURN_ALT may lie above the fence
    elif seen.distance_m > limits.max_distance_m:
        found[Hazard.GEOFENCE] = (
            f"{seen.distance_m:.0f} m from the take-off point, allowed are {limits.max_distance_m:g} m"
        )
    elif seen.altitude_m > limits.max_altitude_m:
        found[Hazard.GEOFENCE] = f"{seen.altitude_m:.0f} m high, allowed are {limits.max_altitude_m:g} m"
    if seen.needs_vision and seen.vision_failure is not None:
        found[Hazard.VISION_DEAD] = seen.vision_failure
    if seen.task_age_s > seen.task_limit_s:
        found[Hazard.TASK_TIMED_OUT] = f"the task took longer than {seen.task_limit_s:g} s"
    if seen.task_failure is not None:
        found[Hazard.TASK_FAILED] = seen.task_failure
    if limits.battery_critical < battery <= limits.battery_low:
        found[Hazard.BATTERY_LOW] = f"the battery is at {battery:.0%}"
    if seen.needs_line and unseen_s > limits.line_lost_s:
        found[Hazard.LINE_LOST] = f"no line seen for {unseen_s:.1f} s"
    return {hazard: found[hazard] for hazard in PRIORITY if hazard in found}


def decide(
    hazards: Mapping[Hazard, str], reactions: Mapping[Hazard, Reaction], *, is_offboard: bool
) -> tuple[Hazard, Reaction] | None:
    """The hazard that decides and its reaction; None when nothing has to be done.

    `reactions` are the mission's; FIXED_REACTIONS go before them. A hazard whose reaction is to continue never hides
    one that asks for more. Outside offboard the autopilot does not miss us: a lost link is then answered by trying to
    bring the vehicle down.
    """
    for hazard in PRIORITY:
        if hazard in hazards:
            reaction = FIXED_REACTIONS[hazard] if hazard in FIXED_REACTIONS else reactions[hazard]
            if hazard in (Hazard.LINK_LOST, Hazard.TELEMETRY_STALE) and not is_offboard:
                reaction = Reaction.LAND_CLEAR
            if reaction is not Reaction.CONTINUE:
                return hazard, reaction
    return None


def keep_going_down(hazards: Mapping[Hazard, str]) -> dict[Hazard, str]:
    """The hazards that still matter once the vehicle is on its way down: the others have had their reaction."""
    matters = (Hazard.TAKEOVER, Hazard.INTERNAL_ERROR, Hazard.TASK_TIMED_OUT)
    return {hazard: words for hazard, words in hazards.items() if hazard in matters}


def way_down(reaction: Reaction, *, may_be_over_line: bool) -> Reaction:
    """Resolve LAND_CLEAR: land here, unless the line may be below: then return, which lands where we took off."""
    if reaction is not Reaction.LAND_CLEAR:
        return reaction
    return Reaction.RETURN if may_be_over_line else Reaction.LAND
