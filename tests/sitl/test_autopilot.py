"""The simulated autopilot behaves as PX4: arming, modes, take-off, offboard, failsafes, landing. Virtual time."""

import math

import pytest

from sitl.autopilot import SimAutopilot
from sitl.failsafes import Failsafe
from sitl.modes import Answer, Landed, Mode
from sitl.vehicle import euler_of
from sitl.wind import Wind
from tests.sitl.simulated_flight import STEP_S, Flight

# --- arming ---


def test_arming_is_refused_until_the_estimator_is_ready() -> None:
    flight = Flight()
    flight.run(2.0)
    assert flight.autopilot.arm() is Answer.TEMPORARILY_REJECTED
    flight.step()
    assert flight.has_heard("Arming denied: Resolve system health failures first")
    flight.run(2.3)
    assert flight.autopilot.arm() is Answer.ACCEPTED
    assert flight.autopilot.is_armed


def test_arming_and_disarming_twice_are_accepted_and_say_nothing_new() -> None:
    flight = Flight()
    flight.run(5.0)
    assert [flight.autopilot.arm(), flight.autopilot.arm()] == [Answer.ACCEPTED] * 2
    assert [flight.autopilot.disarm(), flight.autopilot.disarm()] == [Answer.ACCEPTED] * 2
    flight.step()
    assert [text for _, text in flight.texts] == ["Armed by external command", "Disarmed by external command"]


def test_armed_without_takeoff_it_disarms_after_eleven_seconds() -> None:
    flight = Flight()
    flight.run(5.0)
    flight.autopilot.arm()
    took_s = flight.run_until(lambda: not flight.autopilot.is_armed)
    assert took_s == pytest.approx(11.0, abs=0.1)
    flight.step()
    assert flight.has_heard("Disarmed by auto preflight disarming")


@pytest.mark.parametrize("mode", [Mode.LAND, Mode.RTL, Mode.POSCTL, Mode.MISSION, Mode.OFFBOARD])
def test_disarmed_any_mode_is_accepted_but_a_bad_one_keeps_from_arming(mode: Mode) -> None:
    flight = Flight()
    flight.run(5.0)
    assert flight.autopilot.set_mode(mode) is Answer.ACCEPTED
    assert flight.autopilot.mode is mode
    assert flight.autopilot.arm() is Answer.TEMPORARILY_REJECTED
    assert flight.autopilot.set_mode(Mode.LOITER) is Answer.ACCEPTED
    assert flight.autopilot.arm() is Answer.ACCEPTED


def test_a_takeoff_before_arming_waits_for_it() -> None:
    flight = Flight()
    flight.run(5.0)
    assert flight.autopilot.takeoff() is Answer.ACCEPTED
    flight.run(1.0)
    assert flight.autopilot.landed is Landed.ON_GROUND
    flight.autopilot.arm()
    flight.run_until(lambda: flight.autopilot.mode is Mode.LOITER)
    assert flight.autopilot.landed is Landed.IN_AIR
    assert flight.has_heard("Using default takeoff altitude: 6.0 m")


# --- a flight ---


def test_a_takeoff_goes_through_px4s_stages_and_holds_near_its_altitude() -> None:
    flight = Flight({"MIS_TAKEOFF_ALT": 10.0})
    flight.run(5.0)
    flight.autopilot.arm()
    flight.autopilot.takeoff()
    flight.run_until(lambda: flight.has_heard("Takeoff detected"))
    assert flight.heard("Takeoff detected") - flight.heard("Armed by external command") == pytest.approx(1.8, abs=0.2)
    took_s = flight.run_until(lambda: flight.autopilot.mode is Mode.LOITER)
    assert took_s + 1.8 == pytest.approx(12.0, abs=1.0)
    flight.run(5.0)
    assert flight.modes == [Mode.LOITER, Mode.TAKEOFF, Mode.LOITER]
    assert flight.landed == [Landed.ON_GROUND, Landed.TAKEOFF, Landed.IN_AIR]
    assert flight.autopilot.home is not None
    assert flight.autopilot.home.position_m[2] - flight.autopilot.estimate.position_m[2] == pytest.approx(9.6, abs=0.5)


def test_a_landing_is_detected_and_disarms_two_seconds_later() -> None:
    flight = Flight()
    flight.take_off()
    assert flight.autopilot.land() is Answer.ACCEPTED
    flight.run_until(lambda: not flight.autopilot.is_armed)
    flight.step()
    assert [text for _, text in flight.texts[-3:]] == [
        "Landing at current position",
        "Landing detected",
        "Disarmed by landing",
    ]
    assert flight.heard("Disarmed by landing") - flight.heard("Landing detected") == pytest.approx(2.0, abs=0.05)
    assert flight.landed[-3:] == [Landed.IN_AIR, Landed.LANDING, Landed.ON_GROUND]
    assert flight.modes[-2:] == [Mode.LAND, Mode.LOITER]
    assert flight.autopilot.vehicle.is_on_ground


def test_disarming_in_the_air_is_refused_unless_forced() -> None:
    flight = Flight()
    flight.take_off()
    assert flight.autopilot.disarm() is Answer.TEMPORARILY_REJECTED
    flight.step()
    assert flight.has_heard("Disarming denied: not landed")
    assert flight.autopilot.disarm(is_forced=True) is Answer.ACCEPTED
    flight.run(3.0)
    assert flight.autopilot.vehicle.is_on_ground


def test_hold_stays_in_the_wind() -> None:
    flight = Flight(wind_m_s=5.0)
    flight.take_off()
    flight.run(4.0)
    before = flight.autopilot.vehicle.position_m
    flight.run(10.0)
    assert math.dist(before, flight.autopilot.vehicle.position_m) < 2.0


def test_gusts_drift_past_at_the_speed_through_the_air() -> None:
    class SteadyWind(Wind):
        """Blows 5 m/s northwards and keeps the airspeeds that it was told."""

        def __init__(self) -> None:
            super().__init__(5.0, 0, math.pi)
            self.airspeeds_m_s: list[float] = []

        def step(self, dt_s, height_m, airspeed_m_s, position_ned_m=None) -> tuple[float, float, float]:  # type: ignore[no-untyped-def]
            self.airspeeds_m_s.append(airspeed_m_s)
            return (5.0, 0.0, 0.0)

    wind = SteadyWind()
    autopilot = SimAutopilot(wind=wind)
    for _ in range(3):
        autopilot.step(STEP_S)
    assert wind.airspeeds_m_s == [0.0, 5.0, 5.0]


def test_it_flies_again_after_a_landing() -> None:
    flight = Flight()
    flight.take_off()
    flight.autopilot.land()
    flight.run_until(lambda: not flight.autopilot.is_armed)
    flight.take_off()
    assert flight.autopilot.vehicle.height_m > 4.0


# --- offboard ---


def test_offboard_is_refused_in_the_air_without_a_fresh_stream() -> None:
    flight = Flight()
    flight.take_off()
    assert flight.autopilot.set_mode(Mode.OFFBOARD) is Answer.TEMPORARILY_REJECTED
    flight.autopilot.set_position_setpoint(0.0, 0.0, -6.0, 0.0)
    flight.run(1.2)
    assert flight.autopilot.set_mode(Mode.OFFBOARD) is Answer.TEMPORARILY_REJECTED
    flight.step()
    assert flight.autopilot.mode is Mode.LOITER
    assert flight.has_heard("Switching to Offboard is currently not available")


def test_offboard_flies_to_the_setpoint_and_turns() -> None:
    flight = Flight()
    flight.take_off()
    flight.go_offboard(8.0, -5.0)
    assert flight.target is not None
    flight.target = (*flight.target[:3], -2.0)
    flight.run(12.0)
    assert flight.autopilot.estimate.position_m == pytest.approx(flight.target[:3], abs=0.5)
    assert euler_of(flight.autopilot.estimate.quaternion)[2] == pytest.approx(-2.0, abs=0.05)


def test_an_offboard_takeoff_skips_the_takeoff_state() -> None:
    flight = Flight()
    flight.run(5.0)
    flight.go_offboard()
    assert flight.autopilot.arm() is Answer.ACCEPTED
    assert flight.target is not None
    flight.target = (*flight.target[:2], -5.0, 0.0)
    flight.run_until(lambda: flight.autopilot.vehicle.height_m > 4.5)
    assert flight.landed == [Landed.ON_GROUND, Landed.IN_AIR]


def test_a_nan_setpoint_keeps_what_is() -> None:
    flight = Flight()
    flight.take_off()
    flight.target = (math.nan, math.nan, math.nan, math.nan)
    flight.run(0.1)
    assert flight.autopilot.set_mode(Mode.OFFBOARD) is Answer.ACCEPTED
    before = flight.autopilot.vehicle.position_m
    flight.run(3.0)
    assert math.dist(before, flight.autopilot.vehicle.position_m) < 1.0


def test_a_short_gap_in_the_stream_does_nothing() -> None:
    flight = Flight()
    flight.take_off()
    flight.go_offboard()
    flight.run(1.0)
    target, flight.target = flight.target, None
    flight.run(0.5)
    flight.target = target
    flight.run(3.0)
    assert flight.autopilot.mode is Mode.OFFBOARD
    assert not flight.has_heard("Failsafe activated")


@pytest.mark.parametrize(("action", "mode"), [(3, Mode.RTL), (4, Mode.LAND), (5, Mode.LOITER), (0, Mode.POSCTL)])
def test_a_lost_stream_is_reacted_to_after_a_second_by_the_parameter(action: int, mode: Mode) -> None:
    flight = Flight({"COM_OBL_RC_ACT": action})
    flight.take_off()
    flight.go_offboard()
    flight.run(2.0)
    flight.target = None
    took_s = flight.run_until(lambda: flight.autopilot.failsafe is Failsafe.OFFBOARD_LOSS)
    assert took_s == pytest.approx(1.0, abs=0.1)
    assert flight.autopilot.mode is mode
    assert flight.autopilot.commander.intended is Mode.OFFBOARD
    flight.step()
    assert flight.has_heard("Failsafe activated")


@pytest.mark.parametrize("action", [0, 3, 4])
def test_a_vehicle_left_alone_comes_down_and_disarms(action: int) -> None:
    flight = Flight({"COM_OBL_RC_ACT": action})
    flight.take_off()
    flight.go_offboard()
    flight.run(1.0)
    flight.target = None
    flight.run_until(lambda: not flight.autopilot.is_armed)
    assert flight.autopilot.vehicle.is_on_ground
    assert flight.autopilot.mode is Mode.OFFBOARD
    assert not flight.autopilot.commander.is_armable


def test_at_speed_the_loss_still_takes_a_second_of_wall_time() -> None:
    flight = Flight(speed=5.0)
    flight.take_off()
    flight.go_offboard()
    flight.run(1.0)
    flight.target = None
    assert flight.run_until(lambda: flight.autopilot.failsafe is not None) == pytest.approx(5.0, abs=0.1)


def test_a_stream_that_comes_back_goes_on_offboard() -> None:
    flight = Flight({"COM_OBL_RC_ACT": 5})
    flight.take_off()
    flight.go_offboard()
    flight.run(1.0)
    target, flight.target = flight.target, None
    flight.run(2.0)
    assert flight.autopilot.mode is Mode.LOITER
    flight.target = target
    flight.run(0.5)
    assert flight.autopilot.mode is Mode.OFFBOARD
    assert flight.autopilot.failsafe is None


@pytest.mark.parametrize("mode", [Mode.LOITER, Mode.RTL, Mode.LAND])
def test_another_station_takes_over_at_once(mode: Mode) -> None:
    flight = Flight()
    flight.take_off()
    flight.go_offboard()
    flight.run(1.0)
    assert flight.autopilot.set_mode(mode) is Answer.ACCEPTED
    flight.run(0.1)
    assert flight.autopilot.mode is flight.autopilot.commander.intended is mode
    assert flight.autopilot.failsafe is None


def test_a_mode_for_sticks_is_refused_in_the_air_without_any() -> None:
    flight = Flight()
    flight.take_off()
    assert flight.autopilot.set_mode(Mode.POSCTL) is Answer.TEMPORARILY_REJECTED
    flight.step()
    assert flight.autopilot.mode is Mode.LOITER
    assert flight.has_heard("Switching to Position is currently not available")


# --- return ---


def test_return_from_close_by_flies_home_as_high_as_it_is_and_lands() -> None:
    flight = Flight()
    flight.take_off()
    flight.go_offboard(4.0)
    flight.run(6.0)
    flight.target = None
    assert flight.autopilot.set_mode(Mode.RTL) is Answer.ACCEPTED
    flight.run_until(lambda: flight.autopilot.landed is Landed.LANDING)
    assert math.hypot(*flight.autopilot.vehicle.position_m[:2]) < 2.5
    flight.run_until(lambda: not flight.autopilot.is_armed)
    assert math.hypot(*flight.autopilot.vehicle.position_m[:2]) < 1.0
    texts = [text for _, text in flight.texts]
    assert any(text.startswith("RTL: start return at 49") and "(8 m above destination)" in text for text in texts)
    assert texts[-3:] == ["RTL: land at destination", "Landing detected", "Disarmed by landing"]


def test_return_from_afar_climbs_first() -> None:
    flight = Flight({"RTL_RETURN_ALT": 25.0})
    flight.take_off()
    flight.go_offboard(30.0)
    flight.run(8.0)
    flight.target = None
    flight.autopilot.set_mode(Mode.RTL)
    flight.run_until(lambda: math.hypot(*flight.autopilot.vehicle.position_m[:2]) < 20.0)
    assert flight.autopilot.vehicle.height_m > 23.5
    flight.run_until(lambda: not flight.autopilot.is_armed, within_s=120.0)
    assert math.hypot(*flight.autopilot.vehicle.position_m[:2]) < 1.5


@pytest.mark.parametrize("away_m", [0.0, 5.0])
def test_return_turns_as_home_was_to_land(away_m: float) -> None:
    flight = Flight()
    flight.take_off()
    assert flight.autopilot.home is not None
    home_yaw_rad = flight.autopilot.home.yaw_rad
    flight.go_offboard(away_m)
    assert flight.target is not None
    flight.target = (*flight.target[:3], home_yaw_rad + 2.5)
    flight.run(6.0)
    flight.target = None
    flight.autopilot.set_mode(Mode.RTL)
    flight.run_until(lambda: flight.autopilot.landed is Landed.LANDING)
    flight.run(5.0)
    assert euler_of(flight.autopilot.estimate.quaternion)[2] == pytest.approx(home_yaw_rad, abs=0.05)


@pytest.mark.parametrize("altitude_m", [6.0, 6.25, 6.5, 6.75])
def test_return_announces_its_heights_rounded_up(altitude_m: float) -> None:
    flight = Flight({"MIS_TAKEOFF_ALT": altitude_m})
    flight.take_off()
    assert flight.autopilot.home is not None
    home_down_m, down_m = flight.autopilot.home.position_m[2], flight.autopilot.estimate.position_m[2]
    flight.autopilot.set_mode(Mode.RTL)
    flight.step()
    flight.run(0.1)
    (text,) = [text for _, text in flight.texts if text.startswith("RTL: start")]
    amsl_m, above_m = math.ceil(488.0 - down_m), math.ceil(home_down_m - down_m)
    assert text == f"RTL: start return at {amsl_m} m ({above_m} m above destination)"


# --- battery ---


def test_a_battery_that_runs_low_warns_then_holds_then_returns() -> None:
    flight = Flight()
    flight.take_off()
    flight.go_offboard()
    flight.autopilot.battery.remaining = 0.14
    flight.run(1.0)
    assert flight.has_heard("Low battery")
    assert flight.autopilot.mode is Mode.OFFBOARD
    flight.autopilot.battery.remaining = 0.068
    flight.run(1.0)
    assert flight.has_heard("Failsafe activated: entering Hold for 5 seconds")
    assert (flight.autopilot.mode, flight.autopilot.failsafe) == (Mode.LOITER, Failsafe.BATTERY)
    took_s = flight.run_until(lambda: flight.autopilot.mode is Mode.RTL)
    assert took_s == pytest.approx(4.0, abs=0.2)


def test_an_emergency_level_lands() -> None:
    flight = Flight()
    flight.take_off()
    flight.autopilot.battery.remaining = 0.04
    flight.run_until(lambda: flight.autopilot.mode is Mode.LAND, within_s=6.0)
    assert flight.has_heard("Emergency battery level")


def test_a_low_battery_does_not_arm() -> None:
    flight = Flight()
    flight.autopilot.battery.remaining = 0.05
    flight.run(5.0)
    assert flight.autopilot.arm() is Answer.TEMPORARILY_REJECTED


# --- determinism ---


def test_the_same_seed_gives_the_same_flight() -> None:
    flights = [Flight(wind_m_s=4.0) for _ in range(2)]
    for flight in flights:
        flight.take_off()
    assert flights[0].autopilot.vehicle.position_m == flights[1].autopilot.vehicle.position_m


def test_the_estimate_wanders_by_decimetres_around_the_truth() -> None:
    flight = Flight()
    errors = []
    for _ in range(3000):
        flight.run(0.1)
        errors.append(flight.autopilot.estimate.position_m)
    deviations = [math.sqrt(sum(error[axis] ** 2 for error in errors) / len(errors)) for axis in range(3)]
    assert all(0.03 < deviation < 0.4 for deviation in deviations)
