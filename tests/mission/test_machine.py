"""The flight's state machine, every state against every trigger."""

import asyncio

import pytest
from transitions import MachineError

from mission.machine import DETOURS, END_STATES, FlightMachine

TRIGGERS = ("advance", "pause", "search", "rejoin", "carry_on", "go_down", "fail", "interrupt", "give_up", "lose")
TASKS = ("1_takeoff", "2_follow_lines", "3_land")
OUT = {"give_up": "taken_over", "lose": "failed"}
IN_TASK = {"pause": "holding", "search": "searching", "go_down": "going_down", **OUT}
IN_DETOUR = {"carry_on": "2_follow_lines", "go_down": "going_down", **OUT}
TABLE = {
    "preflight": {
        "advance": "1_takeoff",
        "rejoin": "rejoining",
        "fail": "failed",
        "interrupt": "interrupted",
        **OUT,
    },
    "rejoining": IN_DETOUR,
    "1_takeoff": {"advance": "2_follow_lines", "rejoin": "rejoining", **IN_TASK},
    "2_follow_lines": {"advance": "3_land", **IN_TASK},
    "3_land": {"advance": "completed", **IN_TASK},
    "holding": IN_DETOUR,
    "searching": IN_DETOUR,
    "going_down": {"fail": "failed", "interrupt": "interrupted", **OUT},
    "completed": {},
    "failed": {},
    "interrupted": {},
    "taken_over": {},
}


class Heard:
    """What the machine tells: before and after each transition, in one list."""

    def __init__(self) -> None:
        self.words: list[str] = []

    async def before(self, source: str, target: str) -> None:
        self.words.append(f"{source} to {target}")

    def after(self, state: str) -> None:
        self.words.append(f"in {state}")


def machine_in(state: str, heard: Heard | None = None) -> FlightMachine:
    heard = heard or Heard()
    machine = FlightMachine(["takeoff", "follow_lines", "land"], heard.before, heard.after)
    machine.machine.set_state(state)
    if state in DETOURS:
        machine._detour_index = 1
    return machine


def test_the_table_has_every_state_and_every_trigger() -> None:
    machine = machine_in("preflight").machine
    assert set(machine.states) == set(TABLE)
    assert set(machine.events) == set(TRIGGERS)


@pytest.mark.parametrize("state", TABLE)
@pytest.mark.parametrize("trigger", TRIGGERS)
def test_every_state_against_every_trigger(state: str, trigger: str) -> None:
    heard = Heard()
    machine = machine_in(state, heard)
    if trigger in TABLE[state]:
        asyncio.run(machine.trigger_named(trigger))
        target = TABLE[state][trigger]
        assert machine.state == target
        assert heard.words == [f"{state} to {target}", f"in {target}"]
    else:
        with pytest.raises(MachineError):
            asyncio.run(machine.trigger_named(trigger))
        assert machine.state == state
        assert heard.words == []


@pytest.mark.parametrize("task", TASKS)
@pytest.mark.parametrize("detour", ["pause", "search"])
def test_a_detour_goes_back_to_the_task_it_came_from(task: str, detour: str) -> None:
    machine = machine_in(task)

    async def there_and_back() -> int | None:
        await machine.trigger_named(detour)
        index = machine.task_index
        await machine.trigger_named("carry_on")
        return index

    assert asyncio.run(there_and_back()) == TASKS.index(task)
    assert machine.state == task


@pytest.mark.parametrize("index", range(3))
def test_a_resumed_mission_rejoins_any_task(index: int) -> None:
    machine = machine_in("preflight")

    async def rejoin() -> None:
        await machine.trigger_named("rejoin", towards=index)
        assert machine.task_index == index
        await machine.trigger_named("carry_on")

    asyncio.run(rejoin())
    assert machine.state == TASKS[index]


@pytest.mark.parametrize("state", TABLE)
def test_task_index_and_end(state: str) -> None:
    machine = machine_in(state)
    expected = 1 if state in DETOURS else TASKS.index(state) if state in TASKS else None
    assert machine.task_index == expected
    assert machine.is_over == (state in END_STATES)


def test_what_fails_before_a_transition_prevents_it() -> None:
    async def fail(source: str, target: str) -> None:
        raise OSError("no disk")

    machine = FlightMachine(["takeoff", "land"], fail)
    with pytest.raises(OSError, match="no disk"):
        asyncio.run(machine.trigger_named("advance"))
    assert machine.state == "preflight"
