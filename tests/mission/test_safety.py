"""Safety against a table: every hazard alone, every pair, and every reaction."""

import itertools
from dataclasses import replace

import pytest

from mission.autopilot import FlightMode, LandedState, VehicleState
from mission.build import reactions, safety_limits
from mission.hazards import ComputerView, EyesView, PaceView, SafetyInput, TaskView, find_hazards
from mission.mode_watch import ModeView
from mission.operator import Wish
from mission.plan import SafetyPlan
from mission.safety import (
    FIXED_REACTIONS,
    PAUSES,
    PRIORITY,
    Hazard,
    Reaction,
    decide,
    keep_going_down,
    way_down,
)

LIMITS = safety_limits(SafetyPlan())
REACTIONS = reactions(SafetyPlan())
S = 1_000_000_000
NOW_NS = 100 * S
STATE = VehicleState(
    NOW_NS, 0, 0, -16, 0, 0, 0, 0, 0, 0, FlightMode.OFFBOARD, True, LandedState.IN_AIR, 0.9, is_connected=True
)
TASK = TaskView(1.0, 60.0, needs_line=True, needs_vision=True, is_going_down=False, failure=None)
EYES = EyesView(None, None, None, sight_ns=NOW_NS, line_seen_ns=NOW_NS)
MODES = ModeView(frozenset({FlightMode.OFFBOARD}), is_offboard=True, was_offboard=True)
CALM = SafetyInput(
    now_ns=NOW_NS,
    state=STATE,
    modes=MODES,
    task=TASK,
    eyes=EYES,
    computer=ComputerView(free_disk_bytes=10**10),
    pace=PaceView(),
    fence_breach=None,
    was_armed=True,
    position_bad_s=0.0,
    foreign_setpoint=None,
    tracking=None,
    refusal=None,
    unsafe_setpoint=None,
    internal_error=None,
    is_interrupted=False,
)
HOLDING = replace(STATE, mode=FlightMode.HOLD)
# What makes each hazard stand, and nothing else.
CAUSES = {
    Hazard.TAKEOVER: replace(CALM, state=HOLDING),
    Hazard.AUTOPILOT_FAILSAFE: replace(CALM, state=replace(HOLDING, is_failsafe=True)),
    Hazard.OFFBOARD_REFUSED: replace(CALM, state=HOLDING, modes=replace(MODES, was_offboard=False)),
    Hazard.DISARMED: replace(CALM, state=replace(STATE, is_armed=False)),
    Hazard.LINK_LOST: replace(CALM, state=replace(STATE, is_connected=False)),
    Hazard.TELEMETRY_STALE: replace(CALM, state=replace(STATE, t_ns=98 * S)),
    Hazard.SECOND_CONTROLLER: replace(CALM, foreign_setpoint="another"),
    Hazard.COMMAND_REFUSED: replace(CALM, refusal="no"),
    Hazard.INTERNAL_ERROR: replace(CALM, internal_error="oops"),
    Hazard.SETPOINT_UNSAFE: replace(CALM, unsafe_setpoint="not a number"),
    Hazard.BATTERY_CRITICAL: replace(CALM, state=replace(STATE, battery=0.1)),
    Hazard.POSITION_BAD: replace(CALM, position_bad_s=1.6),
    Hazard.INTERRUPTED: replace(CALM, is_interrupted=True),
    Hazard.OPERATOR_LAND: replace(CALM, wish=Wish.LAND),
    Hazard.OPERATOR_HOLD: replace(CALM, wish=Wish.HOLD),
    Hazard.GEOFENCE: replace(CALM, fence_breach="too far"),
    Hazard.TRACKING_ERROR: replace(CALM, tracking="left behind"),
    Hazard.GUARD_DEAD: replace(CALM, computer=ComputerView(guard_failure="gone")),
    Hazard.CPU_OVERLOAD: replace(CALM, pace=PaceView(0.06, 0.4)),
    Hazard.VISION_DEAD: replace(CALM, eyes=replace(EYES, failure="gone")),
    Hazard.TASK_TIMED_OUT: replace(CALM, task=replace(TASK, age_s=60.1)),
    Hazard.TASK_FAILED: replace(CALM, task=replace(TASK, failure="no line")),
    Hazard.BATTERY_LOW: replace(CALM, state=replace(STATE, battery=0.2)),
    Hazard.CAMERA_GONE: replace(CALM, eyes=replace(EYES, camera_gone="unplugged")),
    Hazard.CAMERA_BLIND: replace(CALM, eyes=replace(EYES, camera_blind="frozen")),
    Hazard.ESTIMATE_STALE: replace(CALM, eyes=replace(EYES, sight_ns=NOW_NS - round(1.1 * S))),
    Hazard.LINE_LOST: replace(CALM, eyes=replace(EYES, line_seen_ns=96 * S)),
    Hazard.TICK_LATE: replace(CALM, pace=PaceView(0.3, 0.01)),
    Hazard.DISK_FULL: replace(CALM, computer=ComputerView(free_disk_bytes=10**8)),
    Hazard.LOG_FAILING: replace(CALM, computer=ComputerView(log_failure="no space")),
    Hazard.MISSION_CHANGED: replace(CALM, computer=ComputerView(mission_change="changed")),
}
EXPECTED_REACTION = {
    Hazard.TAKEOVER: Reaction.GIVE_UP_CONTROL,
    Hazard.AUTOPILOT_FAILSAFE: Reaction.GIVE_UP_CONTROL,
    Hazard.OFFBOARD_REFUSED: Reaction.GIVE_UP_CONTROL,
    Hazard.DISARMED: Reaction.GIVE_UP_CONTROL,
    Hazard.LINK_LOST: Reaction.GIVE_UP_CONTROL,
    Hazard.TELEMETRY_STALE: Reaction.GIVE_UP_CONTROL,
    Hazard.SECOND_CONTROLLER: Reaction.LAND_CLEAR,
    Hazard.COMMAND_REFUSED: Reaction.LAND_CLEAR,
    Hazard.INTERNAL_ERROR: Reaction.LAND_CLEAR,
    Hazard.SETPOINT_UNSAFE: Reaction.LAND_CLEAR,
    Hazard.BATTERY_CRITICAL: Reaction.LAND_CLEAR,
    Hazard.POSITION_BAD: Reaction.HOLD,
    Hazard.INTERRUPTED: Reaction.LAND_CLEAR,
    Hazard.OPERATOR_LAND: Reaction.LAND_CLEAR,
    Hazard.OPERATOR_HOLD: Reaction.HOLD_AND_END,
    Hazard.GEOFENCE: Reaction.RETURN,
    Hazard.TRACKING_ERROR: Reaction.RETURN,
    Hazard.GUARD_DEAD: Reaction.RETURN,
    Hazard.CPU_OVERLOAD: Reaction.RETURN,
    Hazard.VISION_DEAD: Reaction.RETURN,
    Hazard.TASK_TIMED_OUT: Reaction.RETURN,
    Hazard.TASK_FAILED: Reaction.RETURN,
    Hazard.BATTERY_LOW: Reaction.RETURN,
    Hazard.CAMERA_GONE: Reaction.HOLD,
    Hazard.CAMERA_BLIND: Reaction.HOLD,
    Hazard.ESTIMATE_STALE: Reaction.HOLD,
    Hazard.LINE_LOST: Reaction.SEARCH,
    Hazard.TICK_LATE: Reaction.CONTINUE,
    Hazard.DISK_FULL: Reaction.CONTINUE,
    Hazard.LOG_FAILING: Reaction.CONTINUE,
    Hazard.MISSION_CHANGED: Reaction.CONTINUE,
}


def _rank(hazard: Hazard) -> int:
    """What ends a mission goes before what pauses it, and that before what is only noted."""
    reaction = EXPECTED_REACTION[hazard]
    return 2 if reaction is Reaction.CONTINUE else 1 if reaction in PAUSES else 0


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
    reaction = EXPECTED_REACTION[hazard]
    decision = None if reaction is Reaction.CONTINUE else (hazard, reaction)
    assert decide(found, REACTIONS, is_offboard=True) == decision


@pytest.mark.parametrize(("first", "second"), list(itertools.combinations(PRIORITY, 2)))
def test_of_two_hazards_the_graver_reaction_decides_and_then_the_more_urgent(first: Hazard, second: Hazard) -> None:
    decisive = second if _rank(second) < _rank(first) else first
    reaction = EXPECTED_REACTION[decisive]
    decision = None if reaction is Reaction.CONTINUE else (decisive, reaction)
    assert decide({second: "b", first: "a"}, REACTIONS, is_offboard=True) == decision


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
        Reaction.SEARCH,
    )


@pytest.mark.parametrize("hazard", [hazard for hazard in Hazard if EXPECTED_REACTION[hazard] in PAUSES])
def test_nothing_is_paused_while_the_autopilot_flies_by_itself(hazard: Hazard) -> None:
    assert decide({hazard: "x"}, REACTIONS, is_offboard=False) == (hazard, Reaction.LAND_CLEAR)


def test_no_mission_can_change_what_happens_at_a_takeover() -> None:
    hostile = dict.fromkeys(Hazard, Reaction.CONTINUE)
    assert decide({Hazard.TAKEOVER: "x"}, hostile, is_offboard=True) == (Hazard.TAKEOVER, Reaction.GIVE_UP_CONTROL)


GOING_DOWN = replace(TASK, is_going_down=True)
LANDED = replace(STATE, is_armed=False, landed=LandedState.ON_GROUND)


@pytest.mark.parametrize(
    "quiet",
    [
        replace(CALM, task=replace(TASK, needs_line=False), eyes=replace(EYES, line_seen_ns=0)),
        replace(CALM, task=replace(TASK, needs_vision=False), eyes=EyesView("gone", "gone", "dark", 0, 0)),
        replace(CALM, task=GOING_DOWN, fence_breach="too high", tracking="left behind", position_bad_s=9.0),
        replace(CALM, state=replace(STATE, battery=None)),
        replace(CALM, was_armed=False, state=replace(STATE, is_armed=False)),
        replace(CALM, task=GOING_DOWN, state=LANDED),
        replace(CALM, computer=ComputerView(free_disk_bytes=None)),
        replace(CALM, state=replace(STATE, is_failsafe=True)),  # it warns, and goes on in our mode
    ],
)
def test_what_does_not_matter_to_the_task_is_no_hazard(quiet: SafetyInput) -> None:
    assert find_hazards(quiet, LIMITS) == {}


def test_who_falls_has_not_landed() -> None:
    falling = replace(LANDED, v_down_m_s=6.0)
    assert list(find_hazards(replace(CALM, task=GOING_DOWN, state=falling), LIMITS)) == [Hazard.DISARMED]


def test_a_line_is_not_lost_while_nothing_can_be_seen() -> None:
    eyes = replace(EYES, line_seen_ns=0, camera_gone="unplugged")
    assert list(find_hazards(replace(CALM, eyes=eyes), LIMITS)) == [Hazard.CAMERA_GONE]


@pytest.mark.parametrize("reaction", list(Reaction))
@pytest.mark.parametrize("may_be_over_line", [False, True])
def test_we_never_land_on_the_line_unless_told_to(reaction: Reaction, may_be_over_line: bool) -> None:
    resolved = way_down(reaction, may_be_over_line=may_be_over_line)
    if reaction is Reaction.LAND_CLEAR:
        assert resolved is (Reaction.RETURN if may_be_over_line else Reaction.LAND)
    else:
        assert resolved is reaction


def test_what_stands_on_the_ground_cannot_hold() -> None:
    for reaction in Reaction:
        resolved = way_down(reaction, may_be_over_line=False, is_on_ground=True)
        down = (Reaction.HOLD_AND_END, Reaction.LAND_CLEAR)
        assert resolved is (Reaction.LAND if reaction in down else reaction)


@pytest.mark.parametrize("hazard", [Hazard.LINK_LOST, Hazard.TELEMETRY_STALE])
def test_outside_offboard_silence_does_not_help(hazard: Hazard) -> None:
    assert decide({hazard: "x"}, REACTIONS, is_offboard=False) == (hazard, Reaction.LAND_CLEAR)


def test_on_the_way_down_only_who_else_has_it_and_a_way_that_fails_matter() -> None:
    kept = keep_going_down(dict.fromkeys(Hazard, "x"))
    assert set(kept) == {
        Hazard.TAKEOVER,
        Hazard.AUTOPILOT_FAILSAFE,
        Hazard.DISARMED,
        Hazard.TASK_TIMED_OUT,
    }
