"""The estimate errs as it says: by how much, for how long, and the same for a seed."""

import math
import statistics

import pytest

from sitl.control import Estimate
from sitl.estimator import Estimator
from sitl.vehicle import Vehicle, euler_of

DT_S = 0.1


def deviations(vectors: list[tuple[float, float, float]]) -> list[float]:
    return [statistics.pstdev(axis) for axis in zip(*vectors, strict=True)]


@pytest.fixture(scope="module")
def standing() -> list[Estimate]:
    """What is believed of a vehicle that stands still, heading north, for more than an hour."""
    estimator, vehicle = Estimator(3), Vehicle()
    return [estimator.step(DT_S, vehicle) for _ in range(40_000)]


def test_position_and_velocity_wander_around_the_truth(standing: list[Estimate]) -> None:
    # The position's first-order noise of 15 s goes through a lag of 1 s: that leaves sqrt(15 / 16) of it. The height
    # has the barometer's slow drift on top, which its differences over a minute hardly show: sqrt(2) of the rest.
    positions, velocities = [e.position_m for e in standing], [e.velocity_m_s for e in standing]
    assert deviations(positions)[:2] == pytest.approx([0.145, 0.145], rel=0.2)
    heights_m = [position[2] for position in positions]
    a_minute = round(60.0 / DT_S)
    changes_m = [later - earlier for earlier, later in zip(heights_m, heights_m[a_minute:], strict=False)]
    assert statistics.pstdev(changes_m) == pytest.approx(0.194 * math.sqrt(2), rel=0.25)
    assert deviations(velocities) == pytest.approx([0.06, 0.06, 0.04], rel=0.1)
    for axis in range(3):
        assert abs(statistics.fmean(velocity[axis] for velocity in velocities)) < 0.01
        if axis < 2:
            assert abs(statistics.fmean(position[axis] for position in positions)) < 0.06


def test_the_barometer_drifts_from_zero_at_boot_towards_its_deviation() -> None:
    drifts_m: dict[int, list[float]] = {60: [], 600: []}
    for seed in range(200):
        estimator, vehicle = Estimator(seed), Vehicle()
        for second in range(1, 601):
            estimator.step(1.0, vehicle)
            if second in drifts_m:
                drifts_m[second].append(estimator.barometer_m)
    for after_s, drift_m in drifts_m.items():
        assert statistics.pstdev(drift_m) == pytest.approx(0.3 * math.sqrt(1 - math.exp(-2 * after_s / 600)), rel=0.15)
        assert abs(statistics.fmean(drift_m)) < 0.06


def test_wind_on_the_case_makes_the_height_seem_greater() -> None:
    calm, windy, vehicle = Estimator(5), Estimator(5), Vehicle()
    for _ in range(200):
        still = calm.step(DT_S, vehicle)
        blown = windy.step(DT_S, vehicle, airspeed_m_s=8.0)
    # 0.05 of 8 m/s' dynamic pressure, as a height: v^2 / 2 g.
    assert still.position_m[2] - blown.position_m[2] == pytest.approx(0.05 * 64 / (2 * 9.80665), rel=0.01)
    assert still.position_m[:2] == blown.position_m[:2]


def test_attitude_and_rates_are_noisy(standing: list[Estimate]) -> None:
    noise_rad = math.radians(0.2)
    assert deviations([euler_of(e.quaternion) for e in standing]) == pytest.approx([noise_rad] * 3, rel=0.1)
    assert deviations([e.rates_rad_s for e in standing]) == pytest.approx([0.01] * 3, rel=0.05)


def test_biases_stay_for_the_flight_and_differ_between_flights(standing: list[Estimate]) -> None:
    angles = [euler_of(e.quaternion) for e in standing]
    for axis in range(3):
        halves = [statistics.fmean(angle[axis] for angle in part) for part in (angles[:20_000], angles[20_000:])]
        assert halves[0] == pytest.approx(halves[1], abs=math.radians(0.03))
    at_boot = [euler_of(Estimator(seed).step(1e-3, Vehicle()).quaternion) for seed in range(500)]
    # The compass: 1.5 degrees of bias, and deviations of 1.2 and 0.4 degrees amplitude whose phases differ.
    compass_deg = math.sqrt(1.5**2 + (1.2**2 + 0.4**2) / 2)
    assert deviations(at_boot) == pytest.approx([math.radians(deg) for deg in (0.3, 0.3, compass_deg)], rel=0.12)


def heading_error_rad(seed: int, yaw_rad: float) -> float:
    believed_rad = euler_of(Estimator(seed).step(1e-3, Vehicle(yaw_rad=yaw_rad)).quaternion)[2]
    return math.remainder(believed_rad - yaw_rad, 2 * math.pi)


def test_the_compass_deviates_with_the_heading_once_and_twice_a_turn() -> None:
    n_headings = 72
    errors = [heading_error_rad(7, 2 * math.pi * k / n_headings) for k in range(n_headings)]

    def amplitude_rad(times: int) -> float:
        turns = [2 * math.pi * k * times / n_headings for k in range(n_headings)]
        along = statistics.fmean(error * math.cos(turn) for error, turn in zip(errors, turns, strict=True))
        across = statistics.fmean(error * math.sin(turn) for error, turn in zip(errors, turns, strict=True))
        return 2 * math.hypot(along, across)

    assert [math.degrees(amplitude_rad(times)) for times in (1, 2)] == pytest.approx([1.2, 0.4], abs=0.02)
    assert math.degrees(amplitude_rad(3)) < 0.02
    assert abs(statistics.fmean(errors)) > math.radians(0.2)


def test_the_compass_errs_about_the_vertical() -> None:
    # However it errs, the level does not change: only what the accelerometer's mount and noise do to it is there.
    for yaw_rad in (0.0, 1.3, -2.5):
        roll_rad, pitch_rad, _ = euler_of(Estimator(7).step(1e-3, Vehicle(yaw_rad=yaw_rad)).quaternion)
        at_north = euler_of(Estimator(7).step(1e-3, Vehicle()).quaternion)
        assert (roll_rad, pitch_rad) == pytest.approx(at_north[:2], abs=1e-9)


def test_accelerations_are_noisy(standing: list[Estimate]) -> None:
    assert deviations([e.acceleration_m_s2 for e in standing]) == pytest.approx([0.05] * 3, rel=0.05)


def test_the_same_seed_errs_the_same() -> None:
    assert [Estimator(4).step(DT_S, Vehicle()) for _ in range(2)] == [Estimator(4).step(DT_S, Vehicle())] * 2


def test_without_noise_the_estimate_is_the_truth() -> None:
    vehicle = Vehicle(yaw_rad=0.4)
    estimate = Estimator(4, is_noisy=False).step(DT_S, vehicle)
    assert (estimate.position_m, estimate.quaternion) == (vehicle.position_m, vehicle.quaternion)
