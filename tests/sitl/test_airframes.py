"""Every airframe hovers, flies, sags with its battery, and bears whatever it is asked for."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sitl.airframes import AIRFRAMES, F550, GRAVITY_M_S2, X500, Airframe, AirframeError, airframe_of
from sitl.autopilot import SimAutopilot
from sitl.battery import Battery
from sitl.modes import Mode
from sitl.vehicle import Vehicle, euler_of
from sitl.wind import Wind

STEP_S = 0.004
STILL = (0.0, 0.0, 0.0)
EVERY = pytest.mark.parametrize("airframe", AIRFRAMES.values(), ids=AIRFRAMES)


def test_they_are_found_by_name_and_the_default_is_the_hexacopter() -> None:
    assert airframe_of("f550") is F550
    assert airframe_of("x500") is X500
    assert Airframe() == F550


def test_an_unknown_name_is_told_with_the_known_ones() -> None:
    with pytest.raises(AirframeError, match=r"no airframe 'x600': choose one of f550, x500\."):
        airframe_of("x600")


@EVERY
def test_it_has_thrust_to_spare_and_a_flight_time_of_its_kind(airframe: Airframe) -> None:
    assert 1.5 < 1 / airframe.hover_thrust < 2.5
    vehicle, battery = Vehicle(airframe), Battery(airframe.pack)
    vehicle.thrust_n = airframe.mass_kg * GRAVITY_M_S2
    flown_s = 0.0
    while battery.remaining > 0.2:
        battery.step(1.0, vehicle.power_w)
        flown_s += 1.0
    assert 8.0 < flown_s / 60 < 20.0


def flown(airframe: Airframe, wind_m_s: float = 0.0) -> SimAutopilot:
    """Hovering 10 m up."""
    sim = SimAutopilot(Vehicle(airframe), Wind(wind_m_s, 4), seed=4)
    sim.set_parameter("MIS_TAKEOFF_ALT", 10.0)
    while sim.boot_s < 5.0:
        sim.step(STEP_S)
    sim.arm()
    sim.takeoff()
    while sim.boot_s < 20.0:
        sim.step(STEP_S)
    return sim


@EVERY
def test_it_takes_a_step_without_swinging(airframe: Airframe) -> None:
    sim = flown(airframe)
    norths_m, tilts_rad = [], []
    for n in range(round(14.0 / STEP_S)):
        if n % 25 == 0:
            sim.set_position_setpoint(10.0, 0.0, -10.0, 0.0)
            sim.set_mode(Mode.OFFBOARD)
        sim.step(STEP_S)
        norths_m.append(sim.vehicle.position_m[0])
        tilts_rad.append(max(map(abs, euler_of(sim.vehicle.quaternion)[:2])))
    assert max(norths_m) < 12.0
    assert norths_m[-1] == pytest.approx(10.0, abs=0.8)
    assert max(tilts_rad[-500:]) < math.radians(5.0)


@EVERY
def test_it_stays_in_the_wind(airframe: Airframe) -> None:
    sim = flown(airframe, wind_m_s=8.0)
    before = sim.vehicle.position_m
    for _ in range(round(10.0 / STEP_S)):
        sim.step(STEP_S)
    assert math.dist(before, sim.vehicle.position_m) < 2.5


def test_motors_slow_down_by_their_own_lag() -> None:
    vehicle = Vehicle(X500)
    assert X500.motor_slowing_s is not None
    for _ in range(round(X500.motor_time_constant_s / 0.0005)):
        vehicle.step(0.0005, 1.0, STILL, STILL)
    assert vehicle.thrust_n == pytest.approx(X500.max_thrust_n * (1 - math.exp(-1)), rel=0.03)
    vehicle.thrust_n = X500.max_thrust_n
    for _ in range(round(X500.motor_slowing_s / 0.0005)):
        vehicle.step(0.0005, 0.0, STILL, STILL)
    assert vehicle.thrust_n == pytest.approx(X500.max_thrust_n * math.exp(-1), rel=0.03)


def test_a_sagging_battery_limits_the_thrust_by_its_voltages_square() -> None:
    battery = Battery(X500.pack, remaining=0.0)
    battery.step(STEP_S, 250.0)
    share = battery.thrust_share
    assert share == pytest.approx((battery.voltage_v / (4 * 3.7)) ** 2)
    assert 0.6 < share < 0.85
    vehicle = Vehicle(X500)
    vehicle.supply = share
    for _ in range(500):
        vehicle.step(STEP_S, 1.0, STILL, STILL)
    assert vehicle.thrust_n == pytest.approx(share * X500.max_thrust_n, rel=1e-6)


def test_a_full_battery_gives_all_thrust_and_no_more() -> None:
    assert Battery().thrust_share == 1.0


def test_the_autopilot_flies_with_what_the_battery_leaves() -> None:
    sim = flown(F550)
    sim.battery.remaining = 0.0
    for _ in range(250):
        sim.step(STEP_S)
    assert sim.vehicle.supply == sim.battery.thrust_share < 0.9


@EVERY
@settings(max_examples=60)
@given(
    thrust=st.floats(-2.0, 3.0),
    torque=st.tuples(*[st.floats(-5.0, 5.0)] * 3),
    wind=st.tuples(*[st.floats(-60.0, 60.0)] * 3),
    rates=st.tuples(*[st.floats(-30.0, 30.0)] * 3),
    velocity=st.tuples(*[st.floats(-60.0, 60.0)] * 3),
    supply=st.floats(0.0, 1.0),
    dt_s=st.sampled_from([0.001, 0.004, 0.01]),
    is_broken=st.booleans(),
)
def test_at_its_limits_it_stays_a_number(
    airframe, thrust, torque, wind, rates, velocity, supply, dt_s, is_broken
) -> None:  # type: ignore[no-untyped-def]
    vehicle = Vehicle(airframe)
    vehicle.position_m, vehicle.is_on_ground = (0.0, 0.0, -40.0), False
    vehicle.velocity_m_s, vehicle.rates_rad_s, vehicle.supply = velocity, rates, supply
    if is_broken:
        vehicle.crash()
    for n in range(600):
        turned = torque if n % 100 < 50 else tuple(-axis for axis in torque)
        vehicle.step(dt_s, thrust, turned, wind)
    state = (*vehicle.position_m, *vehicle.velocity_m_s, *vehicle.rates_rad_s, *vehicle.quaternion, vehicle.power_w)
    assert all(math.isfinite(value) for value in state)
    assert math.hypot(*vehicle.quaternion) == pytest.approx(1.0, abs=1e-9)
    assert 0.0 <= vehicle.thrust_n <= airframe.max_thrust_n
    # Nothing gains speed without end: gravity, thrust and wind against the drag.
    assert math.hypot(*vehicle.velocity_m_s) < 250.0
    assert math.hypot(*vehicle.rates_rad_s) < 200.0
