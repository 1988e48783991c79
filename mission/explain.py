"""What `lineflight check` says about a mission: each task in words, and what the flight should take."""

from collections.abc import Sequence

from rich import box
from rich.console import Console
from rich.table import Table

from mission.estimate import TaskEstimate
from mission.plan import MissionPlan


def print_plan(plan: MissionPlan, estimates: Sequence[TaskEstimate], console: Console) -> None:
    """Print the mission as a table, with its sums and its limits."""
    console.print(f"[bold]{plan.name}[/bold]  {plan.description}", highlight=False, soft_wrap=True)
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("", justify="right", style="dim")
    table.add_column("task", style="bold")
    table.add_column("what it does", max_width=60)
    table.add_column("about", justify="right")
    table.add_column("height", justify="right")
    for number, estimate in enumerate(estimates, start=1):
        table.add_row(
            str(number), estimate.task, estimate.sentence, f"{estimate.duration_s:.0f} s", f"{estimate.altitude_m:g} m"
        )
    console.print(table)
    duration_s = sum(estimate.duration_s for estimate in estimates)
    distance_m = sum(estimate.distance_m for estimate in estimates)
    console.print(f"about {duration_s:.0f} s and {distance_m:.0f} m over ground", highlight=False)
    safety = plan.safety
    console.print(
        f"fence {safety.max_distance_m:g} m around and {safety.max_altitude_m:g} m above the take-off point; "
        f"line lost for {safety.line_lost_s:g} s: {safety.reactions.line_lost}; "
        f"Ctrl-C: hold, then {safety.reactions.interrupted.replace('_', ' ')}",
        highlight=False,
        soft_wrap=True,
    )
