"""A pilot's sticks: Position and Altitude mode, taking over, and sticks that go away."""

import math

import pytest

from sitl.failsafes import Failsafe
from sitl.modes import Answer, Mode
from tests.sitl.simulated_flight import Flight

CENTRED = (0.0, 0.0, 0.5, 0.0)
FORWARD = (0.6, 0.0, 0.5, 0.0)
BOTH = 3  # COM_RC_OVERRIDE: automatic modes and offboard
TOOK_OVER = "Pilot took over using sticks"


def offboard(changes: dict[str, float | int] | None = None) -> Flight:
    flight = Flight(changes)
    flight.sticks = CENTRED
    flight.take_off()
    flight.go_offboard()
    flight.run(1.0)
    return flight


def test_who_holds_the_sticks_starts_in_position_mode() -> None:
    flight = Flight()
    flight.run(1.0)
    flight.sticks = CENTRED
    flight.run(0.1)
    assert flight.autopilot.mode is Mode.POSCTL
    flight.autopilot.set_mode(Mode.LOITER)
    flight.run(0.5)
    assert flight.autopilot.mode is Mode.LOITER


def test_position_mode_flies_by_the_sticks_and_holds_when_they_are_centred() -> None:
    flight = offboard()
    assert flight.autopilot.set_mode(Mode.POSCTL) is Answer.ACCEPTED
    flight.target = None
    flight.sticks = (0.55, 0.0, 0.5, 0.0)
    flight.run(8.0)
    assert flight.autopilot.estimate.velocity_m_s[0] == pytest.approx(5.0, abs=0.7)  # half of MPC_VEL_MANUAL
    flight.sticks = CENTRED
    flight.run(5.0)
    stopped = flight.autopilot.estimate.position_m
    flight.run(10.0)
    assert math.dist(flight.autopilot.estimate.position_m, stopped) < 0.6
    flight.sticks = (0.0, 0.0, 1.0, 0.0)
    flight.run(3.0)
    assert flight.autopilot.estimate.velocity_m_s[2] == pytest.approx(-3.0, abs=0.4)


def test_the_sticks_turn_with_the_heading() -> None:
    flight = offboard()
    flight.autopilot.set_mode(Mode.POSCTL)
    flight.sticks = (0.0, 0.0, 0.5, 0.4)  # a third of 150 deg/s past the dead zone
    flight.run(1.8)
    flight.sticks = CENTRED
    flight.run(2.0)
    assert math.degrees(flight.autopilot.vehicle.euler_rad[2]) == pytest.approx(90.0, abs=10.0)
    flight.sticks = FORWARD
    flight.run(3.0)
    north_m_s, east_m_s, _ = flight.autopilot.estimate.velocity_m_s
    assert east_m_s > 4.0 * abs(north_m_s)


def test_altitude_mode_drifts_with_the_wind_and_keeps_its_height() -> None:
    flight = Flight(wind_m_s=4.0)
    flight.sticks = CENTRED
    flight.take_off()
    assert flight.autopilot.set_mode(Mode.ALTCTL) is Answer.ACCEPTED
    before = flight.autopilot.vehicle.position_m
    flight.run(15.0)
    after = flight.autopilot.vehicle.position_m
    assert math.dist(before[:2], after[:2]) > 10.0
    assert after[2] == pytest.approx(before[2], abs=0.8)


@pytest.mark.parametrize("override", [0, 1])
def test_moved_sticks_are_ignored_in_offboard_by_default(override: int) -> None:
    flight = offboard({"COM_RC_OVERRIDE": override})
    flight.sticks = FORWARD
    flight.run(3.0)
    assert flight.autopilot.mode is Mode.OFFBOARD
    assert not flight.has_heard(TOOK_OVER)


def test_moved_sticks_take_over_from_offboard_at_once_when_they_may() -> None:
    flight = offboard({"COM_RC_OVERRIDE": BOTH})
    flight.sticks = (0.2, 0.0, 0.5, 0.0)  # below COM_RC_STICK_OV
    flight.run(1.0)
    assert flight.autopilot.mode is Mode.OFFBOARD
    flight.sticks = FORWARD
    moved_s = flight.autopilot.boot_s
    flight.run(0.5)
    assert flight.autopilot.commander.intended is flight.autopilot.mode is Mode.POSCTL
    assert flight.heard(TOOK_OVER) - moved_s < 0.06
    assert flight.says(TOOK_OVER) == 1


def test_sticks_that_stay_off_centre_do_not_take_over_again() -> None:
    flight = offboard({"COM_RC_OVERRIDE": BOTH})
    flight.sticks = FORWARD
    flight.run(0.5)
    assert flight.autopilot.set_mode(Mode.OFFBOARD) is Answer.ACCEPTED
    flight.run(1.0)
    assert flight.autopilot.mode is Mode.OFFBOARD


@pytest.mark.parametrize(("override", "mode"), [(0, Mode.LOITER), (1, Mode.POSCTL), (2, Mode.LOITER)])
def test_moved_sticks_take_over_from_automatic_modes_by_the_first_bit(override: int, mode: Mode) -> None:
    flight = Flight({"COM_RC_OVERRIDE": override})
    flight.sticks = CENTRED
    flight.take_off()
    flight.sticks = FORWARD
    flight.run(0.5)
    assert flight.autopilot.mode is mode


def test_lost_sticks_hold_then_return() -> None:
    flight = offboard()
    flight.sticks = None
    lost_s = flight.autopilot.boot_s
    flight.run(2.0)
    assert flight.heard("Failsafe activated: entering Hold for 5 seconds") - lost_s == pytest.approx(0.65, abs=0.06)
    assert (flight.autopilot.mode, flight.autopilot.failsafe) == (Mode.LOITER, Failsafe.STICKS_LOSS)
    flight.run(5.0)
    assert flight.autopilot.mode is Mode.RTL


def test_sticks_that_come_back_while_it_holds_end_the_failsafe() -> None:
    flight = offboard()
    flight.sticks = None
    flight.run(2.0)
    flight.sticks = CENTRED
    flight.run(1.0)
    assert (flight.autopilot.mode, flight.autopilot.failsafe) == (Mode.OFFBOARD, None)


def test_lost_sticks_may_be_excepted_in_offboard() -> None:
    flight = offboard({"COM_RCL_EXCEPT": 4})
    flight.sticks = None
    flight.run(8.0)
    assert (flight.autopilot.mode, flight.autopilot.failsafe) == (Mode.OFFBOARD, None)


def test_a_flight_without_sticks_misses_none() -> None:
    flight = Flight()
    flight.take_off()
    flight.go_offboard()
    flight.run(10.0)
    assert (flight.autopilot.mode, flight.autopilot.failsafe) == (Mode.OFFBOARD, None)


def test_sticks_that_are_not_numbers_are_refused() -> None:
    flight = Flight()
    flight.sticks = (math.nan, 0.0, 0.5, 0.0)
    flight.run(1.0)
    assert flight.autopilot.sticks is None
    flight.sticks = (7.0, -7.0, 7.0, -7.0)
    flight.run(0.1)
    sticks = flight.autopilot.sticks
    assert sticks is not None
    assert (sticks.pitch, sticks.roll, sticks.throttle, sticks.yaw) == (1.0, -1.0, 1.0, -1.0)
