"""Taking an interrupted mission up again: what its journal says is left to do. Pure."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime

from mission import plan as p
from mission.autopilot import GlobalPoint, Setpoint, VehicleState
from mission.geodesy import local_of
from mission.journal import Begin, Place, Standing, Transition
from mission.machine import COMPLETED, FAILED, GOING_DOWN, TAKEN_OVER
from mission.plan_rules import LANDING_TASKS
from mission.tasks.task import FlightMemory

_WAYS_OUT = (GOING_DOWN, TAKEN_OVER, FAILED)
_SAME_ORIGIN_M = 1.0
FROM_START_M = 10.0
"""How far from its take-off point a vehicle on the ground may take a mission up again."""

_LEAST_M = 0.5
_LEAST_S = 0.1


class CannotResumeError(Exception):
    """The mission cannot be resumed; the message is one sentence that says why."""


@dataclass(frozen=True, slots=True)
class Resumption:
    """Where an interrupted mission is taken up again: at `place`, with the task and its progress that `standing` tells.

    `start` is where the mission took off, and `origin` where the local frame had its origin then. The way to `place` is
    flown `transit_height_m` above the start, as high as the mission flies anywhere and clear of the line: it may lie
    between. There the vehicle goes down to `height_m`, at which the task is planned.
    """

    standing: Standing
    place: Place
    start: Place
    origin: Place
    theta_0_rad: float
    vehicle_uid: str
    height_m: float
    transit_height_m: float

    @property
    def index(self) -> int:
        """The index of the task that is taken up."""
        return self.standing.task_index

    def in_the_air(self, plan: p.MissionPlan) -> "Resumption":
        """The same for a vehicle that flies: where the take-off was interrupted, it has been done since."""
        first = plan.tasks[0]
        if self.index > 0 or not isinstance(first, p.Takeoff):
            return self
        standing = self.standing.model_copy(update={"task_index": 1, "progress": 0.0})
        return replace(self, standing=standing, place=self.start, height_m=first.altitude_m)

    def locate(self, origin: GlobalPoint, here: Setpoint, *, is_flying: bool) -> tuple[FlightMemory, Setpoint]:
        """The flight's memory, and the place to rejoin at, in the local frame that has its origin at `origin`.

        `here` is where the vehicle is. On the ground that is the height that counts: an autopilot that was started anew
        has another origin, whose altitude GPS gives to some metres only.
        """
        start = local_of(self.start.point, self.start.yaw_rad, origin)
        if not is_flying:
            start = replace(start, down_m=here.down_m)
        at = local_of(self.place.point, self.place.yaw_rad, origin)
        goal = Setpoint(at.north_m, at.east_m, start.down_m - self.height_m, at.yaw_rad)
        pad = start if is_flying else here
        return FlightMemory(start, self.theta_0_rad, self.standing.move_until_m, pad=pad), goal

    def refusal(
        self, plan: p.MissionPlan, state: VehicleState, vehicle_uid: str, origin: GlobalPoint, *, is_flying: bool
    ) -> str | None:
        """Why the mission must not be taken up by a vehicle in this state, in a sentence; None where it may."""
        if self.vehicle_uid and vehicle_uid != self.vehicle_uid:
            return f"this vehicle is {vehicle_uid or 'unknown'}, but the mission was begun by {self.vehicle_uid}"
        left = plan.tasks[self.index]
        if is_flying:
            moved = local_of(self.origin.point, 0.0, origin)
            if math.hypot(moved.north_m, moved.east_m, moved.down_m) > _SAME_ORIGIN_M:
                return "the autopilot was started anew since the mission was interrupted: land, then resume"
            return None
        if left.task in LANDING_TASKS:
            return f"nothing is left to do: the vehicle stands on the ground, and the mission was at its {left.task}"
        start = local_of(self.start.point, 0.0, origin)
        away_m = math.hypot(start.north_m - state.north_m, start.east_m - state.east_m)
        if away_m > FROM_START_M:
            # The autopilot's way home ends where it takes off: beside the line, it would end on the line.
            return (
                f"the vehicle stands {away_m:.0f} m from where the mission took off; carry it back to within "
                f"{FROM_START_M:g} m, from where its way home is clear"
            )
        return None


def find_resumption(
    begin: Begin, entries: Sequence[Transition | Standing], plan: p.MissionPlan, mission_sha256: str
) -> tuple[p.MissionPlan, Resumption]:
    """What is left of the mission, and where to take it up. Raises CannotResumeError.

    `begin` and `entries` are a journal's, `plan` and `mission_sha256` those of the mission file as it is now. A task
    that can simply be done again (a climb, an alignment) is; of the others the rest is left.
    """
    if begin.mission_sha256 != mission_sha256:
        raise CannotResumeError(
            f"the mission file {begin.mission_path} has changed since; fly it from its beginning with lineflight run"
        )
    if begin.start is None or begin.origin is None:
        raise CannotResumeError("the journal does not know where on Earth the mission began")
    standing = begin.resumed or Standing(
        unix_s=begin.unix_s, task_index=0, progress=0.0, move_until_m=None, place=begin.start
    )
    has_rejoined = begin.resumed is None
    for entry in entries:
        target = entry.target if isinstance(entry, Transition) else ""
        if target == COMPLETED:
            raise CannotResumeError("the mission was completed; nothing is left to do")
        # The way back to where the mission was interrupted, a take-off included, is no part of it.
        has_rejoined = has_rejoined or _task_index(target) == standing.task_index
        if not has_rejoined:
            continue
        standing = _standing_after(entry, standing)
        if target in _WAYS_OUT:
            break  # what follows is the way down
    index = standing.task_index
    if index >= len(plan.tasks):
        raise CannotResumeError(f"the journal is at task {index + 1}, but the mission has {len(plan.tasks)}")
    tasks = list(plan.tasks)
    tasks[index] = left_of(tasks[index], standing.progress, standing.move_until_m)
    place = standing.place or begin.start
    heights_m = [getattr(task, "altitude_m", 0.0) for task in plan.tasks]
    line_m = plan.safety.line_height_m
    clear_m = 0.0 if line_m is None else line_m + plan.safety.min_clearance_m
    planned_m = _planned_height_m(plan, index, place.height_m)
    resumption = Resumption(
        standing,
        place,
        begin.start,
        begin.origin,
        begin.theta_0_rad,
        begin.vehicle_uid,
        height_m=planned_m,
        transit_height_m=min(max(*heights_m, clear_m, planned_m), plan.safety.max_altitude_m - 1.0),
    )
    return plan.model_copy(update={"tasks": tasks}), resumption


def plan_to_reckon(plan: p.MissionPlan, index: int) -> p.MissionPlan:
    """The mission for which battery and parameters must be good: what is left, and the heights flown before."""
    before = [task for task in plan.tasks[:index] if isinstance(task, p.Takeoff | p.Ascend | p.Descend)]
    return plan.model_copy(update={"tasks": [*before, *plan.tasks[index:]]})


def _planned_height_m(plan: p.MissionPlan, index: int, height_m: float) -> float:
    """At which height a task is taken up: the one it is planned at, not where a pilot or a search left the vehicle.

    A task that changes the height is taken up where it was, but not below where it began or, sinking, where it goes.
    """
    before_m = next((t.altitude_m for t in reversed(plan.tasks[:index]) if hasattr(t, "altitude_m")), 0.0)
    match plan.tasks[index]:
        case p.Ascend():
            return max(before_m, height_m)
        case p.Descend(altitude_m=goal_m):
            return max(goal_m, height_m)
        case p.Return() | p.Land():
            return max(before_m, height_m)
        case p.FollowLines() if plan.guidance.conductor_spacing_m is not None:
            return max(before_m, height_m)  # it climbs with the conductors
        case _:
            return before_m


def explain_resumption(plan: p.MissionPlan, resumption: Resumption, begin: Begin) -> list[str]:
    """What resuming would do and why, in lines for a person. `plan` is what is left."""
    standing, task = resumption.standing, plan.tasks[resumption.index]
    when = datetime.fromtimestamp(standing.unix_s).astimezone()
    lines = [
        f"mission  {begin.mission} ({begin.mission_path}), interrupted {when:%Y-%m-%d %H:%M:%S}",
        f"vehicle  {resumption.vehicle_uid}; another one is refused"
        if resumption.vehicle_uid
        else "vehicle  it told no number: see yourself that it is the same",
        f"stands   in task {resumption.index + 1}, {task.task}{_done_words(task, standing.progress)}, "
        f"to be taken up {resumption.height_m:.1f} m above the take-off point",
    ]
    left = [each.task for each in plan.tasks[resumption.index :]]
    height_m = resumption.transit_height_m
    if resumption.index == 0:
        lines.append("resume   begins with the take-off, because that was not over")
    else:
        lines.append(
            f"resume   on the ground, within {FROM_START_M:g} m of the take-off point: takes off, flies at "
            f"{height_m:.1f} m to where it was interrupted, and goes on"
        )
        lines.append(
            f"         hovering in hold mode: climbs straight up to {height_m:.1f} m, which must be free, flies there, "
            "and goes on"
        )
    lines.append("left     " + ", ".join(left))
    return lines


def _done_words(task: p.AnyTask, progress: float) -> str:
    match task:
        case p.FollowLines() | p.MoveUntil() | p.MoveForward() if progress > 0:
            return f" ({progress:.1f} m of it done)"
        case p.Rotate() if progress != 0:
            return f" ({math.degrees(progress):.0f} degrees of it done)"
        case p.Hold() if progress > 0:
            return f" ({progress:.0f} s of it done)"
        case _:
            return ""


def _standing_after(entry: Transition | Standing, before: Standing) -> Standing:
    """Where the mission stands after an entry. A new task has nothing done; one that was left keeps what it has."""
    entered = entry.task_index if isinstance(entry, Standing) else _task_index(entry.target)
    if entered is None:  # on the way down, or in a pause: the task that was left is the one to take up
        entered = entry.task_index
    if entered is None:
        return before
    is_new = entered != entry.task_index
    return Standing(
        unix_s=entry.unix_s,
        task_index=entered,
        progress=0.0 if is_new else entry.progress,
        move_until_m=entry.move_until_m,
        place=entry.place or before.place,
    )


def _task_index(state: str) -> int | None:
    """The index of the task that a state of the machine stands for, such as 3_align; None for the other states."""
    number, _, name = state.partition("_")
    return int(number) - 1 if number.isdigit() and name else None


def left_of(task: p.AnyTask, progress: float, move_until_m: float | None) -> p.AnyTask:
    """What is left of a task after `progress` [m, rad or s] of it."""
    match task:
        case p.FollowLines():
            return task.model_copy(update={"distance_m": max(_LEAST_M, task.distance_m - progress)})
        case p.MoveUntil():
            return task.model_copy(update={"max_distance_m": max(_LEAST_M, task.max_distance_m - progress)})
        case p.MoveForward():
            distance_m = move_until_m if task.distance_m == "as_move_until" else float(task.distance_m)
            if distance_m is None:
                return task
            return task.model_copy(update={"distance_m": max(_LEAST_M, distance_m - progress)})
        case p.Rotate():
            return task.model_copy(update={"angle_deg": task.angle_deg - math.degrees(progress)})
        case p.Hold():
            return task.model_copy(update={"duration_s": max(_LEAST_S, task.duration_s - progress)})
        case _:
            return task
