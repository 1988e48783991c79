"""What a mission will do, in words and figures, before anything flies. Pure."""

import math
from dataclasses import dataclass

from mission import plan as p
from mission.reach import reckon

_TURN_SETTLE_S = 2.0
_ARRIVE_S = 3.0
_TAKEOFF_RAMP_S = 5.0
_TAKEOFF_CLIMB_M_S = 1.5
_RETURN_SPEED_M_S = 5.0
_LANDING_SPEED_M_S = 0.7
_DISARM_S = 4.0


@dataclass(frozen=True, slots=True)
class TaskEstimate:
    """A task in one sentence, and what it should take; `distance_m` is flown over ground."""

    task: str
    sentence: str
    duration_s: float
    distance_m: float
    altitude_m: float


@dataclass(frozen=True, slots=True)
class FlightTotals:
    """A whole flight: time, way over ground, energy (hover power all the time), and how far and high it goes.

    `reach_m` is the farthest from the take-off point, should every search go to its end (mission.reach).
    """

    duration_s: float
    distance_m: float
    energy_wh: float
    reach_m: float
    highest_m: float


def total(plan: p.MissionPlan) -> FlightTotals:
    """Sum up the estimate of a mission."""
    estimates = estimate_mission(plan)
    duration_s = sum(estimate.duration_s for estimate in estimates)
    return FlightTotals(
        duration_s=duration_s,
        distance_m=sum(estimate.distance_m for estimate in estimates),
        energy_wh=duration_s / 3600 * plan.vehicle.hover_power_w,
        reach_m=max(leg.reach_m for leg in reckon(plan)),
        highest_m=max(estimate.altitude_m for estimate in estimates),
    )


def estimate_mission(plan: p.MissionPlan) -> list[TaskEstimate]:
    """Estimate each task. Where a task searches for the line, half of its allowed distance is assumed."""
    estimates: list[TaskEstimate] = []
    altitude_m = 0.0
    search_m = 0.0
    away_m = 0.0
    for task in plan.tasks:
        sentence, duration_s, distance_m, altitude_m = _estimate(task, plan.guidance, altitude_m, search_m, away_m)
        if isinstance(task, p.MoveUntil):
            search_m = distance_m
        away_m += distance_m
        estimates.append(TaskEstimate(task.task, sentence, duration_s, distance_m, altitude_m))
    return estimates


def _estimate(
    task: p.AnyTask, guidance: p.GuidancePlan, altitude_m: float, search_m: float, away_m: float
) -> tuple[str, float, float, float]:
    """Sentence, duration [s], distance [m] and the altitude afterwards [m]."""
    match task:
        case p.Takeoff():
            climb_s = _TAKEOFF_RAMP_S + task.altitude_m / _TAKEOFF_CLIMB_M_S
            return f"arm and climb to {task.altitude_m:g} m", climb_s, 0.0, task.altitude_m
        case p.Ascend():
            climb_s = abs(task.altitude_m - altitude_m) / guidance.climb_m_s + _ARRIVE_S
            return f"climb to {task.altitude_m:g} m", climb_s, 0.0, task.altitude_m
        case p.Descend():
            sink_s = abs(task.altitude_m - altitude_m) / guidance.descend_m_s + _ARRIVE_S
            return f"sink to {task.altitude_m:g} m", sink_s, 0.0, task.altitude_m
        case p.Rotate():
            side = "right" if task.angle_deg >= 0 else "left"
            turn_s = abs(task.angle_deg) / guidance.yaw_rate_deg_s + _TURN_SETTLE_S
            return f"turn {abs(task.angle_deg):g} degrees to the {side}", turn_s, 0.0, altitude_m
        case p.MoveForward():
            if task.distance_m == "as_move_until":
                return "fly ahead as far as move_until went", _fly_s(search_m, guidance), search_m, altitude_m
            distance_m = float(task.distance_m)
            return f"fly {distance_m:g} m ahead", _fly_s(distance_m, guidance), distance_m, altitude_m
        case p.MoveUntil():
            where = "is right below" if task.until == "overhead" else "is seen"
            sentence = (
                f"fly ahead until the line {where} ({task.n_detections} frames in a row), "
                f"at most {task.max_distance_m:g} m"
            )
            distance_m = task.max_distance_m / 2
            return sentence, _fly_s(distance_m, guidance), distance_m, altitude_m
        case p.Align():
            side = "the nearest way" if task.turn == "nearest" else f"to the {task.turn}"
            turn_s = math.log(90 / guidance.epsilon_deg) / guidance.P_per_s + _TURN_SETTLE_S
            sentence = f"turn along the line, {side}, to within {guidance.epsilon_deg:g} degrees"
            return sentence, turn_s, 0.0, altitude_m
        case p.FollowLines():
            sentence = f"follow the line for {task.distance_m:g} m ({guidance.law} law)"
            return sentence, _fly_s(task.distance_m, guidance), task.distance_m, altitude_m
        case p.Hold():
            return f"hover for {task.duration_s:g} s", task.duration_s, 0.0, altitude_m
        case p.Return():
            fly_s = away_m / _RETURN_SPEED_M_S + altitude_m / _LANDING_SPEED_M_S + _DISARM_S
            return "fly home and land, in the autopilot's return mode", fly_s, away_m, 0.0
        case p.Land():
            return "land here and disarm", altitude_m / _LANDING_SPEED_M_S + _DISARM_S, 0.0, 0.0


def _fly_s(distance_m: float, guidance: p.GuidancePlan) -> float:
    return distance_m / guidance.r_m_s + _ARRIVE_S
