"""What is watched over the control ticks: punctuality, another's setpoints, a vehicle that does not follow."""

import math
from dataclasses import replace

import pytest

from mission.autopilot import FlightMode, LandedState, Setpoint, VehicleState
from mission.watchers import Pace, TargetWatch, TrackingWatch

S = 1_000_000_000
TICK_NS = 50_000_000
STATE = VehicleState(
    0, 0, 0, -16, 0, 0, 0, 0, 0, 0, FlightMode.OFFBOARD, True, LandedState.IN_AIR, 0.9, is_connected=True
)


def point(north_m: float) -> Setpoint:
    return Setpoint(north_m, 0.0, -16.0, 0.0)


def test_a_punctual_loop_has_no_share_of_late_ticks() -> None:
    pace = Pace()
    for _ in range(200):
        pace.tick(0.01)
    assert pace.view.late_share == 0.0


@pytest.mark.parametrize("every", [2, 4, 10])
def test_the_share_of_late_ticks_is_that_of_the_last_five_seconds(every: int) -> None:
    pace = Pace()
    for number in range(300):
        pace.tick(0.06 if number % every == 0 else 0.0)
    assert pace.view.late_share == pytest.approx(1 / every, abs=0.01)
    for _ in range(100):
        pace.tick(0.0)
    assert pace.view.late_share == 0.0


def heard_after(seconds: float, share_foreign: float, *, state: VehicleState = STATE, lag_s: float = 0.3) -> bool:
    """Whether another's setpoints are noticed; ours move, and the autopilot tells them back a little late."""
    watch = TargetWatch()
    words = None
    for tick in range(round(seconds * 20)):
        now_ns = tick * TICK_NS
        watch.sent(now_ns, point(tick * 0.1))
        if tick % 2 == 0:
            ours = point(max(0.0, tick - lag_s * 20) * 0.1)
            is_foreign = (tick // 2 * share_foreign) % 1.0 >= 1.0 - share_foreign if share_foreign < 1 else True
            target = replace(ours, down_m=-21.0) if is_foreign else ours
            words = watch.heard(now_ns, target, state, is_offboard=True)
    return words is not None


def test_our_own_setpoints_told_back_late_are_ours() -> None:
    assert not heard_after(30.0, 0.0)


def test_another_s_setpoints_are_noticed_after_the_heartbeat_could_have_told_of_a_pilot() -> None:
    assert not heard_after(2.0, 1.0)
    assert heard_after(3.5, 1.0)


def test_two_streams_that_mix_are_noticed_too() -> None:
    assert heard_after(12.0, 0.5)


def test_outside_offboard_any_target_is_right() -> None:
    assert not heard_after(10.0, 1.0, state=replace(STATE, mode=FlightMode.RETURN))


def blown(distance_m: float, closing_m_s: float, seconds: float, *, tilt_rad: float = 0.0) -> str | None:
    watch = TrackingWatch(4.0)
    state = replace(STATE, v_north_m_s=closing_m_s, pitch_rad=tilt_rad)
    words = None
    for _ in range(round(seconds * 20)):
        words = watch.tick(0.05, state, point(distance_m), is_offboard=True)
    return words


def test_a_vehicle_that_comes_no_nearer_at_the_end_of_its_leash_does_not_follow() -> None:
    assert blown(4.0, 0.0, 4.9) is None
    assert blown(4.0, 0.0, 5.2) is not None
    assert blown(4.0, -3.0, 5.2) is not None


@pytest.mark.parametrize(("distance_m", "closing_m_s"), [(4.0, 2.0), (2.0, 0.0)])
def test_one_that_follows_at_a_distance_does(distance_m: float, closing_m_s: float) -> None:
    assert blown(distance_m, closing_m_s, 60.0) is None


def test_a_tilt_is_told_after_three_seconds() -> None:
    assert blown(0.0, 0.0, 2.9, tilt_rad=math.radians(42)) is None
    assert blown(0.0, 0.0, 3.2, tilt_rad=math.radians(42)) is not None
    assert blown(0.0, 0.0, 60.0, tilt_rad=math.radians(38)) is None
