"""From what is observed in one control tick to the hazards that stand. Pure functions."""

import math
from dataclasses import dataclass

from drivers.clock import NS_PER_S
from mission.autopilot import VehicleState
from mission.mode_watch import ModeView
from mission.operator import Wish
from mission.safety import PRIORITY, Hazard


@dataclass(frozen=True, slots=True)
class SafetyLimits:
    """The limits that the observation is held against; battery 0 to 1."""

    line_lost_s: float
    estimate_stale_s: float
    telemetry_stale_s: float
    position_bad_s: float
    battery_low: float
    battery_critical: float
    min_disk_bytes: int


@dataclass(frozen=True, slots=True)
class EyesView:
    """What vision says of itself: sentences, None where all is well.

    `sight_ns` is the capture time of the newest frame that could be looked at, `line_seen_ns` that of the newest line;
    each the task's start before the first.
    """

    failure: str | None
    camera_gone: str | None
    camera_blind: str | None
    sight_ns: int
    line_seen_ns: int


@dataclass(frozen=True, slots=True)
class ComputerView:
    """How the companion computer does: sentences where something is wrong, None where all is well.

    `free_disk_bytes` is what the log's disk has left (None: not known).
    """

    free_disk_bytes: int | None = None
    log_failure: str | None = None
    mission_change: str | None = None
    guard_failure: str | None = None


@dataclass(frozen=True, slots=True)
class PaceView:
    """How punctual the control loop is: lateness of this tick [s, wall], and the share of late ones lately."""

    late_s: float = 0.0
    late_share: float = 0.0


@dataclass(frozen=True, slots=True)
class TaskView:
    """What the task that is flown, or was paused, needs and says; `age_s` without the pauses, on a limit `limit_s`.

    `is_going_down` says that our last command was to land or to return. `needs_line` is true for tasks that steer by
    the line.
    """

    age_s: float
    limit_s: float
    needs_line: bool
    needs_vision: bool
    is_going_down: bool
    failure: str | None


@dataclass(frozen=True, slots=True)
class SafetyInput:
    """What safety looks at in one tick. Times are flight time.

    `was_armed` says that the vehicle was seen armed in this flight, `position_bad_s` for how long its position has been
    bad. `fence_breach`, `foreign_setpoint` (the autopilot flies another's), `tracking` (it does not follow ours),
    `refusal` (of a command, by the autopilot), `unsafe_setpoint` (not sent) and `internal_error` are sentences, None
    where all is well. `wish` is what the operator asked for in the live view.
    """

    now_ns: int
    state: VehicleState
    modes: ModeView
    task: TaskView
    eyes: EyesView
    computer: ComputerView
    pace: PaceView
    fence_breach: str | None
    was_armed: bool
    position_bad_s: float
    foreign_setpoint: str | None
    tracking: str | None
    refusal: str | None
    unsafe_setpoint: str | None
    internal_error: str | None
    is_interrupted: bool
    wish: Wish | None = None


FALLING_M_S = 2.0
"""What sinks faster than this has not landed."""

LATE_TICK_S = 0.25
"""A control tick that comes later than this [s, wall] is told."""

LATE_SHARE = 0.3
"""A computer that is late with more of its ticks than this is overloaded."""


def find_hazards(seen: SafetyInput, limits: SafetyLimits) -> dict[Hazard, str]:
    """Every hazard that stands now, most urgent first, each with a sentence for a person."""
    found = (
        _of_modes(seen)
        | _of_link(seen, limits)
        | _of_place(seen, limits)
        | _of_battery(seen, limits)
        | _of_task(seen, limits)
        | _of_eyes(seen, limits)
        | _of_computer(seen, limits)
    )
    sentences = {
        Hazard.SECOND_CONTROLLER: seen.foreign_setpoint,
        Hazard.COMMAND_REFUSED: seen.refusal,
        Hazard.SETPOINT_UNSAFE: seen.unsafe_setpoint,
        Hazard.INTERNAL_ERROR: seen.internal_error,
        Hazard.INTERRUPTED: "the operator asked to stop" if seen.is_interrupted else None,
        Hazard.OPERATOR_LAND: "the operator asked to land" if seen.wish is Wish.LAND else None,
        Hazard.OPERATOR_HOLD: "the operator asked to hold" if seen.wish is Wish.HOLD else None,
    }
    found |= {hazard: words for hazard, words in sentences.items() if words is not None}
    return {hazard: found[hazard] for hazard in PRIORITY if hazard in found}


def _of_modes(seen: SafetyInput) -> dict[Hazard, str]:
    state, modes = seen.state, seen.modes
    # On the way down a vehicle disarms when it has landed; where it falls, it has not.
    may_disarm = seen.task.is_going_down and state.v_down_m_s < FALLING_M_S
    if seen.was_armed and not state.is_armed and not may_disarm:
        return {Hazard.DISARMED: "the vehicle was disarmed before it had landed"}
    if state.mode in modes.explained:
        return {}
    if state.is_failsafe:
        return {Hazard.AUTOPILOT_FAILSAFE: f"the autopilot's own failsafe flies {state.mode} mode"}
    if modes.is_offboard and not modes.was_offboard:
        return {Hazard.OFFBOARD_REFUSED: f"the autopilot accepted offboard and stayed in {state.mode} mode"}
    return {Hazard.TAKEOVER: f"the vehicle is in {state.mode} mode, which our last command does not explain"}


def _of_link(seen: SafetyInput, limits: SafetyLimits) -> dict[Hazard, str]:
    age_s = (seen.now_ns - seen.state.t_ns) / NS_PER_S
    if not seen.state.is_connected:
        return {Hazard.LINK_LOST: "the autopilot's heartbeat is missing"}
    if age_s > limits.telemetry_stale_s:
        return {Hazard.TELEMETRY_STALE: f"the newest position is {age_s:.1f} s old"}
    return {}


def _of_place(seen: SafetyInput, limits: SafetyLimits) -> dict[Hazard, str]:
    if seen.task.is_going_down:
        return {}  # the autopilot chooses its own way home, and RTL_RETURN_ALT may lie above the fence
    found: dict[Hazard, str] = {}
    if seen.fence_breach is not None:
        found[Hazard.GEOFENCE] = seen.fence_breach
    if seen.position_bad_s > limits.position_bad_s:
        found[Hazard.POSITION_BAD] = f"the autopilot has had no good position for {seen.position_bad_s:.1f} s"
    if seen.tracking is not None:
        found[Hazard.TRACKING_ERROR] = seen.tracking
    return found


def _of_battery(seen: SafetyInput, limits: SafetyLimits) -> dict[Hazard, str]:
    battery = math.inf if seen.state.battery is None else seen.state.battery
    words = f"the battery is at {battery:.0%}" if battery <= 1.0 else ""
    if battery <= limits.battery_critical:
        return {Hazard.BATTERY_CRITICAL: words}
    return {Hazard.BATTERY_LOW: words} if battery <= limits.battery_low else {}


def _of_task(seen: SafetyInput, limits: SafetyLimits) -> dict[Hazard, str]:
    task = seen.task
    found: dict[Hazard, str] = {}
    if task.age_s > task.limit_s:
        found[Hazard.TASK_TIMED_OUT] = f"the task took longer than {task.limit_s:g} s"
    if task.failure is not None:
        found[Hazard.TASK_FAILED] = task.failure
    return found


def _of_eyes(seen: SafetyInput, limits: SafetyLimits) -> dict[Hazard, str]:
    """A line that cannot be seen because nothing can be seen is not lost."""
    eyes = seen.eyes
    if not seen.task.needs_vision:
        return {}
    if eyes.failure is not None:
        return {Hazard.VISION_DEAD: eyes.failure}
    if eyes.camera_gone is not None:
        return {Hazard.CAMERA_GONE: eyes.camera_gone}
    if eyes.camera_blind is not None:
        return {Hazard.CAMERA_BLIND: eyes.camera_blind}
    blind_s = (seen.now_ns - eyes.sight_ns) / NS_PER_S
    if blind_s > limits.estimate_stale_s:
        return {Hazard.ESTIMATE_STALE: f"vision's newest frame is {blind_s:.1f} s old"}
    unseen_s = (seen.now_ns - eyes.line_seen_ns) / NS_PER_S
    if seen.task.needs_line and unseen_s > limits.line_lost_s:
        return {Hazard.LINE_LOST: f"no line seen for {unseen_s:.1f} s"}
    return {}


def _of_computer(seen: SafetyInput, limits: SafetyLimits) -> dict[Hazard, str]:
    computer, pace = seen.computer, seen.pace
    found: dict[Hazard, str] = {}
    if computer.guard_failure is not None:
        found[Hazard.GUARD_DEAD] = computer.guard_failure
    if pace.late_share > LATE_SHARE:
        found[Hazard.CPU_OVERLOAD] = f"{pace.late_share:.0%} of the last control ticks were late"
    if pace.late_s > LATE_TICK_S:
        found[Hazard.TICK_LATE] = f"a control tick came {pace.late_s:.2f} s late"
    if computer.free_disk_bytes is not None and computer.free_disk_bytes < limits.min_disk_bytes:
        found[Hazard.DISK_FULL] = f"the log's disk has {computer.free_disk_bytes / 1e6:.0f} MB left"
    if computer.log_failure is not None:
        found[Hazard.LOG_FAILING] = computer.log_failure
    if computer.mission_change is not None:
        found[Hazard.MISSION_CHANGED] = computer.mission_change
    return found
