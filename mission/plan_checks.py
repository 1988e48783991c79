"""What a mission must obey beyond types and order: a camera that there can be, and heights over line and fence."""

from mission.camera_plan import CameraError, check_source
from mission.plan import MissionPlan
from mission.plan_rules import RuleBreak
from mission.reach import reckon


def check_plan(plan: MissionPlan) -> list[RuleBreak]:
    """Every broken rule of a mission whose keys are all good."""
    return [*_camera(plan), *_heights_over_line(plan), *_least_heights(plan)]


def _camera(plan: MissionPlan) -> list[RuleBreak]:
    try:
        check_source(plan.camera.source)
    except CameraError:
        allowed = "v4l2:DEVICE, file:PATH or sim:WORLD"
        return [RuleBreak(("camera", "source"), plan.camera.source, allowed)]
    return []


def _heights_over_line(plan: MissionPlan) -> list[RuleBreak]:
    line_m, clearance_m = plan.safety.line_height_m, plan.safety.min_clearance_m
    if line_m is None:
        return []
    return [
        RuleBreak(
            ("tasks", index),
            f"{task.task} at {leg.lowest_m:g} m, where the line may be below",
            f"at least safety.line_height_m + min_clearance_m = {line_m + clearance_m:g} m",
        )
        for index, (task, leg) in enumerate(zip(plan.tasks, reckon(plan), strict=True))
        if leg.may_be_over_line and leg.lowest_m < line_m + clearance_m
    ]


def _least_heights(plan: MissionPlan) -> list[RuleBreak]:
    least_m = plan.safety.fence.min_altitude_m
    if least_m is None:
        return []
    breaks: list[RuleBreak] = []
    was_above = False
    for index, task in enumerate(plan.tasks):
        altitude_m = getattr(task, "altitude_m", None)
        if altitude_m is None:
            continue
        if was_above and altitude_m < least_m:
            breaks.append(
                RuleBreak(
                    ("tasks", index, "altitude_m"),
                    f"{altitude_m:g} m",
                    f"at least safety.fence.min_altitude_m = {least_m:g} m",
                )
            )
        was_above = was_above or altitude_m > least_m
    return breaks
