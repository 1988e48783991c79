"""The cascade: attitudes from thrust vectors, limits, and closed loops that settle."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sitl.control import AttitudeControl, Estimate, PositionControl, Setpoint, attitude_of, quaternion_of
from sitl.parameters import Parameters
from sitl.vehicle import Vehicle, euler_of

angles = st.floats(-0.7, 0.7)
yaws = st.floats(-3.1, 3.1)
HOVER = 0.5


def thrust_along(roll_rad: float, pitch_rad: float, yaw_rad: float, size: float) -> tuple[float, float, float]:
    """The thrust NED of a vehicle at that attitude: against body z."""
    w, x, y, z = quaternion_of(roll_rad, pitch_rad, yaw_rad)
    return (-size * 2 * (x * z + w * y), -size * 2 * (y * z - w * x), -size * (1 - 2 * (x * x + y * y)))


def resting(north_m: float = 0.0) -> Estimate:
    zero = (0.0, 0.0, 0.0)
    return Estimate((north_m, 0.0, -10.0), zero, zero, (1.0, 0.0, 0.0, 0.0), zero)


def setpoint(north_m: float, down_m: float = -10.0) -> Setpoint:
    return Setpoint((north_m, 0.0, down_m), (0.0, 0.0, 0.0), 0.0, 3.0, 1.5, math.radians(45))


@given(roll=angles, pitch=angles, yaw=yaws, size=st.floats(0.2, 1.0))
def test_the_attitude_of_a_thrust_is_the_one_that_gives_it(roll: float, pitch: float, yaw: float, size: float) -> None:
    got = euler_of(attitude_of(thrust_along(roll, pitch, yaw, size), yaw))
    assert got[0] == pytest.approx(roll, abs=1e-9)
    assert got[1] == pytest.approx(pitch, abs=1e-9)
    assert math.remainder(got[2] - yaw, 2 * math.pi) == pytest.approx(0.0, abs=1e-9)


@given(roll=angles, pitch=angles, yaw=yaws)
def test_no_error_asks_for_no_rates(roll: float, pitch: float, yaw: float) -> None:
    attitude = quaternion_of(roll, pitch, yaw)
    assert AttitudeControl(Parameters()).rates_setpoint_rad_s(attitude, attitude) == pytest.approx((0, 0, 0), abs=1e-6)


def test_small_errors_ask_for_gain_times_error() -> None:
    control = AttitudeControl(Parameters())
    level = (1.0, 0.0, 0.0, 0.0)
    assert control.rates_setpoint_rad_s(quaternion_of(0.01, 0, 0), level)[0] == pytest.approx(6.5 * 0.01, rel=1e-3)
    assert control.rates_setpoint_rad_s(quaternion_of(0, 0.01, 0), level)[1] == pytest.approx(6.5 * 0.01, rel=1e-3)
    assert control.rates_setpoint_rad_s(quaternion_of(0, 0, 0.01), level)[2] == pytest.approx(2.8 * 0.01, rel=1e-3)


def test_a_thrust_limit_below_the_horizontal_margin_is_kept() -> None:
    control = PositionControl(Parameters({"MPC_THR_MAX": 0.2}), HOVER)
    for _ in range(50):
        assert math.hypot(*control.step(0.004, setpoint(500.0), resting())) <= 0.2 + 1e-9


def test_without_yaw_weight_only_tilt_is_corrected() -> None:
    control = AttitudeControl(Parameters({"MC_YAW_WEIGHT": 0.0}))
    rates = control.rates_setpoint_rad_s(quaternion_of(0.01, 0.0, 1.0), (1.0, 0.0, 0.0, 0.0))
    assert rates[0] > 0.01
    assert rates[2] == pytest.approx(0.0, abs=1e-3)


def test_yaw_takes_the_short_way() -> None:
    control = AttitudeControl(Parameters())
    actual, wanted = quaternion_of(0, 0, math.radians(170)), quaternion_of(0, 0, math.radians(-170))
    assert control.rates_setpoint_rad_s(wanted, actual)[2] > 0


def test_resting_at_the_setpoint_asks_for_hover_thrust() -> None:
    thrust = PositionControl(Parameters(), HOVER).step(0.004, setpoint(0.0), resting())
    assert thrust == pytest.approx((0.0, 0.0, -HOVER))


@given(north=st.floats(-1000, 1000))
def test_the_tilt_limit_holds(north: float) -> None:
    control = PositionControl(Parameters(), HOVER)
    for _ in range(50):
        n, e, d = control.step(0.004, setpoint(north), resting())
        assert math.atan2(math.hypot(n, e), -d) <= math.radians(45) + 1e-9
        assert math.sqrt(n * n + e * e + d * d) <= 1.0 + 1e-9


def test_the_velocity_setpoint_is_limited() -> None:
    control = PositionControl(Parameters(), HOVER)
    control.step(0.004, setpoint(500.0, -500.0), resting())
    vn, _, vd = control.velocity_setpoint_m_s
    assert (vn, vd) == pytest.approx((12.0, -3.0))


def test_a_saturated_tilt_does_not_wind_the_integral_up() -> None:
    control = PositionControl(Parameters(), HOVER)
    for _ in range(2500):
        control.step(0.004, setpoint(500.0), resting())
    # Back at rest on the setpoint only the integral is left to ask for thrust.
    n, _, d = control.step(0.004, setpoint(0.0), resting())
    assert abs(math.atan2(n, -d)) < math.radians(46)
    for _ in range(250):
        n, _, d = control.step(0.004, setpoint(0.0), resting())
    assert abs(math.atan2(n, -d)) < math.radians(30)


def test_it_settles_on_a_setpoint_in_steady_wind() -> None:
    parameters, vehicle = Parameters(), Vehicle()
    vehicle.position_m, vehicle.is_on_ground = (0.0, 0.0, -10.0), False
    vehicle.thrust_n = vehicle.airframe.hover_thrust * vehicle.airframe.max_thrust_n
    position, attitude = PositionControl(parameters, vehicle.airframe.hover_thrust), AttitudeControl(parameters)
    for _ in range(5000):
        estimate = Estimate(
            vehicle.position_m,
            vehicle.velocity_m_s,
            vehicle.acceleration_m_s2,
            vehicle.quaternion,
            vehicle.rates_rad_s,
        )
        thrust = position.step(0.004, setpoint(5.0), estimate)
        torque = attitude.step(0.004, attitude_of(thrust, 0.0), vehicle.quaternion, vehicle.rates_rad_s)
        vehicle.step(0.004, math.hypot(*thrust), torque, (-3.0, 5.0, 0.0))
    assert vehicle.position_m == pytest.approx((5.0, 0.0, -10.0), abs=0.15)
    assert math.hypot(*vehicle.velocity_m_s) < 0.1
