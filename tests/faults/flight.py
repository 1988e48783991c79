"""One cell of the fault matrix flown: a fault, half a second or so into a task."""

import math
from dataclasses import dataclass, field

from mission.plan import MissionPlan
from mission.records import Result, TaskStarted
from sitl.autopilot import SimAutopilot
from sitl.modes import Mode
from tests.faults.faults import FAULTS, Fault
from tests.faults.table import End
from tests.support.faulty_autopilot import FaultyAutopilot
from tests.support.flights import LINE_HEADING_RAD, LINE_POINT_NED_M, Cockpit, Flown, fly

TAKEOFF = {"task": "takeoff", "altitude_m": 4.0}
UP = {"task": "ascend", "altitude_m": 16.0}
OVER = {"task": "move_until"}
HOME = {"task": "return"}
TASK_PLANS: dict[str, list[dict[str, object]]] = {
    "takeoff": [TAKEOFF, {"task": "land"}],
    "ascend": [TAKEOFF, UP, HOME],
    "descend": [TAKEOFF, UP, {"task": "descend", "altitude_m": 13.0}, HOME],
    "rotate": [TAKEOFF, UP, {"task": "rotate", "angle_deg": 180.0}, HOME],
    "hold": [TAKEOFF, UP, {"task": "hold", "duration_s": 4.0}, HOME],
    "move_forward": [TAKEOFF, UP, {"task": "move_forward", "distance_m": 14.0}, HOME],
    "move_until": [TAKEOFF, UP, OVER, HOME],
    "align": [TAKEOFF, UP, OVER, {"task": "align", "turn": "right"}, HOME],
    "follow_lines": [TAKEOFF, UP, OVER, {"task": "align"}, {"task": "follow_lines", "distance_m": 12.0}, HOME],
    "return": [TAKEOFF, UP, HOME],
    "land": [TAKEOFF, UP, {"task": "land"}],
}
CLEARANCE_M = 2.0
HOME_M = 3.0
_PILOTS_MODES = (Mode.LOITER, Mode.RTL, Mode.LAND, Mode.POSCTL)
_AFTER_S = {"takeoff": 5.0, "return": 4.0, "land": 4.0}
_AFTERWARDS_S = 150.0
_PILOTS_S = 15.0
_SAY_FOR_S = 1.2  # a takeover shows with the next heartbeat
_STEP_S = 0.01
_LOW_BATTERY = 0.0695  # a battery that empties comes from above: just below PX4's BAT_CRIT_THR


@dataclass
class Flight:
    """How it went: `broken` holds what must never happen, in words."""

    end: End
    story: list[str]
    broken: list[str] = field(default_factory=list)


class Watchdog:
    """Looks at the vehicle's truth in every step."""

    def __init__(self, fault: Fault) -> None:
        self._fault = fault
        self._autopilot: FaultyAutopilot | None = None
        self._has_struck = False
        self._struck_s = 0.0
        self._commands: list[str] = []
        self.broken: list[str] = []

    def strike(self, cockpit: Cockpit) -> None:
        """Do the fault, and look on."""
        self._autopilot = cockpit.autopilot
        self._autopilot.catch_up()
        self._struck_s = self._autopilot.sim.boot_s
        self._commands = list(self._autopilot.commands)
        self._fault.do(cockpit)
        self._autopilot.after_step.append(self.look)

    def look(self) -> None:
        """The vehicle has moved a step."""
        assert self._autopilot is not None
        autopilot, sim = self._autopilot, self._autopilot.sim
        if not sim.is_armed or sim.vehicle.is_on_ground:
            return
        age_s = math.inf if sim.commander._seen.setpoint_age_s is None else sim.commander._seen.setpoint_age_s
        if sim.mode is Mode.OFFBOARD and age_s > sim.parameters.get("COM_OF_LOSS_T") + 0.1:
            self._break("in offboard without setpoints")
        if not self._fault.may_touch_line and clearance_m(sim) < CLEARANCE_M:
            self._break(f"nearer to the line than {CLEARANCE_M} m")
        if self._fault.is_takeover and autopilot.commands != self._commands and not autopilot.faults:
            self._break(f"fought the pilot: {autopilot.commands[len(self._commands) :]}")

    def go_on_alone(self, limit_s: float) -> None:
        """Nobody sends anything any more; until the vehicle is down, or `limit_s` have passed."""
        assert self._autopilot is not None
        sim = self._autopilot.sim
        for _ in range(round(limit_s / _STEP_S)):
            if not sim.is_armed and sim.vehicle.is_on_ground:
                return
            sim.step(_STEP_S)
            self.look()

    def _break(self, words: str) -> None:
        if words not in self.broken:
            self.broken.append(words)


def clearance_m(sim: SimAutopilot) -> float:
    """The true distance from the (straight, level) line."""
    n, e, d = (a - b for a, b in zip(sim.vehicle.position_m, LINE_POINT_NED_M, strict=True))
    across_m = -math.sin(LINE_HEADING_RAD) * n + math.cos(LINE_HEADING_RAD) * e
    return math.hypot(across_m, d)


def fly_case(fault_name: str, task: str) -> Flight:
    """Fly the mission for `task`, with the fault in it; then let the vehicle go on alone for a while."""
    fault = next(each for each in FAULTS if each.name == fault_name)
    plan = MissionPlan.model_validate({"version": 1, "name": "fault", "tasks": TASK_PLANS[task]})
    watchdog = Watchdog(fault)
    flown = fly(plan, in_task=task, after_s=_AFTER_S.get(task, 0.7), do=watchdog.strike)
    sim = flown.autopilot.sim
    mode_at_end, was_in_failsafe = sim.mode, sim.failsafe is not None
    # The executive is gone, and so is its stream.
    flown.autopilot._setpoint = None
    # A pilot's vehicle need not come down, and its failsafes would take it from nobody.
    watchdog.go_on_alone(_PILOTS_S if fault.is_takeover else _AFTERWARDS_S)
    is_hovering = sim.is_armed and sim.mode is Mode.LOITER and not fault.is_takeover
    if is_hovering:
        sim.battery.remaining = _LOW_BATTERY
        watchdog.go_on_alone(_AFTERWARDS_S)
    end = _end_of(flown, fault, mode_at_end, was_in_failsafe=was_in_failsafe, is_hovering=is_hovering)
    tasks = [item.task for item in flown.of(TaskStarted)]
    return Flight(end, [*flown.story, f"then {sim.mode.title}, after {tasks[-1]}"], watchdog.broken)


def _end_of(flown: Flown, fault: Fault, mode_at_end: Mode, *, was_in_failsafe: bool, is_hovering: bool) -> End:
    sim, result = flown.autopilot.sim, flown.ended.result
    is_down = not sim.is_armed and sim.vehicle.is_on_ground
    if fault.is_takeover and result is not Result.COMPLETED:
        is_theirs = not was_in_failsafe and (is_down or mode_at_end in _PILOTS_MODES)
        return End.PILOT if is_theirs else End.LOST
    if not is_down:
        return End.LOST
    n, e, _ = sim.vehicle.position_m
    if math.hypot(n, e) > HOME_M:
        return End.ELSEWHERE
    if result is not Result.COMPLETED:
        return End.HOVERS if is_hovering else End.HOME
    return End.PAUSED if any("-> hold" in line or "-> search" in line for line in flown.story) else End.COMPLETED
