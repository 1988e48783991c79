"""Safety against a table: every hazard alone, every pair, and every reaction."""

import itertools
from dataclasses import replace

import pytest

from mission.autopilot import FlightMode, LandedState, VehicleState
from mission.build import reactions, safety_limits
from mission.plan import SafetyPlan
from mission.safety import (
    FIXED_REACTIONS,
    PRIORITY,
    Hazard,
    Reaction,
    SafetyInput,
    decide,
    find_hazards,
    keep_going_down,
    way_down,
)

LIMITS = safety_limits(SafetyPlan())
REACTIONS = reactions(SafetyPlan())
S = 1_000_000_000
STATE = VehicleState(
    100 * S, 0, 0, -16, 0, 0, 0, 0, 0, 0, FlightMode.OFFBOARD, True, LandedState.IN_AIR, 0.9, is_connected=True
)
CALM = SafetyInput(
    now_ns=100 * S,
    state=STATE,
    allowed_modes=frozenset({FlightMode.OFFBOARD}),
    distance_m=10.0,
    altitude_m=16.0,
    was_armed=True,
    is_going_down=False,
    task_age_s=1.0,
    task_limit_s=60.0,
    needs_line=True,
    line_seen_ns=100 * S,
    needs_vision=True,
    vision_failure=None,
    task_failure=None,
    refusal=None,
    internal_error=None,
    is_interrupted=False,
)
# What makes each hazard stand, and nothing else.
CAUSES = {
    Hazard.TAKEOVER: replace(CALM, state=replace(STATE, mode=FlightMode.OTHER)),
    Hazard.DISARMED: replace(CALM, state=replace(STATE, is_armed=False)),
    Hazard.LINK_LOST: replace(CALM, state=replace(STATE, is_connected=False)),
    Hazard.TELEMETRY_STALE: replace(CALM, state=replace(STATE, t_ns=98 * S)),
    Hazard.COMMAND_REFUSED: replace(CALM, refusal="no"),
    Hazard.INTERNAL_ERROR: replace(CALM, internal_error="oops"),
    Hazard.BATTERY_CRITICAL: replace(CALM, state=replace(STATE, battery=0.1)),
    Hazard.INTERRUPTED: replace(CALM, is_interrupted=True),
    Hazard.GEOFENCE: replace(CALM, distance_m=151.0),
    Hazard.VISION_DEAD: replace(CALM, vision_failure="gone"),
    Hazard.TASK_TIMED_OUT: replace(CALM, task_age_s=60.1),
    Hazard.TASK_FAILED: replace(CALM, task_failure="no line"),
    Hazard.BATTERY_LOW: replace(CALM, state=replace(STATE, battery=0.2)),
    Hazard.LINE_LOST: replace(CALM, line_seen_ns=96 * S),
}
EXPECTED_REACTION = {
    Hazard.TAKEOVER: Reaction.GIVE_UP_CONTROL,
    Hazard.DISARMED: Reaction.GIVE_UP_CONTROL,
    Hazard.LINK_LOST: Reaction.GIVE_UP_CONTROL,
    Hazard.TELEMETRY_STALE: Reaction.GIVE_UP_CONTROL,
    Hazard.COMMAND_REFUSED: Reaction.LAND_CLEAR,
    Hazard.INTERNAL_ERROR: Reaction.LAND_CLEAR,
    Hazard.BATTERY_CRITICAL: Reaction.LAND_CLEAR,
    Hazard.INTERRUPTED: Reaction.LAND_CLEAR,
    Hazard.GEOFENCE: Reaction.RETURN,
    Hazard.VISION_DEAD: Reaction.RETURN,
    Hazard.TASK_TIMED_OUT: Reaction.RETURN,
    Hazard.TASK_FAILED: Reaction.RETURN,
    Hazard.BATTERY_LOW: Reaction.RETURN,
    Hazard.LINE_LOST: Reaction.RETURN,
}


def test_a_calm_flight_has_no_hazard() -> None:
    assert find_hazards(CALM, LIMITS) == {}
    assert decide({}, REACTIONS, is_offboard=True) is None


def test_every_hazard_is_in_the_table() -> None:
    assert set(CAUSES) == set(EXPECTED_REACTION) == set(Hazard) == set(PRIORITY)
    assert set(REACTIONS) | set(FIXED_REACTIONS) == set(Hazard)


@pytest.mark.parametrize("hazard", list(Hazard))
def test_each_cause_is_its_hazard_alone_with_the_default_reaction(hazard: Hazard) -> None:
    found = find_hazards(CAUSES[hazard], LIMITS)
    assert list(found) == [hazard]
    assert found[hazard]
    assert decide(found, REACTIONS, is_offboard=True) == (hazard, EXPECTED_REACTION[hazard])


@pytest.mark.parametrize(("first", "second"), list(itertools.combinations(PRIORITY, 2)))
def test_of_two_hazards_the_more_urgent_decides(first: Hazard, second: Hazard) -> None:
    assert decide({second: "b", first: "a"}, REACTIONS, is_offboard=True) == (first, EXPECTED_REACTION[first])


def test_a_takeover_outranks_everything() -> None:
    assert PRIORITY[0] is Hazard.TAKEOVER
    assert decide(dict.fromkeys(Hazard, "x"), REACTIONS, is_offboard=True) == (
        Hazard.TAKEOVER,
        Reaction.GIVE_UP_CONTROL,
    )


def test_continue_never_hides_another_hazard() -> None:
    patient = {**REACTIONS, Hazard.BATTERY_LOW: Reaction.CONTINUE}
    assert decide({Hazard.BATTERY_LOW: "x"}, patient, is_offboard=True) is None
    assert decide({Hazard.BATTERY_LOW: "x", Hazard.LINE_LOST: "y"}, patient, is_offboard=True) == (
        Hazard.LINE_LOST,
        Reaction.RETURN,
    )


def test_no_mission_can_change_what_happens_at_a_takeover() -> None:
    hostile = dict.fromkeys(Hazard, Reaction.CONTINUE)
    assert decide({Hazard.TAKEOVER: "x"}, hostile, is_offboard=True) == (Hazard.TAKEOVER, Reaction.GIVE_UP_CONTROL)


@pytest.mark.parametrize(
    "quiet",
    [
        replace(CALM, needs_line=False, line_seen_ns=0),
        replace(CALM, needs_vision=False, vision_failure="gone"),
        replace(CALM, is_going_down=True, altitude_m=80.0, distance_m=500.0),
        replace(CALM, state=replace(STATE, battery=None)),
        replace(CALM, was_armed=False, state=replace(STATE, is_armed=False)),
        replace(CALM, is_going_down=True, state=replace(STATE, is_armed=False)),
    ],
)
def test_what_does_not_matter_to_the_task_is_no_hazard(quiet: SafetyInput) -> None:
    assert find_hazards(quiet, LIMITS) == {}


def test_height_is_part_of_the_fence() -> None:
    assert list(find_hazards(replace(CALM, altitude_m=61.0), LIMITS)) == [Hazard.GEOFENCE]


@pytest.mark.parametrize("reaction", list(Reaction))
@pytest.mark.parametrize("may_be_over_line", [False, True])
def test_we_never_land_on_the_line_unless_told_to(reaction: Reaction, may_be_over_line: bool) -> None:
    resolved = way_down(reaction, may_be_over_line=may_be_over_line)
    if reaction is Reaction.LAND_CLEAR:
        assert resolved is (Reaction.RETURN if may_be_over_line else Reaction.LAND)
    else:
        assert resolved is reaction


@pytest.mark.parametrize("hazard", [Hazard.LINK_LOST, Hazard.TELEMETRY_STALE])
def test_outside_offboard_silence_does_not_help(hazard: Hazard) -> None:
    assert decide({hazard: "x"}, REACTIONS, is_offboard=False) == (hazard, Reaction.LAND_CLEAR)


def test_on_the_way_down_only_a_takeover_and_a_way_that_fails_matter() -> None:
    kept = keep_going_down(dict.fromkeys(Hazard, "x"))
    assert set(kept) == {Hazard.TAKEOVER, Hazard.INTERNAL_ERROR, Hazard.TASK_TIMED_OUT}
