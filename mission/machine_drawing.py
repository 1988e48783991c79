"""The flight's state machine as a Mermaid drawing, from the machine itself."""

from collections.abc import Iterator

from mission.machine import END_STATES, FlightMachine
from mission.plan import MissionPlan

_TASKS = "tasks"

Edge = tuple[str, str, str]
"""Source, trigger, target."""


def draw_mission(plan: MissionPlan) -> str:
    """Draw the state machine that flies a mission."""
    return mermaid(FlightMachine([task.task for task in plan.tasks]))


def mermaid(machine: FlightMachine) -> str:
    """Draw a machine as a Mermaid stateDiagram-v2, https://mermaid.js.org.

    The mission's tasks stand in a frame: an arrow from the frame leaves every one of them, and one to it leads to each.
    """
    edges = _edges(machine)
    inner = [edge for edge in edges if edge[0] in machine.task_states and edge[2] in machine.task_states]
    outer = [edge for edge in _framed(edges, machine.task_states) if edge not in inner]
    lines = ["stateDiagram-v2", f"    [*] --> {machine.machine.initial}", f"    state {_TASKS} {{"]
    lines += [f'        state "{state.replace("_", " ")}" as {_identifier(state)}' for state in machine.task_states]
    lines += [f"        {arrow}" for arrow in _arrows(inner)]
    lines.append("    }")
    lines += [f"    {arrow}" for arrow in _arrows(outer)]
    lines += [f"    {state} --> [*]" for state in END_STATES]
    return "\n".join(lines) + "\n"


def _edges(machine: FlightMachine) -> list[Edge]:
    return [
        (source, trigger, transition.dest)
        for trigger, event in machine.machine.events.items()
        for source, transitions in event.transitions.items()
        for transition in transitions
        if transition.dest is not None
    ]


def _framed(edges: list[Edge], task_states: list[str]) -> list[Edge]:
    """The edges, those that leave every task or lead to every task drawn as one of the frame."""
    tasks = set(task_states)
    framed: dict[Edge, None] = {}
    for source, trigger, target in edges:
        sources = {one for one, other, to in edges if other == trigger and to == target}
        targets = {to for one, other, to in edges if other == trigger and one == source}
        from_all = source in tasks and tasks <= sources and target not in tasks
        to_all = target in tasks and tasks <= targets and source not in tasks
        framed[_TASKS if from_all else source, trigger, _TASKS if to_all else target] = None
    return list(framed)


def _arrows(edges: list[Edge]) -> Iterator[str]:
    """An arrow for each pair of states, with all the triggers that lead along it."""
    for source, target in dict.fromkeys((source, target) for source, _, target in edges):
        triggers = dict.fromkeys(trigger for one, trigger, other in edges if (one, other) == (source, target))
        yield f"{_identifier(source)} --> {_identifier(target)}: {', '.join(triggers)}"


def _identifier(state: str) -> str:
    """Mermaid's identifiers do not begin with a digit."""
    return f"task_{state}" if state[:1].isdigit() else state
