"""The flight's state machine, built from the mission with `transitions`: which state may follow which.

    preflight -> 1_takeoff -> 2_ascend -> ... -> n_land -> completed
    any task  -> going_down -> failed | interrupted        (a reaction ends the mission early)
    any state -> taken_over                                (the pilot has the vehicle; or nothing can be done)

It holds no time and flies nothing; the executive triggers it and the log hears of every change.
"""

import itertools
from collections.abc import Callable, Sequence

from transitions.extensions.asyncio import AsyncMachine

PREFLIGHT = "preflight"
GOING_DOWN = "going_down"
COMPLETED = "completed"
FAILED = "failed"
INTERRUPTED = "interrupted"
TAKEN_OVER = "taken_over"
END_STATES = (COMPLETED, FAILED, INTERRUPTED, TAKEN_OVER)


class FlightMachine:
    """States and transitions of one flight.

    `on_change(state)` is called after each transition. A trigger that the present state does not allow raises
    `transitions.MachineError`: that is a bug, not a hazard.
    """

    state: str

    def __init__(self, task_names: Sequence[str], on_change: Callable[[str], None]) -> None:
        self.task_states = [f"{number}_{name}" for number, name in enumerate(task_names, start=1)]
        self._on_change = on_change
        self.machine = AsyncMachine(
            model=self,
            states=[PREFLIGHT, *self.task_states, GOING_DOWN, *END_STATES],
            initial=PREFLIGHT,
            auto_transitions=False,
            after_state_change="_changed",
        )
        chain = [PREFLIGHT, *self.task_states, COMPLETED]
        for source, target in itertools.pairwise(chain):
            self.machine.add_transition("advance", source, target)
        self.machine.add_transition("go_down", [*self.task_states], GOING_DOWN)
        self.machine.add_transition("fail", [PREFLIGHT, GOING_DOWN], FAILED)
        self.machine.add_transition("interrupt", [PREFLIGHT, GOING_DOWN], INTERRUPTED)
        self.machine.add_transition("give_up", [PREFLIGHT, *self.task_states, GOING_DOWN], TAKEN_OVER)

    @property
    def task_index(self) -> int | None:
        """The index of the mission's task that is flown now; None outside the mission's tasks."""
        return self.task_states.index(self.state) if self.state in self.task_states else None

    @property
    def is_over(self) -> bool:
        """Whether the flight has ended."""
        return self.state in END_STATES

    async def trigger_named(self, trigger: str) -> None:
        """Fire a trigger: advance, go_down, fail, interrupt or give_up."""
        await self.trigger(trigger)  # type: ignore[attr-defined]  # added to the model by transitions

    def _changed(self) -> None:
        self._on_change(self.state)
