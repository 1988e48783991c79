"""The flight's state machine, every state against every trigger."""

import asyncio

import pytest
from transitions import MachineError

from mission.machine import END_STATES, FlightMachine

TRIGGERS = ("advance", "go_down", "fail", "interrupt", "give_up")
TASKS = ("1_takeoff", "2_follow_lines", "3_land")
TABLE = {
    "preflight": {"advance": "1_takeoff", "fail": "failed", "interrupt": "interrupted", "give_up": "taken_over"},
    "1_takeoff": {"advance": "2_follow_lines", "go_down": "going_down", "give_up": "taken_over"},
    "2_follow_lines": {"advance": "3_land", "go_down": "going_down", "give_up": "taken_over"},
    "3_land": {"advance": "completed", "go_down": "going_down", "give_up": "taken_over"},
    "going_down": {"fail": "failed", "interrupt": "interrupted", "give_up": "taken_over"},
    "completed": {},
    "failed": {},
    "interrupted": {},
    "taken_over": {},
}


def machine_in(state: str, heard: list[str] | None = None) -> FlightMachine:
    machine = FlightMachine(["takeoff", "follow_lines", "land"], (heard if heard is not None else []).append)
    machine.machine.set_state(state)
    return machine


def test_the_table_has_every_state() -> None:
    assert set(machine_in("preflight").machine.states) == set(TABLE)


@pytest.mark.parametrize("state", TABLE)
@pytest.mark.parametrize("trigger", TRIGGERS)
def test_every_state_against_every_trigger(state: str, trigger: str) -> None:
    heard: list[str] = []
    machine = machine_in(state, heard)
    if trigger in TABLE[state]:
        asyncio.run(machine.trigger_named(trigger))
        assert machine.state == TABLE[state][trigger]
        assert heard == [machine.state]
    else:
        with pytest.raises(MachineError):
            asyncio.run(machine.trigger_named(trigger))
        assert machine.state == state
        assert heard == []


@pytest.mark.parametrize("state", TABLE)
def test_task_index_and_end(state: str) -> None:
    machine = machine_in(state)
    assert machine.task_index == (TASKS.index(state) if state in TASKS else None)
    assert machine.is_over == (state in END_STATES)
