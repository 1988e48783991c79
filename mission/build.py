"""From the plan that people write, in degrees, to the objects that fly, in radians."""

import math
from collections.abc import Mapping
from dataclasses import replace

from drivers.camera.camera import Intrinsics
from mission import plan as p
from mission.geofence import Fence
from mission.guidance import GuidanceSettings
from mission.hazards import SafetyLimits
from mission.known_line import MAX_TURN_RAD
from mission.limits import SetpointLimits
from mission.safety import Hazard, Reaction
from mission.tasks.align import AlignTask
from mission.tasks.change_altitude import ChangeAltitudeTask
from mission.tasks.follow_lines import FollowLinesTask
from mission.tasks.go_down import GoDownTask
from mission.tasks.hold import HoldTask
from mission.tasks.move_forward import MoveForwardTask
from mission.tasks.move_until import MoveUntilTask
from mission.tasks.rotate import RotateTask
from mission.tasks.search_line import SearchSettings
from mission.tasks.takeoff import TakeoffTask
from mission.tasks.task import Command, FlightMemory, Task
from vision.pipeline import VisionSettings
from vision.records import wrap_line_angle_rad


def guidance_settings(plan: p.GuidancePlan) -> GuidanceSettings:
    """The guidance section in the program's units."""
    return GuidanceSettings(
        is_centred=plan.law == "centred",
        r_m_s=plan.r_m_s,
        P_per_s=plan.P_per_s,
        epsilon_rad=math.radians(plan.epsilon_deg),
        theta_0_rad=None if plan.theta_0_deg is None else math.radians(plan.theta_0_deg),
        climb_m_s=plan.climb_m_s,
        descend_m_s=plan.descend_m_s,
        yaw_rate_rad_s=math.radians(plan.yaw_rate_deg_s),
        lateral_per_s=plan.lateral_per_s,
        lateral_max_m_s=plan.lateral_max_m_s,
        lateral_lead=plan.lateral_lead,
        height_over_line_m=plan.height_over_line_m,
        conductor_spacing_m=plan.conductor_spacing_m,
        leash_m=plan.leash_m,
        arrival_m=plan.arrival_m,
        max_estimate_age_s=plan.max_estimate_age_s,
    )


def safety_limits(plan: p.SafetyPlan) -> SafetyLimits:
    """The safety section in the program's units."""
    return SafetyLimits(
        line_lost_s=plan.line_lost_s,
        estimate_stale_s=plan.estimate_stale_s,
        telemetry_stale_s=plan.telemetry_stale_s,
        position_bad_s=plan.position_bad_s,
        battery_low=plan.battery_low_percent / 100,
        battery_critical=plan.battery_critical_percent / 100,
        min_disk_bytes=round(plan.min_disk_mb * 1e6),
    )


def setpoint_limits(plan: p.MissionPlan) -> SetpointLimits:
    """What no setpoint of the mission may pass."""
    return SetpointLimits(plan.guidance.leash_m, plan.safety.max_distance_m, plan.safety.max_altitude_m)


def search_settings(plan: p.SafetyPlan) -> SearchSettings:
    """How a lost line is searched for, in the program's units."""
    search = plan.line_search
    return SearchSettings(search.climb_m, math.radians(search.sweep_deg), search.back_m, search.n_detections)


def fence(plan: p.SafetyPlan) -> Fence:
    """The fence around the flight."""
    return Fence(plan.max_distance_m, plan.max_altitude_m, plan.fence.corners_ne_m, plan.fence.min_altitude_m)


def reactions(plan: p.SafetyPlan) -> Mapping[Hazard, Reaction]:
    """The mission's reaction to each hazard that it may choose one for."""
    return {Hazard(name): Reaction(value) for name, value in plan.reactions.model_dump().items()}


def vision_settings(plan: p.MissionPlan, camera: Intrinsics) -> VisionSettings:
    """The line finder's settings for a camera, with the plan's thresholds.

    The widest conductor is one of the plan's largest diameter, half as far away as the line should be, and two pixels
    of the lens's blur more: wheel tracks and kerbs are wider.
    """
    defaults, vision = VisionSettings(), plan.vision
    nearest_m = plan.guidance.height_over_line_m / 2
    return replace(
        defaults,
        camera=camera,
        max_conductor_width_px=vision.max_conductor_diameter_m / nearest_m * camera.fx_px + 2.0,
        presence_min_support=min(1.0, defaults.presence_min_support * vision.presence_scale),
        presence_min_sigmas=defaults.presence_min_sigmas * vision.presence_scale,
    )


def build_task(plan: p.AnyTask, guidance: GuidanceSettings, memory: FlightMemory) -> Task:
    """The task in flight for a task of the plan, made when the flight reaches it."""
    match plan:
        case p.Takeoff():
            return TakeoffTask(plan.altitude_m, guidance, memory)
        case p.Ascend() | p.Descend():
            return ChangeAltitudeTask(plan.altitude_m, guidance, memory)
        case p.Rotate():
            angle_rad = math.radians(plan.angle_deg)
            if abs(wrap_line_angle_rad(angle_rad)) > MAX_TURN_RAD:
                memory.known_line.forget()  # it may be followed by another line's task
            return RotateTask(angle_rad, guidance)
        case p.MoveForward():
            distance_m = None if plan.distance_m == "as_move_until" else float(plan.distance_m)
            return MoveForwardTask(distance_m, guidance, memory)
        case p.MoveUntil():
            is_overhead = plan.until == "overhead"
            return MoveUntilTask(plan.max_distance_m, plan.n_detections, guidance, memory, is_overhead=is_overhead)
        case p.Align():
            return AlignTask(plan.turn, plan.n_detections, guidance, memory)
        case p.FollowLines():
            return FollowLinesTask(plan.distance_m, guidance, memory)
        case p.Hold():
            return HoldTask(plan.duration_s)
        case p.Return():
            return GoDownTask(Command.RETURN, memory)
        case p.Land():
            return GoDownTask(Command.LAND, memory)
