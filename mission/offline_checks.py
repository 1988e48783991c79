"""What can be said of a mission without a vehicle: does it fit its time limits, its battery and its fence? Pure."""

from mission.checks import Check, failed, passed, warning
from mission.estimate import FlightTotals, estimate_mission, total
from mission.geofence import nearest_edge_m
from mission.known_line import ABOVE_GROUND, TOO_DEEP
from mission.plan import Align, FollowLines, MissionPlan, MoveUntil
from mission.reach import reckon

_ROUGHLY = 1.3
"""guidance.height_over_line_m may be so much less than what the heights say before it is worth a word."""


def check_offline(plan: MissionPlan) -> list[Check]:
    """Every check that needs the mission alone."""
    totals = total(plan)
    return [
        _time_limits(plan),
        _energy(plan, totals),
        _fence(plan, totals),
        _line_height(plan),
        _height_over_line(plan),
    ]


def _time_limits(plan: MissionPlan) -> Check:
    short = [
        f"tasks[{index}] {task.task} takes about {estimate.duration_s:.0f} s, its time_limit_s is {task.time_limit_s:g}"
        for index, (task, estimate) in enumerate(zip(plan.tasks, estimate_mission(plan), strict=True))
        if estimate.duration_s > task.time_limit_s
    ]
    if short:
        return warning("time_limits", f"{'; '.join(short)}: the mission may end there")
    return passed("time_limits", "every task should be done within its own")


def _energy(plan: MissionPlan, totals: FlightTotals) -> Check:
    battery_wh, reserve = plan.vehicle.battery_wh, plan.safety.battery_low_percent / 100
    words = f"about {totals.energy_wh:.0f} Wh of {battery_wh:g} Wh, {reserve:.0%} are kept"
    if totals.energy_wh > battery_wh * (1 - reserve):
        return failed("energy", f"{words}: a full battery does not suffice; shorten the mission, or mend battery_wh")
    return passed("energy", words)


def _fence(plan: MissionPlan, totals: FlightTotals) -> Check:
    safety = plan.safety
    words = f"the mission goes at most about {totals.reach_m:.0f} m far and {totals.highest_m:g} m high"
    if totals.reach_m > safety.max_distance_m:
        return warning("fence", f"{words}; beyond safety.max_distance_m = {safety.max_distance_m:g} it would end")
    corners = safety.fence.corners_ne_m
    edge_m = nearest_edge_m(corners, 0.0, 0.0) if corners else totals.reach_m
    if totals.reach_m > edge_m:
        # The heading at the start is not known here, so the way cannot be laid over the polygon.
        return warning("fence", f"{words}; safety.fence.polygon_m comes as near as {edge_m:.0f} m, mind the heading")
    return passed("fence", f"{words}, within the fence")


def _line_height(plan: MissionPlan) -> Check:
    """Flying lower than the clearance is refused when the file is read (mission.plan_checks)."""
    safety = plan.safety
    over_m = [leg.lowest_m for leg in reckon(plan) if leg.may_be_over_line]
    if not over_m:
        return passed("line_height", "the mission does not go over the line")
    if safety.line_height_m is None:
        return passed("line_height", "not checked: safety.line_height_m is not given")
    room_m = min(over_m) - safety.line_height_m
    return passed("line_height", f"at least {room_m:.1f} m over the line of {safety.line_height_m:g} m")


def _height_over_line(plan: MissionPlan) -> Check:
    """Whether guidance.height_over_line_m can be: by it offsets become metres, and the line is told from the ground."""
    name, planned_m, line_m = "height_over_line", plan.guidance.height_over_line_m, plan.safety.line_height_m
    looking = (MoveUntil, Align, FollowLines)
    highest_m = max(
        (leg.lowest_m for leg, task in zip(reckon(plan), plan.tasks, strict=True) if isinstance(task, looking)),
        default=None,
    )
    if highest_m is None:
        return passed(name, "the mission does not look for a line")
    words = f"guidance.height_over_line_m is {planned_m:g}"
    if planned_m > ABOVE_GROUND * highest_m:
        return failed(name, f"{words}, but the mission flies {highest_m:g} m high: that is not a line but the ground")
    if line_m is None:
        return passed(name, f"{words}; not compared, as safety.line_height_m is not given")
    over_m = highest_m - line_m
    if over_m > TOO_DEEP * planned_m:
        return failed(
            name,
            f"{words}, but the mission flies {over_m:.1f} m over safety.line_height_m or more: what is more than "
            f"{TOO_DEEP:g} times as deep is not taken for the line; give about {over_m:.0f}",
        )
    if over_m > _ROUGHLY * planned_m:
        return warning(
            name,
            f"{words}, but the mission flies {over_m:.1f} m over safety.line_height_m or more: give about {over_m:.0f}",
        )
    return passed(name, f"{words}, and the mission flies at least {over_m:.1f} m over the line")
