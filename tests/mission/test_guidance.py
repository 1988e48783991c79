"""Guidance's geometry: signs, frames, and that neither tilt nor the control rate changes where it leads."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.camera.camera import Intrinsics
from mission.autopilot import FlightMode, LandedState, Setpoint, VehicleState
from mission.guidance import (
    WorldLine,
    bearing_of,
    leash,
    nearest_heading_rad,
    step_level_towards,
    step_sideways,
    turn_towards_rad,
    wrap_angle_rad,
)
from tests.support.geometric_eyes import see_line
from vision.records import wrap_line_angle_rad

CAMERA = Intrinsics(640, 480, 500.0, 500.0, 319.5, 239.5)
angles = st.floats(-math.pi, math.pi)
metres = st.floats(-50.0, 50.0)
tilts = st.floats(-0.3, 0.3)


def state(
    north_m: float = 0.0, east_m: float = 0.0, roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0
) -> VehicleState:
    return VehicleState(
        0,
        north_m,
        east_m,
        -16.0,
        0.0,
        0.0,
        0.0,
        roll,
        pitch,
        yaw,
        FlightMode.OFFBOARD,
        True,
        LandedState.IN_AIR,
        0.9,
        True,
    )


def quaternion(roll: float, pitch: float, yaw: float) -> tuple[float, float, float, float]:
    cr, sr, cp, sp = math.cos(roll / 2), math.sin(roll / 2), math.cos(pitch / 2), math.sin(pitch / 2)
    cy, sy = math.cos(yaw / 2), math.sin(yaw / 2)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


@given(angles)
def test_angles_wrap_into_their_range(angle_rad: float) -> None:
    for turns in (-3, 0, 2):
        wrapped = wrap_angle_rad(angle_rad + turns * math.tau)
        assert -math.pi < wrapped <= math.pi
        assert math.cos(wrapped - angle_rad) == pytest.approx(1.0)
        line = wrap_line_angle_rad(angle_rad + turns * math.pi)
        assert -math.pi / 2 < line <= math.pi / 2
        assert abs(math.cos(line - angle_rad)) == pytest.approx(1.0)


@given(angles, angles)
def test_the_nearest_heading_is_within_a_right_angle(line_rad: float, heading_rad: float) -> None:
    nearest = nearest_heading_rad(line_rad, heading_rad)
    assert abs(wrap_angle_rad(nearest - heading_rad)) <= math.pi / 2 + 1e-9
    assert abs(math.sin(nearest - line_rad)) < 1e-9


def test_a_line_to_the_right_of_the_image_lies_to_the_right_of_the_vehicle() -> None:
    # The vehicle looks east at the origin; a line that runs east, 2 m south, is on its right hand.
    estimate = see_line((0.0, 0.0, -16.0), quaternion(0, 0, math.pi / 2), CAMERA, (-2.0, 0.0, -10.0), math.pi / 2)
    assert estimate is not None
    assert estimate.offset_px > 0
    bearing = bearing_of(estimate.middle, state(yaw=math.pi / 2), CAMERA)
    assert bearing is not None
    line = bearing.line(0.0, 0.0, 6.0)
    assert line.offset_m(0.0, 0.0, math.pi / 2) == pytest.approx(2.0, abs=0.02)
    assert line.north_m == pytest.approx(-2.0, abs=0.02)


@given(tilts, tilts, angles, angles, st.floats(-1.5, 1.5), metres, metres)
def test_a_line_is_located_whatever_the_tilt(
    roll: float, pitch: float, yaw: float, heading: float, aside_m: float, north_m: float, east_m: float
) -> None:
    point = (north_m - math.sin(heading) * aside_m, east_m + math.cos(heading) * aside_m, -10.0)
    estimate = see_line((north_m, east_m, -16.0), quaternion(roll, pitch, yaw), CAMERA, point, heading)
    if estimate is None:
        return
    bearing = bearing_of(estimate.middle, state(north_m, east_m, roll, pitch, yaw), CAMERA)
    assert bearing is not None
    line = bearing.line(north_m, east_m, 6.0)
    assert abs(math.sin(line.heading_rad - heading)) < math.radians(0.1)
    assert abs(line.offset_m(point[0], point[1], heading)) < 0.02


def test_a_ray_above_the_horizon_locates_nothing() -> None:
    estimate = see_line((0.0, 0.0, -16.0), quaternion(0, 0, 0), CAMERA, (0.0, 0.0, -10.0), 0.0)
    assert estimate is not None
    assert bearing_of(estimate.middle, state(pitch=1.4), CAMERA) is None


@given(angles, st.floats(1.0, 30.0), st.floats(math.radians(25), math.radians(155)))
def test_the_crossing_lies_on_the_line(heading: float, ahead_m: float, between: float) -> None:
    line = WorldLine(heading + between, ahead_m * math.cos(heading), ahead_m * math.sin(heading))
    assert line.crossing_m(0.0, 0.0, heading) == pytest.approx(ahead_m, abs=1e-6)


def test_a_line_along_the_way_has_no_crossing() -> None:
    assert WorldLine(math.radians(15), 3.0, 3.0).crossing_m(0.0, 0.0, 0.0) is None


@pytest.mark.parametrize("rate_hz", [5, 20, 100])
def test_the_turn_does_not_depend_on_the_control_rate(rate_hz: int) -> None:
    angle_rad = 0.0
    for _ in range(2 * rate_hz):
        angle_rad = turn_towards_rad(angle_rad, math.radians(20), 0.8, math.radians(45), 1 / rate_hz)
    assert angle_rad == pytest.approx(math.radians(20) * (1 - math.exp(-1.6)), rel=1e-9)


@pytest.mark.parametrize("rate_hz", [5, 20, 100])
def test_the_way_sideways_does_not_depend_on_the_control_rate(rate_hz: int) -> None:
    reference, line = Setpoint(0.0, 0.0, -16.0, 0.0), WorldLine(0.0, 0.0, 1.0)
    for _ in range(2 * rate_hz):
        reference = step_sideways(reference, line, 0.0, 0.5, 10.0, 1 / rate_hz)
    assert reference.east_m == pytest.approx(1 - math.exp(-1.0), rel=1e-9)


@given(angles, angles, st.floats(0.01, 0.2))
def test_a_turn_goes_the_short_way_and_never_past(angle: float, target: float, dt_s: float) -> None:
    before = abs(wrap_angle_rad(target - angle))
    after = abs(wrap_angle_rad(target - turn_towards_rad(angle, target, 2.0, 1.0, dt_s)))
    assert after <= before + 1e-9


@given(metres, metres, metres, st.floats(0.5, 10.0))
def test_the_leash_holds_and_leaves_what_is_near(north_m: float, east_m: float, down_m: float, length_m: float) -> None:
    reference, vehicle = Setpoint(north_m, east_m, down_m, 0.3), state()
    held = leash(reference, vehicle, length_m)
    assert math.hypot(held.north_m, held.east_m) <= length_m + 1e-9
    assert abs(held.down_m + 16.0) <= length_m + 1e-9
    if math.hypot(north_m, east_m) <= length_m and abs(down_m + 16.0) <= length_m:
        assert (held.north_m, held.east_m) == pytest.approx((north_m, east_m))


def test_a_step_towards_a_goal_arrives_and_stays() -> None:
    reference, goal = Setpoint(0.0, 0.0, -4.0, 0.1), Setpoint(3.0, 4.0, 0.0, 2.0)
    for _ in range(60):
        reference = step_level_towards(reference, goal, 1.0, 0.1)
    assert (reference.north_m, reference.east_m) == (3.0, 4.0)
    assert (reference.down_m, reference.yaw_rad) == (-4.0, 0.1)
