"""The drawing of the state machine: every transition of the machine is in it, and nothing else."""

import re

import pytest

from mission.machine import FlightMachine
from mission.machine_drawing import mermaid
from tests.support.command_line import ROOT, lineflight

TASKS = ["takeoff", "follow_lines", "land"]


def drawn(machine: FlightMachine) -> set[tuple[str, str, str]]:
    """The transitions of a drawing: source, trigger, target; the frame stands for each task."""
    found = set()
    for line in mermaid(machine).splitlines():
        if match := re.fullmatch(r" +(\w+) --> (\w+): ([\w, ]+)", line):
            source, target, triggers = match.groups()
            for one in machine.task_states if source == "tasks" else [source.removeprefix("task_")]:
                for other in machine.task_states if target == "tasks" else [target.removeprefix("task_")]:
                    found |= {(one, trigger, other) for trigger in triggers.split(", ")}
    return found


@pytest.mark.parametrize("tasks", [TASKS, ["takeoff", "land"], ["takeoff", *["hold"] * 12, "return"]])
def test_the_drawing_has_every_transition_and_no_other(tasks: list[str]) -> None:
    machine = FlightMachine(tasks)
    assert drawn(machine) == {
        (source, trigger, transition.dest)
        for trigger, event in machine.machine.events.items()
        for source, transitions in event.transitions.items()
        for transition in transitions
    }


def test_a_state_that_leads_to_every_task_is_drawn_with_one_arrow() -> None:
    machine = FlightMachine(TASKS)
    machine.machine.add_state("waiting")
    machine.machine.add_transition("pause", machine.task_states, "waiting")
    for state in machine.task_states:
        machine.machine.add_transition("go_on", "waiting", state)
    lines = [line.strip() for line in mermaid(machine).splitlines() if "waiting" in line]
    assert lines == ["tasks --> waiting: pause", "waiting --> tasks: go_on"]


def test_no_identifier_begins_with_a_digit() -> None:
    assert not re.search(r"^ *\d|--> \d", mermaid(FlightMachine(TASKS)), re.M)


def test_check_draws_the_machine_of_a_mission() -> None:
    ran = lineflight("check", ROOT / "missions" / "follow_line.yaml", "--diagram")
    assert ran.code == 0
    assert ran.out.startswith("stateDiagram-v2\n")
    assert "task_3_move_until --> task_4_align: advance" in ran.out
