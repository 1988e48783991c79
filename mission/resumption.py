"""Taking an interrupted mission up again: what its journal says is left to do. Pure."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

from mission import plan as p
from mission.autopilot import GlobalPoint, LandedState, Setpoint, VehicleState
from mission.geodesy import local_of
from mission.journal import Begin, Place, Standing, Transition
from mission.machine import COMPLETED, FAILED, GOING_DOWN, TAKEN_OVER
from mission.plan_rules import LANDING_TASKS
from mission.tasks.task import FlightMemory

_WAYS_OUT = (GOING_DOWN, TAKEN_OVER, FAILED)
_LEAST_M = 0.5
_LEAST_S = 0.1


class CannotResumeError(Exception):
    """The mission cannot be resumed; the message is one sentence that says why."""


@dataclass(frozen=True, slots=True)
class Resumption:
    """Where an interrupted mission is taken up again: at `place`, with the task and its progress that `standing` tells.

    `start` is where the mission took off; its heights, its fence and its way home are measured from there. The way to
    `place` is flown `transit_height_m` above it, as high as the mission flies anywhere: the line may lie between.
    """

    standing: Standing
    place: Place
    start: Place
    theta_0_rad: float
    vehicle_uid: str
    transit_height_m: float

    @property
    def index(self) -> int:
        """The index of the task that is taken up."""
        return self.standing.task_index

    def locate(self, origin: GlobalPoint, here: Setpoint) -> tuple[FlightMemory, Setpoint]:
        """The flight's memory, and the place to rejoin at, in the local frame that has its origin at `origin`.

        `here` is where the vehicle is: the autopilot may have been started anew, and have another origin than before.
        """
        start = local_of(self.start.point, self.start.yaw_rad, origin)
        at = local_of(self.place.point, self.place.yaw_rad, origin)
        goal = Setpoint(at.north_m, at.east_m, start.down_m - self.place.height_m, at.yaw_rad)
        return FlightMemory(start, self.theta_0_rad, self.standing.move_until_m, pad=here), goal

    def refusal(self, plan: p.MissionPlan, state: VehicleState, vehicle_uid: str) -> str | None:
        """Why the mission must not be taken up by a vehicle in this state, in a sentence; None where it may."""
        if self.vehicle_uid and vehicle_uid != self.vehicle_uid:
            return f"this vehicle is {vehicle_uid or 'unknown'}, but the mission was begun by {self.vehicle_uid}"
        left = plan.tasks[self.index]
        if state.landed is LandedState.ON_GROUND and left.task in LANDING_TASKS:
            return f"nothing is left to do: the vehicle stands on the ground, and the mission was at its {left.task}"
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
    if begin.start is None:
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
    tasks = list(plan.tasks)
    index = standing.task_index
    tasks[index] = left_of(tasks[index], standing.progress, standing.move_until_m)
    place = standing.place or begin.start
    heights_m = [getattr(task, "altitude_m", 0.0) for task in plan.tasks]
    transit_height_m = max(*heights_m, place.height_m)
    resumption = Resumption(standing, place, begin.start, begin.theta_0_rad, begin.vehicle_uid, transit_height_m)
    return plan.model_copy(update={"tasks": tasks}), resumption


def explain_resumption(plan: p.MissionPlan, resumption: Resumption, begin: Begin) -> list[str]:
    """What resuming would do and why, in lines for a person. `plan` is what is left."""
    standing, task = resumption.standing, plan.tasks[resumption.index]
    when = datetime.fromtimestamp(standing.unix_s).astimezone()
    lines = [
        f"mission  {begin.mission} ({begin.mission_path}), interrupted {when:%Y-%m-%d %H:%M:%S}",
        f"vehicle  {resumption.vehicle_uid or 'unknown'}; another one is refused",
        f"stands   in task {resumption.index + 1}, {task.task}{_done_words(task, standing.progress)}, "
        f"{resumption.place.height_m:.1f} m above the take-off point",
    ]
    left = [each.task for each in plan.tasks[resumption.index :]]
    height_m = resumption.transit_height_m
    if resumption.index == 0:
        lines.append("resume   begins with the take-off, because that was not over")
    else:
        lines.append(
            f"resume   on the ground: takes off, flies at {height_m:.1f} m to where it was interrupted, and goes on"
        )
        lines.append(f"         hovering in hold mode: flies there from where it is, at {height_m:.1f} m, and goes on")
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
