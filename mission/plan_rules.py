"""What a mission's tasks must obey beyond their types: order, landing, and the fence.

The rules work on the raw tasks, so that they report together with the errors of types.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

DEFAULT_TAKEOFF_M = 5.0
LANDING_TASKS = ("land", "return")


@dataclass(frozen=True, slots=True)
class RuleBreak:
    """A broken rule: where (`location` as pydantic writes it), what was found, what is allowed."""

    location: tuple[str | int, ...]
    found: str
    allowed: str


def check_rules(tasks: Sequence[object], max_altitude_m: object) -> list[RuleBreak]:
    """Every broken rule of a mission's task list.

    `tasks` are the raw items of the file; what is not a mapping with a task's name is left to the type checks.
    `max_altitude_m` is the fence's height as given, or its default.
    """
    names = [item.get("task") if isinstance(item, Mapping) else None for item in tasks]
    breaks: list[RuleBreak] = []
    if not names:
        return breaks
    if names[0] != "takeoff" and names[0] is not None:
        breaks.append(RuleBreak(("tasks", 0, "task"), f"{names[0]} before takeoff", "takeoff as the first task"))
    for index, name in enumerate(names):
        if name == "takeoff" and index > 0:
            breaks.append(
                RuleBreak(("tasks", index, "task"), "takeoff in mid-mission", "takeoff only as the first task")
            )
        if name in LANDING_TASKS and index < len(names) - 1:
            breaks.append(
                RuleBreak(("tasks", index, "task"), f"{name} with tasks after it", f"{name} only as the last task")
            )
    if names[-1] is not None and names[-1] not in LANDING_TASKS:
        breaks.append(
            RuleBreak(
                ("tasks", len(names) - 1, "task"),
                f"a mission that ends with {names[-1]}",
                "land or return as the last task",
            )
        )
    breaks += _check_distances(tasks, names)
    breaks += _check_altitudes(tasks, max_altitude_m)
    return breaks


def _check_distances(tasks: Sequence[object], names: Sequence[object]) -> list[RuleBreak]:
    return [
        RuleBreak(("tasks", index, "distance_m"), "as_move_until without a move_until before", "a number of metres")
        for index, item in enumerate(tasks)
        if isinstance(item, Mapping) and item.get("distance_m") == "as_move_until" and "move_until" not in names[:index]
    ]


def _check_altitudes(tasks: Sequence[object], max_altitude_m: object) -> list[RuleBreak]:
    """Heights within the fence, ascend upwards and descend downwards."""
    breaks: list[RuleBreak] = []
    current_m: float | None = None
    for index, item in enumerate(tasks):
        altitude_m = item.get("altitude_m") if isinstance(item, Mapping) else None
        if altitude_m is None and isinstance(item, Mapping) and item.get("task") == "takeoff":
            altitude_m = DEFAULT_TAKEOFF_M
        if not isinstance(item, Mapping) or isinstance(altitude_m, bool) or not isinstance(altitude_m, int | float):
            continue
        where = ("tasks", index, "altitude_m")
        if isinstance(max_altitude_m, int | float) and altitude_m > max_altitude_m:
            breaks.append(
                RuleBreak(where, f"{altitude_m:g} m", f"at most safety.max_altitude_m = {max_altitude_m:g} m")
            )
        if current_m is not None and item.get("task") == "ascend" and altitude_m <= current_m:
            breaks.append(
                RuleBreak(where, f"ascend to {altitude_m:g} m", f"more than the {current_m:g} m flown before")
            )
        if current_m is not None and item.get("task") == "descend" and altitude_m >= current_m:
            breaks.append(
                RuleBreak(where, f"descend to {altitude_m:g} m", f"less than the {current_m:g} m flown before")
            )
        current_m = float(altitude_m)
    return breaks
