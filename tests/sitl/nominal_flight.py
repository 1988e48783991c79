"""The nominal flight of the PX4 recording, flown by the simulated autopilot in virtual time, and its figures."""

import math
from collections.abc import Callable
from dataclasses import dataclass

from sitl.autopilot import SimAutopilot
from sitl.modes import Answer, Mode
from sitl.vehicle import Airframe, Vehicle, euler_of

STEP_S = 0.004


@dataclass(frozen=True)
class Sample:
    """One moment as telemetry tells it: boot time [s], NED [m], [m/s], yaw [rad] and yaw rate [rad/s]."""

    boot_s: float
    position_m: tuple[float, float, float]
    velocity_m_s: tuple[float, float, float]
    yaw_rad: float
    yaw_rate_rad_s: float


@dataclass(frozen=True)
class Moments:
    """When the application commanded what [s, boot]."""

    arm_s: float
    leg_s: float
    turn_s: float
    offboard_stop_s: float
    land_s: float


def sample_of(autopilot: SimAutopilot) -> Sample:
    estimate = autopilot.estimate
    yaw_rad = euler_of(estimate.quaternion)[2]
    return Sample(autopilot.boot_s, estimate.position_m, estimate.velocity_m_s, yaw_rad, estimate.rates_rad_s[2])


def figures(
    samples: list[Sample], moments: Moments, ground_down_m: float, north_m: float, yaw_rad: float
) -> dict[str, float]:
    """What is compared between the recording and the model.

    `ground_down_m` is the home's height in the local frame, `north_m` and `yaw_rad` the leg's and the turn's targets.
    """
    climb = [s for s in samples if moments.arm_s < s.boot_s < moments.leg_s]
    leg = [s for s in samples if moments.leg_s < s.boot_s < moments.turn_s + 1.5]
    turn = [s for s in samples if moments.turn_s < s.boot_s < moments.turn_s + 5.0]
    land = [s for s in samples if moments.land_s < s.boot_s < moments.land_s + 25.0]
    start_m, start_yaw_rad = leg[0].position_m[0], turn[0].yaw_rad

    def height_m(s: Sample) -> float:
        return ground_down_m - s.position_m[2]

    def mean_rate_m_s(part: list[Sample], low_m: float, high_m: float) -> float:
        inside = [s for s in part if low_m < height_m(s) < high_m]
        return (height_m(inside[-1]) - height_m(inside[0])) / (inside[-1].boot_s - inside[0].boot_s)

    def first_s(part: list[Sample], since_s: float, is_reached: Callable[[Sample], bool]) -> float:
        return next(s.boot_s for s in part if is_reached(s)) - since_s

    def turned(s: Sample) -> float:
        return math.remainder(s.yaw_rad - start_yaw_rad, 2 * math.pi) / math.remainder(
            yaw_rad - start_yaw_rad, 2 * math.pi
        )

    return {
        "takeoff_half_metre_s": first_s(climb, moments.arm_s, lambda s: height_m(s) > 0.5),
        "climb_speed_m_s": mean_rate_m_s(climb, 3.0, 7.5),
        "climb_to_8_m_s": first_s(climb, moments.arm_s, lambda s: height_m(s) > 8.0),
        "leg_peak_speed_m_s": max(s.velocity_m_s[0] for s in leg),
        "leg_half_way_s": first_s(leg, moments.leg_s, lambda s: s.position_m[0] > (start_m + north_m) / 2),
        "leg_within_1_m_s": first_s(leg, moments.leg_s, lambda s: s.position_m[0] > north_m - 1.0),
        "leg_overshoot_m": max(s.position_m[0] for s in leg) - north_m,
        "leg_sag_m": max(abs(s.position_m[2] - leg[0].position_m[2]) for s in leg),
        "turn_peak_rate_rad_s": max(s.yaw_rate_rad_s for s in turn),
        "turn_90_percent_s": first_s(turn, moments.turn_s, lambda s: turned(s) > 0.9),
        "turn_overshoot_rad": (max(turned(s) for s in turn) - 1) * math.pi / 2,
        "descent_speed_high_m_s": -mean_rate_m_s(land, 5.5, 8.5),
        "descent_speed_mid_m_s": -mean_rate_m_s(land, 1.5, 3.5),
        "descent_to_0m8_s": first_s(land, moments.land_s, lambda s: height_m(s) < 0.8),
    }


def fly_nominal(
    moments: Moments, seed: int, *, until_s: float, airframe: Airframe | None = None
) -> tuple[list[Sample], float, float]:
    """Fly the recording's commands; returns the samples, the home's height [m, down] and the leg's target north [m]."""
    autopilot = SimAutopilot(Vehicle(airframe or Airframe()), seed=seed)
    autopilot.set_parameter("MIS_TAKEOFF_ALT", 10.0)
    samples: list[Sample] = []
    target = (0.0, 0.0, 0.0, 0.0)
    ground_down_m = 0.0
    done: set[str] = set()

    def once(name: str, at_s: float) -> bool:
        if name in done or autopilot.boot_s < at_s:
            return False
        done.add(name)
        return True

    n_steps = round(until_s / STEP_S)
    for step in range(n_steps):
        if once("arm", moments.arm_s):
            assert autopilot.arm() is Answer.ACCEPTED
            assert autopilot.takeoff() is Answer.ACCEPTED
        if once("leg", moments.leg_s):
            n, e, d = autopilot.estimate.position_m
            target = (n + 20.0, e, d, euler_of(autopilot.estimate.quaternion)[2])
            ground_down_m = autopilot.home.position_m[2] if autopilot.home else 0.0
            autopilot.set_position_setpoint(*target)
            assert autopilot.set_mode(Mode.OFFBOARD) is Answer.ACCEPTED
        if once("turn", moments.turn_s):
            target = (*target[:3], math.pi / 2)
        if once("stop", moments.offboard_stop_s):
            assert autopilot.set_mode(Mode.LOITER) is Answer.ACCEPTED
        if once("land", moments.land_s):
            assert autopilot.land() is Answer.ACCEPTED
        if "leg" in done and "stop" not in done and step % 12 == 0:
            autopilot.set_position_setpoint(*target)
        autopilot.step(STEP_S)
        if step % 8 == 0:
            samples.append(sample_of(autopilot))
    return samples, ground_down_m, target[0]
