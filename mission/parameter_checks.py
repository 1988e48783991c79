"""Pre-flight: the autopilot's parameters that contradict the mission. Pure.

Names and values are PX4's (https://docs.px4.io, parameter reference of v1.16). What counts is what the autopilot does
over a power line once it is left alone: landing there is the worst, flying home above everything is what we want.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from mission.checks import Check, failed, passed, warning
from mission.plan import MissionPlan
from mission.records import CheckResult

Parameters = Mapping[str, float]

NAMES = (
    "COM_OF_LOSS_T",
    "COM_OBL_RC_ACT",
    "COM_RC_OVERRIDE",
    "RTL_RETURN_ALT",
    "RTL_TYPE",
    "MPC_XY_VEL_MAX",
    "MPC_Z_VEL_MAX_UP",
    "MPC_Z_VEL_MAX_DN",
    "GF_ACTION",
    "GF_MAX_HOR_DIST",
    "GF_MAX_VER_DIST",
    "COM_LOW_BAT_ACT",
    "NAV_DLL_ACT",
)
"""The PX4 parameters that `check_parameters` looks at."""

MAX_OFFBOARD_LOSS_S = 2.0
MIN_OFFBOARD_LOSS_S = 0.5

_LOSS_ACTIONS = {
    0: "Position mode, which without a pilot's sticks sinks where it is: that may be on the line",
    1: "Altitude mode, which without a pilot's sticks sinks where it is: that may be on the line",
    2: "Manual mode, which without a pilot's sticks falls",
    4: "Land, right there: that may be on the line",
    6: "Terminate, which stops the motors",
    7: "Disarm, which stops the motors",
}
_RETURN, _HOLD = 3, 5


@dataclass(frozen=True, slots=True)
class Extent:
    """How far the mission flies: the farthest point from the take-off point, and the highest above it [m]."""

    reach_m: float
    highest_m: float


def check_parameters(parameters: Parameters, plan: MissionPlan, extent: Extent) -> list[Check]:
    """Check each parameter against the mission; a failed one that the mission accepts is a warning."""
    checks = [check(parameters, plan, extent) for check in _CHECKS]
    return [_accepted(check) if check.name in plan.vehicle.accept else check for check in checks]


def _accepted(check: Check) -> Check:
    if check.result is not CheckResult.FAILED:
        return check
    return replace(check, result=CheckResult.WARNING, reason=f"{check.reason} (accepted by the mission)")


def _offboard_loss_time(parameters: Parameters, plan: MissionPlan, extent: Extent) -> Check:
    name = "offboard_loss_time"
    loss_s = parameters.get("COM_OF_LOSS_T")
    if loss_s is None:
        return _untold(name, "COM_OF_LOSS_T")
    if loss_s > MAX_OFFBOARD_LOSS_S:
        return failed(
            name,
            f"COM_OF_LOSS_T is {loss_s:g} s: so long nobody would steer; set it to at most {MAX_OFFBOARD_LOSS_S:g}",
        )
    if loss_s < MIN_OFFBOARD_LOSS_S:
        return warning(name, f"COM_OF_LOSS_T is {loss_s:g} s: a hiccup of the link ends the flight; 1 is usual")
    return passed(name, f"setpoints may be missing for {loss_s:g} s")


def _offboard_loss_action(parameters: Parameters, plan: MissionPlan, extent: Extent) -> Check:
    name = "offboard_loss_action"
    action = parameters.get("COM_OBL_RC_ACT")
    if action is None:
        return _untold(name, "COM_OBL_RC_ACT")
    if action == _RETURN:
        return passed(name, "when our setpoints stop, the vehicle returns")
    if action == _HOLD:
        return warning(
            name, "COM_OBL_RC_ACT is 5: when our setpoints stop, the vehicle hovers until its battery is low"
        )
    words = _LOSS_ACTIONS.get(round(action), "which is unknown here")
    return failed(name, f"COM_OBL_RC_ACT is {action:g}: when our setpoints stop, {words}; set it to 3 (Return)")


def _stick_takeover(parameters: Parameters, plan: MissionPlan, extent: Extent) -> Check:
    name = "stick_takeover"
    override = parameters.get("COM_RC_OVERRIDE")
    if override is None:
        return _unknown(name, "COM_RC_OVERRIDE")
    if round(override) & 2:
        return passed(name, "the pilot's sticks take over in offboard")
    return warning(
        name,
        f"COM_RC_OVERRIDE is {override:g}: in offboard the sticks are ignored, only the mode switch takes over; "
        "set its bit 1 (value 3)",
    )


def _return_altitude(parameters: Parameters, plan: MissionPlan, extent: Extent) -> Check:
    name = "return_altitude"
    altitude_m = parameters.get("RTL_RETURN_ALT")
    if altitude_m is None:
        return _untold(name, "RTL_RETURN_ALT")
    safety = plan.safety
    if safety.line_height_m is None:
        needed_m, why = extent.highest_m, f"the mission flies at {extent.highest_m:g} m"
    else:
        needed_m = safety.line_height_m + safety.min_clearance_m
        why = f"the line needs {safety.line_height_m:g} m and {safety.min_clearance_m:g} m of clearance"
    if altitude_m < needed_m:
        return failed(
            name, f"RTL_RETURN_ALT is {altitude_m:g} m, but {why}; set it to {needed_m:g} or more, below the fence"
        )
    if altitude_m >= safety.max_altitude_m:
        return warning(
            name,
            f"RTL_RETURN_ALT is {altitude_m:g} m, not below the fence of max_altitude_m = {safety.max_altitude_m:g} m",
        )
    kind = parameters.get("RTL_TYPE", 0.0)
    if kind != 0:
        return warning(name, f"RTL_TYPE is {kind:g}: it may not return straight to the take-off point; 0 does")
    return passed(name, f"it returns at {altitude_m:g} m")


def _speeds(parameters: Parameters, plan: MissionPlan, extent: Extent) -> Check:
    name = "speeds"
    guidance = plan.guidance
    wanted = {
        "MPC_XY_VEL_MAX": ("r_m_s", guidance.r_m_s),
        "MPC_Z_VEL_MAX_UP": ("climb_m_s", guidance.climb_m_s),
        "MPC_Z_VEL_MAX_DN": ("descend_m_s", guidance.descend_m_s),
    }
    known = {parameter: wish for parameter, wish in wanted.items() if parameter in parameters}
    if not known:
        return _unknown(name, ", ".join(wanted))
    slow = [
        f"{parameter} is {parameters[parameter]:g} m/s, but guidance.{key} is {speed_m_s:g}"
        for parameter, (key, speed_m_s) in known.items()
        if parameters[parameter] < speed_m_s
    ]
    if slow:
        return warning(name, f"{'; '.join(slow)}: tasks may take longer than their time limits")
    return passed(name, "the autopilot allows the mission's speeds")


def _autopilot_fence(parameters: Parameters, plan: MissionPlan, extent: Extent) -> Check:
    name = "autopilot_fence"
    action = parameters.get("GF_ACTION")
    if action is None:
        return _unknown(name, "GF_ACTION")
    reaches = {"GF_MAX_HOR_DIST": ("far", extent.reach_m), "GF_MAX_VER_DIST": ("high", extent.highest_m)}
    limits_m = {limit: parameters[limit] for limit in reaches if parameters.get(limit, 0.0) > 0}
    _warn, terminate, land = 1, 4, 5
    if not limits_m or action <= _warn:
        return passed(name, "the autopilot has no fence of its own that acts")
    narrow = [
        f"{limit} is {limits_m[limit]:g} m, but the mission flies about {needed_m:.0f} m {word}"
        for limit, (word, needed_m) in reaches.items()
        if limits_m.get(limit, needed_m) < needed_m
    ]
    if narrow:
        return failed(name, f"{'; '.join(narrow)}; widen it, or shorten the mission")
    if action == terminate:
        return failed(name, "GF_ACTION is 4: at its fence the autopilot stops the motors; set it to 3 (Return)")
    if action == land:
        return warning(name, "GF_ACTION is 5: at its fence the autopilot lands, that may be on the line; 3 returns")
    return passed(name, "the mission lies within the autopilot's own fence")


def _low_battery_action(parameters: Parameters, plan: MissionPlan, extent: Extent) -> Check:
    name = "low_battery_action"
    action = parameters.get("COM_LOW_BAT_ACT")
    if action is None:
        return _unknown(name, "COM_LOW_BAT_ACT")
    words = {
        0: "the autopilot only warns of an empty battery",
        1: "the autopilot hovers with an empty battery",
        2: "the autopilot lands with an empty battery, that may be on the line",
    }
    if round(action) in words:
        return warning(name, f"COM_LOW_BAT_ACT is {action:g}: {words[round(action)]}; set it to 3 (return, then land)")
    return passed(name, "with an empty battery the autopilot returns")


def _station_loss_action(parameters: Parameters, plan: MissionPlan, extent: Extent) -> Check:
    """Our heartbeat ends with our program, also while a pilot flies who has taken over: nothing may come of that."""
    name = "station_loss_action"
    action = parameters.get("NAV_DLL_ACT")
    if action is None:
        return _unknown(name, "NAV_DLL_ACT")
    if round(action) == 0:
        return passed(name, "nothing happens when our heartbeat ends")
    return warning(
        name,
        f"NAV_DLL_ACT is {action:g}: when this program ends after a takeover, the autopilot may take the vehicle from "
        "its pilot; keep a ground station connected, or set it to 0",
    )


_CHECKS: tuple[Callable[[Parameters, MissionPlan, Extent], Check], ...] = (
    _offboard_loss_time,
    _offboard_loss_action,
    _stick_takeover,
    _return_altitude,
    _speeds,
    _autopilot_fence,
    _low_battery_action,
    _station_loss_action,
)


def _untold(name: str, parameter: str) -> Check:
    """Every PX4 has it, and it matters: silence is a poor link, not a parameter that does not exist."""
    return warning(name, f"the autopilot did not tell {parameter}: not checked; look at it yourself")


def _unknown(name: str, parameter: str) -> Check:
    return passed(name, f"this autopilot does not have {parameter}: not checked")
