"""What the autopilot does by itself when GPS goes, a fence is crossed or the battery fails."""

import math

import pytest

from sitl.failsafes import Failsafe
from sitl.modes import Answer, Landed, Mode
from tests.sitl.simulated_flight import Flight

ACTIVATED = "Failsafe activated"


def offboard(changes: dict[str, float | int] | None = None, wind_m_s: float = 0.0) -> Flight:
    flight = Flight(changes, wind_m_s=wind_m_s)
    flight.take_off()
    flight.go_offboard()
    flight.run(1.0)
    return flight


def test_lost_gps_ends_the_position_five_seconds_later_and_its_health_bit_after_seven() -> None:
    flight = offboard()
    autopilot = flight.autopilot
    autopilot.set_parameter("SIM_GPS_USED", 0)
    lost_s = autopilot.boot_s
    flight.run(5.0)
    assert (autopilot.mode, autopilot.is_position_ok) == (Mode.OFFBOARD, True)
    flight.run(1.0)
    assert flight.heard(ACTIVATED) - lost_s == pytest.approx(5.2, abs=0.1)
    assert (autopilot.mode, autopilot.failsafe) == (Mode.ALTCTL, Failsafe.POSITION_LOSS)
    assert autopilot.commander.intended is Mode.OFFBOARD
    assert autopilot.is_position_ok
    assert not autopilot.commander.is_armable
    flight.run(2.0)
    assert not autopilot.is_position_ok


def test_without_a_position_it_comes_down_with_the_wind_and_disarms() -> None:
    flight = offboard({"MIS_TAKEOFF_ALT": 8.0}, wind_m_s=5.0)
    before = flight.autopilot.vehicle.position_m
    flight.autopilot.set_parameter("SIM_GPS_USED", 0)
    flight.run_until(lambda: not flight.autopilot.is_armed)
    assert flight.autopilot.landed is Landed.ON_GROUND
    assert math.dist(before[:2], flight.autopilot.vehicle.position_m[:2]) > 10.0
    assert flight.has_heard("Disarmed by landing")
    assert flight.autopilot.arm() is Answer.TEMPORARILY_REJECTED


@pytest.mark.parametrize("mode", [Mode.LOITER, Mode.RTL])
def test_automatic_modes_land_blind(mode: Mode) -> None:
    flight = offboard()
    flight.target = None
    flight.autopilot.set_mode(mode)
    flight.autopilot.set_parameter("SIM_GPS_USED", 0)
    flight.run(5.5)
    assert (flight.autopilot.mode, flight.autopilot.failsafe) == (Mode.LAND, Failsafe.POSITION_LOSS)
    assert flight.autopilot.set_mode(Mode.LOITER) is Answer.TEMPORARILY_REJECTED
    assert flight.texts[-1][1] == ACTIVATED
    flight.run_until(lambda: not flight.autopilot.is_armed)


def test_a_pilot_flies_on_without_a_position() -> None:
    flight = Flight()
    flight.sticks = (0.0, 0.0, 0.5, 0.0)
    flight.take_off()
    flight.autopilot.set_mode(Mode.POSCTL)
    flight.autopilot.set_parameter("SIM_GPS_USED", 0)
    flight.run(15.0)
    assert (flight.autopilot.mode, flight.autopilot.landed) == (Mode.ALTCTL, Landed.IN_AIR)
    assert flight.autopilot.vehicle.height_m == pytest.approx(6.0, abs=1.2)


def test_gps_that_comes_back_ends_the_failsafe() -> None:
    flight = offboard()
    flight.autopilot.set_parameter("SIM_GPS_USED", 0)
    flight.run(6.0)
    flight.autopilot.set_parameter("SIM_GPS_USED", 10)
    flight.run(2.5)
    assert (flight.autopilot.mode, flight.autopilot.failsafe) == (Mode.OFFBOARD, None)


def test_a_short_loss_of_gps_does_nothing() -> None:
    flight = offboard()
    flight.autopilot.set_parameter("SIM_GPS_USED", 0)
    flight.run(4.0)
    flight.autopilot.set_parameter("SIM_GPS_USED", 10)
    flight.run(10.0)
    assert not flight.has_heard(ACTIVATED)


@pytest.mark.parametrize(
    ("action", "mode"), [(0, Mode.OFFBOARD), (1, Mode.OFFBOARD), (2, Mode.LOITER), (3, Mode.RTL), (5, Mode.LAND)]
)
def test_the_fence_is_reacted_to_by_its_parameter(action: int, mode: Mode) -> None:
    flight = offboard({"GF_ACTION": action, "GF_MAX_HOR_DIST": 8.0})
    flight.go_offboard(north_m=12.0)
    flight.run(4.0)
    assert flight.autopilot.mode is mode
    assert flight.autopilot.failsafe is (None if mode is Mode.OFFBOARD else Failsafe.FENCE)
    assert flight.says(ACTIVATED) == (0 if action == 0 else 1)
    assert flight.has_heard("Maximum distance from home reached (8.00000)") == (action != 0)


def test_the_fence_has_a_ceiling() -> None:
    flight = Flight({"GF_MAX_VER_DIST": 4.0})
    flight.run_until(lambda: flight.autopilot.commander.is_armable)
    flight.autopilot.arm()
    flight.autopilot.takeoff()
    flight.run_until(lambda: flight.autopilot.failsafe is not None)
    assert (flight.autopilot.mode, flight.autopilot.failsafe) == (Mode.LOITER, Failsafe.FENCE)
    flight.run(5.0)
    assert flight.autopilot.vehicle.height_m < 5.5


def test_a_person_may_fly_on_outside_the_fence() -> None:
    flight = offboard({"GF_MAX_HOR_DIST": 8.0})
    flight.go_offboard(north_m=12.0)
    flight.run(4.0)
    assert flight.autopilot.set_mode(Mode.OFFBOARD) is Answer.ACCEPTED
    flight.run(3.0)
    assert (flight.autopilot.mode, flight.autopilot.failsafe) == (Mode.OFFBOARD, None)


def flown_with_a_ground_station(action: int) -> Flight:
    flight = Flight({"NAV_DLL_ACT": action, "COM_DL_LOSS_T": 5})
    flight.take_off()
    flight.go_offboard()
    for _ in range(3):
        flight.autopilot.see_ground_station()
        flight.run(1.0)
    return flight


@pytest.mark.parametrize(("action", "mode"), [(0, Mode.OFFBOARD), (1, Mode.LOITER), (2, Mode.RTL), (3, Mode.LAND)])
def test_a_lost_ground_station_is_reacted_to_by_its_parameter(action: int, mode: Mode) -> None:
    flight = flown_with_a_ground_station(action)
    flight.run(3.5)
    assert flight.autopilot.mode is Mode.OFFBOARD
    flight.run(1.0)
    assert flight.autopilot.mode is (Mode.LOITER if action else Mode.OFFBOARD)
    flight.run(5.0)
    assert flight.autopilot.mode is mode
    assert flight.autopilot.failsafe is (Failsafe.LINK_LOSS if action else None)


def test_a_ground_station_that_comes_back_while_it_holds_ends_the_failsafe() -> None:
    flight = flown_with_a_ground_station(2)
    flight.run(5.0)
    assert flight.autopilot.failsafe is Failsafe.LINK_LOSS
    flight.autopilot.see_ground_station()
    flight.run(0.1)
    assert (flight.autopilot.mode, flight.autopilot.failsafe) == (Mode.OFFBOARD, None)


def test_a_flight_without_a_ground_station_misses_none() -> None:
    flight = offboard({"NAV_DLL_ACT": 2})
    flight.run(15.0)
    assert flight.autopilot.failsafe is None


def test_a_failed_battery_warns_holds_and_lands() -> None:
    flight = offboard()
    flight.autopilot.battery.has_failed = True
    failed_s = flight.autopilot.boot_s
    flight.run(9.0)
    assert flight.heard("Low battery") - failed_s == pytest.approx(1.9, abs=0.2)
    hold_s = flight.heard("Failsafe activated: entering Hold for 5 seconds")
    assert hold_s - failed_s == pytest.approx(2.6, abs=0.2)
    assert (flight.autopilot.mode, flight.autopilot.failsafe) == (Mode.LAND, Failsafe.BATTERY)
    assert flight.has_heard("Emergency battery level")


def test_the_simulated_drain_empties_the_battery_by_the_clock() -> None:
    flight = Flight({"SIM_BAT_DRAIN": 40.0, "SIM_BAT_MIN_PCT": 20.0})
    flight.take_off()
    armed_s = flight.autopilot.boot_s - flight.heard("Armed by external command")
    assert flight.autopilot.battery.remaining == pytest.approx(1 - 0.8 * armed_s / 40.0, abs=0.02)
