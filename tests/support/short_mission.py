"""A mission that follows twelve metres of the line."""


def short_mission(more: str, *, end: str = "return") -> str:
    """Its text, with `more` lines beside the tasks; `end` is its last task."""
    return f"""\
version: 1
name: short
tasks:
  - {{task: takeoff, altitude_m: 5}}
  - {{task: ascend, altitude_m: 16}}
  - {{task: move_until}}
  - {{task: align, turn: right}}
  - {{task: follow_lines, distance_m: 12}}
  - {{task: {end}}}
{more}
"""
