"""How far from the take-off point a mission goes, by dead reckoning. Pure."""

import math

from mission import plan as p


def reaches_m(plan: p.MissionPlan) -> list[float]:
    """The distance [m] from the take-off point after each task, should move_until go as far as it may.

    The line is taken to run across the vehicle's nose, as missions want it; where align turns the nearest way, it is
    taken to turn right.
    """
    ahead_m = aside_m = search_m = 0.0
    heading_rad = 0.0
    reaches = []
    for task in plan.tasks:
        step_m = 0.0
        match task:
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
        reaches.append(math.hypot(ahead_m, aside_m))
    return reaches
