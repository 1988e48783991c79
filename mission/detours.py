"""Detours: what pauses a task, for how long, and when the task goes on. Pure."""

from dataclasses import dataclass
from typing import Literal

from drivers.clock import NS_PER_S
from mission.guidance import GuidanceSettings
from mission.safety import Hazard, Reaction
from mission.tasks.hold_on import HoldOnTask
from mission.tasks.search_line import SearchLineTask, SearchSettings
from mission.tasks.task import FlightMemory, Task

_HOLDS = (Reaction.HOLD, Reaction.CLIMB_AND_HOLD)

_CLEAR_S = 1.0
"""A hazard that comes back within this was not over."""


@dataclass(slots=True)
class Detour:
    """The task that is flown instead of the mission's, and why. `hazard` is None while a resumed mission is rejoined.

    `held_since_ns` is when it began to hold; `clear_since_ns` since when nothing stands against going on; None while
    that is not so.
    """

    task: Task
    hazard: Hazard | None
    reaction: Reaction
    started_ns: int
    held_since_ns: int | None = None
    clear_since_ns: int | None = None

    def next(
        self, now_ns: int, decision: tuple[Hazard, Reaction] | None, *, hold_limit_s: float, search_limit_s: float
    ) -> Literal["step", "wait", "carry_on", "too_long"]:
        """What to do in this tick: step its task, keep still, go on with the mission's task, or end the mission.

        `decision` asks for a pause, if for anything. A hold is over when nothing asks to hold any more; what else may
        be wrong, such as a lost line, is for the task to meet. A search and a rejoining end by themselves, and keep
        still while something asks them to hold. What holds the vehicle longer than `hold_limit_s`, or searches longer
        than `search_limit_s`, ends the mission.
        """
        is_hold = self.reaction in _HOLDS
        if self.reaction is Reaction.SEARCH and now_ns - self.started_ns > search_limit_s * NS_PER_S:
            return "too_long"
        if decision is None or decision[1] not in _HOLDS:
            return self._step_or_carry_on(now_ns) if is_hold else self._free()
        self.clear_since_ns = None
        if self.held_since_ns is None:
            self.held_since_ns = now_ns
        if now_ns - self.held_since_ns > hold_limit_s * NS_PER_S:
            return "too_long"
        return "step" if is_hold else "wait"

    def _free(self) -> Literal["step"]:
        self.held_since_ns = None
        return "step"

    def _step_or_carry_on(self, now_ns: int) -> Literal["step", "carry_on"]:
        if self.clear_since_ns is None:
            self.clear_since_ns = now_ns
        return "carry_on" if now_ns - self.clear_since_ns >= _CLEAR_S * NS_PER_S else "step"


def detour_task(
    reaction: Reaction, search: SearchSettings, room_m: float, memory: FlightMemory, guidance: GuidanceSettings
) -> Task:
    """The task of a pause. `room_m` is what is left up to the fence: no climb goes farther."""
    climb_m = max(0.0, min(search.climb_m, room_m))
    if reaction is Reaction.SEARCH:
        goal = memory.line_seen_at
        way_back = [] if goal is None else memory.trail.back_to(goal, search.back_m)
        return SearchLineTask(way_back, search, climb_m, guidance)
    return HoldOnTask(climb_m if reaction is Reaction.CLIMB_AND_HOLD else 0.0, guidance)
