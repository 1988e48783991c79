"""Where a mission goes, by dead reckoning: how far from the take-off point, and where it may be over the line. Pure."""

import math
from dataclasses import dataclass

from mission import plan as p

_BACK_HOME_M = 1.0
"""The line lies ahead of the take-off point; a vehicle that has come back to within this is not over it."""


@dataclass(frozen=True, slots=True)
class Leg:
    """One task: the distance from the take-off point after it, its heights, and whether the line may be below it.

    `lowest_m` is the least height over the take-off point while the task flies: 0 for land, which lands right there.
    """

    reach_m: float
    lowest_m: float
    may_be_over_line: bool


def reckon(plan: p.MissionPlan) -> list[Leg]:
    """Reckon each task, should move_until go as far as it may.

    The line is taken to run across the vehicle's nose, as missions want it; where align turns the nearest way, it is
    taken to turn right.
    """
    ahead_m = aside_m = search_m = altitude_m = 0.0
    heading_rad = 0.0
    legs = []
    for task in plan.tasks:
        step_m = 0.0
        before_m = altitude_m
        was_away = abs(ahead_m) > _BACK_HOME_M
        match task:
            case p.Takeoff() | p.Ascend() | p.Descend():
                altitude_m = task.altitude_m
            case p.Land():
                altitude_m = 0.0
            case p.Rotate():
                heading_rad += math.radians(task.angle_deg)
            case p.Align():
                heading_rad += math.radians(-90.0 if task.turn == "left" else 90.0)
            case p.MoveUntil():
                step_m = search_m = task.max_distance_m
            case p.MoveForward():
                step_m = search_m if task.distance_m == "as_move_until" else float(task.distance_m)
            case p.FollowLines():
                step_m = task.distance_m
            case _:
                pass
        ahead_m += step_m * math.cos(heading_rad)
        aside_m += step_m * math.sin(heading_rad)
        is_over = not isinstance(task, p.Return) and (was_away or abs(ahead_m) > _BACK_HOME_M)
        legs.append(Leg(math.hypot(ahead_m, aside_m), min(before_m, altitude_m), is_over))
    return legs
