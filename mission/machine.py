"""The flight's state machine, built from the mission with `transitions`: which state may follow which.

    preflight -> 1_takeoff -> 2_ascend -> ... -> n_land -> completed
    any task  -> holding | searching -> the same task         (a pause; or going_down when it lasts too long)
    any task  -> going_down -> failed | interrupted           (a reaction ends the mission early)
    any state -> taken_over | failed                          (somebody else has the vehicle, or nothing can be done)
    preflight | 1_takeoff -> rejoining -> any task            (a mission is resumed)

It holds no time and flies nothing; the executive triggers it, and the journal has each transition before it happens.
"""

import itertools
from collections.abc import Awaitable, Callable, Sequence
from typing import Any

from transitions.extensions.asyncio import AsyncMachine

PREFLIGHT = "preflight"
REJOINING = "rejoining"
HOLDING = "holding"
SEARCHING = "searching"
GOING_DOWN = "going_down"
COMPLETED = "completed"
FAILED = "failed"
INTERRUPTED = "interrupted"
TAKEN_OVER = "taken_over"
DETOURS = (REJOINING, HOLDING, SEARCHING)
END_STATES = (COMPLETED, FAILED, INTERRUPTED, TAKEN_OVER)

BeforeChange = Callable[[str, str], Awaitable[None]]


class FlightMachine:
    """States and transitions of one flight.

    `before(source, target)` is awaited before each transition, `after(state)` is called when it has happened. A trigger
    that the present state does not allow raises `transitions.MachineError`: that is a bug, not a hazard.
    """

    state: str

    def __init__(
        self,
        task_names: Sequence[str],
        before: BeforeChange | None = None,
        after: Callable[[str], None] = lambda state: None,
    ) -> None:
        self.task_states = [f"{number}_{name}" for number, name in enumerate(task_names, start=1)]
        self._before = before
        self._after = after
        self._detour_index: int | None = None
        self.machine = AsyncMachine(
            model=self,
            states=[PREFLIGHT, REJOINING, *self.task_states, HOLDING, SEARCHING, GOING_DOWN, *END_STATES],
            initial=PREFLIGHT,
            auto_transitions=False,
            send_event=True,
            before_state_change="_announce",
            after_state_change="_tell",
        )
        add = self.machine.add_transition
        tasks: list[Any] = list(self.task_states)
        for source, target in itertools.pairwise([PREFLIGHT, *tasks, COMPLETED]):
            add("advance", source, target)
        add("rejoin", [PREFLIGHT, tasks[0]], REJOINING)
        add("pause", tasks, HOLDING)
        add("search", tasks, SEARCHING)
        for index, task in enumerate(tasks):
            add("carry_on", list(DETOURS), task, conditions=[self._returns_to(index)])
        add("go_down", [*tasks, *DETOURS], GOING_DOWN)
        add("fail", [PREFLIGHT, GOING_DOWN], FAILED)
        add("interrupt", [PREFLIGHT, GOING_DOWN], INTERRUPTED)
        flying = [PREFLIGHT, *tasks, *DETOURS, GOING_DOWN]
        add("give_up", flying, TAKEN_OVER)
        add("lose", flying, FAILED)

    @property
    def task_index(self) -> int | None:
        """The index of the mission's task that is flown, or was paused; None outside the mission's tasks."""
        if self.state in self.task_states:
            return self.task_states.index(self.state)
        return self._detour_index if self.state in DETOURS else None

    @property
    def is_over(self) -> bool:
        """Whether the flight has ended."""
        return self.state in END_STATES

    async def trigger_named(self, trigger: str, *, towards: int | None = None) -> None:
        """Fire a trigger. A detour goes back to the task it came from, or to the one at index `towards`."""
        detour_index = self.task_index if towards is None else towards
        if trigger in ("pause", "search", "rejoin"):
            self._detour_index = detour_index
        await self.trigger(trigger)  # type: ignore[attr-defined]  # added to the model by transitions

    def _returns_to(self, index: int) -> Callable[[Any], bool]:
        def is_wanted(_event: Any) -> bool:
            return self._detour_index == index

        return is_wanted

    async def _announce(self, event: Any) -> None:
        if self._before is not None:
            await self._before(event.transition.source, event.transition.dest)

    def _tell(self, _event: Any) -> None:
        self._after(self.state)
