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


def test_the_mode_before_explains_itself_for_the_grace_time_only() -> None:
    watch = ModeWatch()
    watch.command(0, FlightMode.TAKEOFF, FlightMode.HOLD)
    watch.command(10 * S, FlightMode.OFFBOARD)
    assert watch.is_offboard
    assert watch.explained(11 * S, FLYING) == {FlightMode.TAKEOFF, FlightMode.HOLD, FlightMode.OFFBOARD}
    assert watch.explained(round((10 + GRACE_S) * S), FLYING) == {FlightMode.OFFBOARD}


def test_two_commands_in_quick_succession_are_both_explained() -> None:
    watch = ModeWatch()
    watch.command(0, FlightMode.OFFBOARD)
    watch.command(10 * S, FlightMode.RETURN)
    watch.command(round(10.5 * S), FlightMode.HOLD)
    assert watch.explained(11 * S, FLYING) == {FlightMode.OFFBOARD, FlightMode.RETURN, FlightMode.HOLD}


def test_on_the_ground_any_mode_is_explained() -> None:
    watch = ModeWatch()
    watch.command(0, FlightMode.LAND)
    for state in (replace(FLYING, is_armed=False), replace(FLYING, landed=LandedState.ON_GROUND)):
        assert watch.explained(60 * S, state) == frozenset(FlightMode)
