"""Safety: the hazards in the order of their urgency, the reactions, and which one counts. Pure.

docs/safety.md explains the table. A takeover by the pilot outranks everything and is never fought. mission.hazards says
when a hazard stands.
"""

import enum
from collections.abc import Mapping


class Reaction(enum.StrEnum):
    """What the executive does about a hazard, mildest first.

    HOLD, CLIMB_AND_HOLD and SEARCH are pauses: the task goes on once the hazard is over. HOLD_AND_END, RETURN,
    LAND_CLEAR and LAND end the mission.
    """

    CONTINUE = "continue"
    HOLD = "hold"
    CLIMB_AND_HOLD = "climb_and_hold"
    SEARCH = "search"
    HOLD_AND_END = "hold_and_end"
    RETURN = "return"
    LAND_CLEAR = "land_clear"
    LAND = "land"
    GIVE_UP_CONTROL = "give_up_control"


PAUSES = (Reaction.HOLD, Reaction.CLIMB_AND_HOLD, Reaction.SEARCH)


class Hazard(enum.StrEnum):
    """Everything that safety watches for, the most urgent first."""

    TAKEOVER = "takeover"
    AUTOPILOT_FAILSAFE = "autopilot_failsafe"
    OFFBOARD_REFUSED = "offboard_refused"
    DISARMED = "disarmed"
    LINK_LOST = "link_lost"
    TELEMETRY_STALE = "telemetry_stale"
    SECOND_CONTROLLER = "second_controller"
    COMMAND_REFUSED = "command_refused"
    INTERNAL_ERROR = "internal_error"
    SETPOINT_UNSAFE = "setpoint_unsafe"
    BATTERY_CRITICAL = "battery_critical"
    POSITION_BAD = "position_bad"
    INTERRUPTED = "interrupted"
    OPERATOR_LAND = "operator_land"
    OPERATOR_HOLD = "operator_hold"
    GEOFENCE = "geofence"
    TRACKING_ERROR = "tracking_error"
    GUARD_DEAD = "guard_dead"
    CPU_OVERLOAD = "cpu_overload"
    VISION_DEAD = "vision_dead"
    TASK_TIMED_OUT = "task_timed_out"
    TASK_FAILED = "task_failed"
    BATTERY_LOW = "battery_low"
    CAMERA_GONE = "camera_gone"
    CAMERA_BLIND = "camera_blind"
    ESTIMATE_STALE = "estimate_stale"
    LINE_LOST = "line_lost"
    TICK_LATE = "tick_late"
    DISK_FULL = "disk_full"
    LOG_FAILING = "log_failing"
    MISSION_CHANGED = "mission_changed"


PRIORITY: tuple[Hazard, ...] = tuple(Hazard)
"""When several hazards stand at once, the first of this order decides."""

FIXED_REACTIONS: Mapping[Hazard, Reaction] = {
    # The pilot has the vehicle, or the autopilot's own failsafe: who takes it back fights them.
    Hazard.TAKEOVER: Reaction.GIVE_UP_CONTROL,
    Hazard.AUTOPILOT_FAILSAFE: Reaction.GIVE_UP_CONTROL,
    # It said yes and stayed where it was: from here that looks like a pilot who was quicker.
    Hazard.OFFBOARD_REFUSED: Reaction.GIVE_UP_CONTROL,
    # A kill switch, or the autopilot: whoever arms again must not meet our setpoints.
    Hazard.DISARMED: Reaction.GIVE_UP_CONTROL,
    # Nothing we send arrives, or nothing tells us what it does: the autopilot's own failsafe acts when we fall silent.
    Hazard.LINK_LOST: Reaction.GIVE_UP_CONTROL,
    Hazard.TELEMETRY_STALE: Reaction.GIVE_UP_CONTROL,
    # Outside offboard nobody's setpoints count, and the vehicle comes home by itself.
    Hazard.SECOND_CONTROLLER: Reaction.LAND_CLEAR,
    # The autopilot or we cannot do what the mission needs, but the vehicle still obeys the simplest commands.
    Hazard.COMMAND_REFUSED: Reaction.LAND_CLEAR,
    Hazard.INTERNAL_ERROR: Reaction.LAND_CLEAR,
    Hazard.SETPOINT_UNSAFE: Reaction.LAND_CLEAR,
    # What the button says is what it does, whatever the mission.
    Hazard.OPERATOR_LAND: Reaction.LAND_CLEAR,
    Hazard.OPERATOR_HOLD: Reaction.HOLD_AND_END,
}
"""The reactions that no mission file can change; the others stand in the plan's safety.reactions."""

_SILENCE = (Hazard.LINK_LOST, Hazard.TELEMETRY_STALE)


def decide(
    hazards: Mapping[Hazard, str], reactions: Mapping[Hazard, Reaction], *, is_offboard: bool
) -> tuple[Hazard, Reaction] | None:
    """The hazard that decides and its reaction; None when nothing has to be done.

    `reactions` are the mission's; FIXED_REACTIONS go before them. A hazard whose reaction is milder never hides one
    that asks for more: what ends the mission goes before what pauses it, and that before what is only noted. Outside
    offboard the autopilot does not miss us, so that a lost link is answered by trying to bring the vehicle down; and
    there nothing is paused, because the autopilot flies its own take-off or landing.
    """
    standing = [
        (hazard, _reaction(hazard, reactions, is_offboard=is_offboard)) for hazard in PRIORITY if hazard in hazards
    ]
    for hazard, reaction in standing:
        if reaction not in (*PAUSES, Reaction.CONTINUE):
            return hazard, reaction
    for hazard, reaction in standing:
        if reaction in PAUSES:
            return hazard, reaction
    return None


def _reaction(hazard: Hazard, reactions: Mapping[Hazard, Reaction], *, is_offboard: bool) -> Reaction:
    reaction = FIXED_REACTIONS.get(hazard) or reactions[hazard]
    if is_offboard:
        return reaction
    return Reaction.LAND_CLEAR if hazard in _SILENCE or reaction in PAUSES else reaction


_MATTERS_ON_THE_WAY_DOWN = (
    Hazard.TAKEOVER,
    Hazard.AUTOPILOT_FAILSAFE,
    Hazard.DISARMED,
    Hazard.TASK_TIMED_OUT,
)


def keep_going_down(hazards: Mapping[Hazard, str]) -> dict[Hazard, str]:
    """The hazards that still matter once the vehicle is on its way down: the others have had their reaction."""
    return {hazard: words for hazard, words in hazards.items() if hazard in _MATTERS_ON_THE_WAY_DOWN}


def way_down(reaction: Reaction, *, may_be_over_line: bool, is_on_ground: bool = False) -> Reaction:
    """Resolve LAND_CLEAR: land here, unless the line may be below: then return, which lands where we took off.

    What has not left the ground cannot hold: HOLD_AND_END lands there, which disarms it.
    """
    if reaction is Reaction.HOLD_AND_END and is_on_ground:
        return Reaction.LAND
    if reaction is not Reaction.LAND_CLEAR:
        return reaction
    return Reaction.RETURN if may_be_over_line else Reaction.LAND
