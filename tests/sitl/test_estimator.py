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
    # The position's first-order noise of 15 s goes through a lag of 1 s: that leaves sqrt(15 / 16) of it.
    positions, velocities = [e.position_m for e in standing], [e.velocity_m_s for e in standing]
    assert deviations(positions) == pytest.approx([0.145, 0.145, 0.194], rel=0.2)
    assert deviations(velocities) == pytest.approx([0.06, 0.06, 0.04], rel=0.1)
    for axis in range(3):
        assert abs(statistics.fmean(position[axis] for position in positions)) < 0.06
        assert abs(statistics.fmean(velocity[axis] for velocity in velocities)) < 0.01


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
    assert deviations(at_boot) == pytest.approx([math.radians(deg) for deg in (0.3, 0.3, 1.5)], rel=0.12)


def test_the_compass_errs_about_the_vertical_whatever_the_heading() -> None:
    def error_rad(yaw_rad: float) -> float:
        return euler_of(Estimator(7).step(1e-3, Vehicle(yaw_rad=yaw_rad)).quaternion)[2] - yaw_rad

    assert abs(error_rad(0.0)) > math.radians(0.2)
    assert error_rad(1.3) == pytest.approx(error_rad(0.0), abs=1e-6)


def test_the_same_seed_errs_the_same() -> None:
    assert [Estimator(4).step(DT_S, Vehicle()) for _ in range(2)] == [Estimator(4).step(DT_S, Vehicle())] * 2


def test_without_noise_the_estimate_is_the_truth() -> None:
    vehicle = Vehicle(yaw_rad=0.4)
    estimate = Estimator(4, is_noisy=False).step(DT_S, vehicle)
    assert (estimate.position_m, estimate.quaternion) == (vehicle.position_m, vehicle.quaternion)
