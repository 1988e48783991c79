"""Which modes are explained: the old one for a while, the new one from then on, any on the ground."""

from dataclasses import replace

from mission.autopilot import FlightMode, LandedState, VehicleState
from mission.mode_watch import GRACE_S, ModeWatch

S = 1_000_000_000
FLYING = VehicleState(
    0, 0, 0, -16, 0, 0, 0, 0, 0, 0, FlightMode.OFFBOARD, True, LandedState.IN_AIR, 0.9, is_connected=True
)


def test_before_the_first_command_any_mode_is_explained() -> None:
    assert ModeWatch().explained(0, FLYING) == frozenset(FlightMode)


def test_a_command_without_an_answer_leaves_both_modes_explained() -> None:
    watch = ModeWatch()
    watch.announce(FlightMode.TAKEOFF)
    watch.accept(0, FlightMode.TAKEOFF)
    watch.explained(1 * S, replace(FLYING, mode=FlightMode.TAKEOFF))
    watch.announce(FlightMode.OFFBOARD)
    assert watch.explained(60 * S, FLYING) == {FlightMode.TAKEOFF, FlightMode.OFFBOARD}
    assert not watch.is_offboard


def test_the_mode_before_explains_itself_for_the_grace_time_only() -> None:
    watch = ModeWatch()
    watch.accept(0, FlightMode.TAKEOFF, FlightMode.HOLD)
    watch.accept(10 * S, FlightMode.OFFBOARD)
    assert watch.is_offboard
    assert watch.explained(11 * S, FLYING) == {FlightMode.TAKEOFF, FlightMode.HOLD, FlightMode.OFFBOARD}
    assert watch.explained(round((10 + GRACE_S) * S), FLYING) == {FlightMode.OFFBOARD}


def test_two_commands_in_quick_succession_are_both_explained() -> None:
    watch = ModeWatch()
    watch.accept(0, FlightMode.OFFBOARD)
    watch.accept(10 * S, FlightMode.RETURN)
    watch.accept(round(10.5 * S), FlightMode.HOLD)
    assert watch.explained(11 * S, FLYING) == {FlightMode.OFFBOARD, FlightMode.RETURN, FlightMode.HOLD}


def test_on_the_ground_any_mode_is_explained() -> None:
    watch = ModeWatch()
    watch.accept(0, FlightMode.LAND)
    for state in (replace(FLYING, is_armed=False), replace(FLYING, landed=LandedState.ON_GROUND)):
        assert watch.explained(60 * S, state) == frozenset(FlightMode)
