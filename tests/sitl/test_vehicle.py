"""The rigid body obeys mechanics: it falls, hovers, drags, spins and stands."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sitl.vehicle import GRAVITY_M_S2, Airframe, Vehicle, euler_of

STEP_S = 0.004
STILL = (0.0, 0.0, 0.0)


def aloft(airframe: Airframe | None = None) -> Vehicle:
    """A vehicle hovering 50 m up."""
    vehicle = Vehicle(airframe)
    vehicle.position_m = (0.0, 0.0, -50.0)
    vehicle.thrust_n = vehicle.airframe.mass_kg * GRAVITY_M_S2
    vehicle.is_on_ground = False
    return vehicle


def run(vehicle: Vehicle, time_s: float, thrust: float, torque=STILL, wind=STILL) -> None:  # type: ignore[no-untyped-def]
    for _ in range(round(time_s / STEP_S)):
        vehicle.step(STEP_S, thrust, torque, wind)


def test_it_falls_without_thrust() -> None:
    vehicle = aloft(Airframe(linear_drag_1_s=0.0, quadratic_drag_1_m=0.0))
    vehicle.thrust_n = 0.0
    run(vehicle, 1.0, 0.0)
    assert vehicle.velocity_m_s[2] == pytest.approx(GRAVITY_M_S2, rel=1e-6)
    assert vehicle.position_m[2] + 50.0 == pytest.approx(GRAVITY_M_S2 / 2, rel=0.01)


def test_hover_thrust_hovers() -> None:
    vehicle = aloft()
    run(vehicle, 5.0, vehicle.airframe.hover_thrust)
    assert vehicle.position_m == pytest.approx((0.0, 0.0, -50.0), abs=1e-6)


def test_it_drifts_with_the_wind_until_it_moves_as_the_air_does() -> None:
    vehicle = aloft()
    run(vehicle, 20.0, vehicle.airframe.hover_thrust, wind=(4.0, -2.0, 0.0))
    assert vehicle.velocity_m_s[:2] == pytest.approx((4.0, -2.0), abs=0.01)


def test_thrust_lags_by_the_motors_time_constant() -> None:
    vehicle = Vehicle()
    run(vehicle, vehicle.airframe.motor_time_constant_s, 0.4)
    assert vehicle.thrust_n == pytest.approx(0.4 * vehicle.airframe.max_thrust_n * (1 - math.exp(-1)), rel=0.05)


def motion_when_weak(*shares: tuple[int, float]) -> tuple[float, ...]:
    """How fast it sinks and turns a tenth of a second after rotors of a hovering vehicle became weak."""
    vehicle = aloft()
    for rotor, share in shares:
        vehicle.weaken(rotor, share)
    run(vehicle, 0.1, vehicle.airframe.hover_thrust)
    return (vehicle.velocity_m_s[2], *vehicle.rates_rad_s)


def test_weak_rotors_add_up() -> None:
    one, other = motion_when_weak((0, 0.9)), motion_when_weak((3, 0.7))
    both = motion_when_weak((0, 0.9), (3, 0.7))
    assert both == pytest.approx([a + b for a, b in zip(one, other, strict=True)], rel=0.02, abs=1e-3)
    assert both == motion_when_weak((3, 0.7), (0, 0.2), (0, 0.9))  # a rotor has the share that it was told last


def test_a_mended_rotor_leaves_the_others_weak() -> None:
    assert motion_when_weak((0, 0.9), (3, 0.7), (3, 1.0)) == motion_when_weak((0, 0.9))
    assert motion_when_weak((0, 0.5), (0, 1.0)) == motion_when_weak()


def test_a_vehicle_that_is_weak_all_around_only_sinks() -> None:
    n = len(Airframe().rotors)
    sinks_m_s, *rates_rad_s = motion_when_weak(*[(rotor, 0.5) for rotor in range(n)])
    assert sinks_m_s > 0.3
    assert rates_rad_s == pytest.approx([0.0, 0.0, 0.0], abs=1e-9)


def test_thrust_has_a_limit() -> None:
    vehicle = aloft()
    run(vehicle, 2.0, 7.0)
    assert vehicle.thrust_n == pytest.approx(vehicle.airframe.max_thrust_n, rel=1e-6)


def test_without_thrust_there_is_no_torque() -> None:
    vehicle = aloft()
    vehicle.thrust_n = 0.0
    run(vehicle, 0.5, 0.0, torque=(1.0, 1.0, 1.0))
    assert max(abs(rate) for rate in vehicle.rates_rad_s) < 1e-9


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_torque_turns_about_its_own_axis(axis: int) -> None:
    vehicle = aloft()
    run(vehicle, 0.1, vehicle.airframe.hover_thrust, torque=tuple(0.1 if n == axis else 0.0 for n in range(3)))
    assert vehicle.rates_rad_s[axis] > 0.01
    assert vehicle.euler_rad[axis] > 0.0
    assert [abs(rate) < 1e-9 for n, rate in enumerate(vehicle.rates_rad_s) if n != axis] == [True, True]


def test_nose_down_accelerates_forward() -> None:
    vehicle = aloft()
    vehicle.quaternion = (math.cos(-0.1), 0.0, math.sin(-0.1), 0.0)
    run(vehicle, 0.2, vehicle.airframe.hover_thrust)
    assert vehicle.velocity_m_s[0] > 0.1


def test_it_stands_on_the_ground_and_keeps_its_heading() -> None:
    vehicle = Vehicle(yaw_rad=0.7)
    run(vehicle, 1.0, 0.5 * vehicle.airframe.hover_thrust, torque=(0.1, 0.1, 0.1), wind=(10.0, 0.0, 0.0))
    assert vehicle.is_on_ground
    assert vehicle.position_m == (0.0, 0.0, 0.0)
    assert vehicle.euler_rad == pytest.approx((0.0, 0.0, 0.7))


def test_it_stands_on_the_ground_that_is_there() -> None:
    vehicle = Vehicle(ground=lambda north_m, east_m: 2.0)
    vehicle.position_m = (0.0, 0.0, -1.0)
    run(vehicle, 3.0, 0.0)
    assert vehicle.position_m[2] == 2.0
    assert vehicle.height_m == 0.0


def test_the_ground_stops_a_fall_although_the_motors_pull_up() -> None:
    vehicle = aloft()
    vehicle.position_m, vehicle.velocity_m_s = (0.0, 0.0, -0.02), (0.0, 0.0, 6.0)
    vehicle.thrust_n = vehicle.airframe.max_thrust_n
    downs_m = []
    for _ in range(100):
        vehicle.step(STEP_S, 1.0, STILL, STILL)
        downs_m.append(vehicle.position_m[2])
    assert max(downs_m) == 0.0
    assert downs_m[-1] < -0.1
    assert not vehicle.is_on_ground


@given(
    torque=st.tuples(*[st.floats(-1, 1)] * 3),
    thrust=st.floats(0, 1),
    wind=st.tuples(*[st.floats(-15, 15)] * 3),
)
def test_the_quaternion_stays_a_rotation(torque, thrust, wind) -> None:  # type: ignore[no-untyped-def]
    vehicle = aloft()
    run(vehicle, 1.0, thrust, torque, wind)
    assert math.hypot(*vehicle.quaternion) == pytest.approx(1.0, abs=1e-9)
    assert all(math.isfinite(value) for value in (*vehicle.position_m, *vehicle.velocity_m_s, *vehicle.rates_rad_s))


def test_yaw_is_clockwise_from_north() -> None:
    assert euler_of((math.cos(0.25), 0.0, 0.0, math.sin(0.25)))[2] == pytest.approx(0.5)


def test_more_thrust_costs_more_power() -> None:
    vehicle = aloft()
    hover_w = vehicle.power_w
    vehicle.thrust_n *= 2
    assert vehicle.power_w == pytest.approx(hover_w * 2**1.5)
    assert 200 < hover_w < 500
