"""What `lineflight check` says about a mission: each task in words, what the flight takes, and whether it may fly."""

from collections.abc import Sequence

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from mission.checks import Check
from mission.estimate import estimate_mission, total
from mission.plan import CameraPlan, MissionPlan
from mission.reach import reckon
from mission.records import CheckResult

_STYLES = {CheckResult.OK: "green", CheckResult.WARNING: "yellow", CheckResult.FAILED: "bold red"}


def print_plan(plan: MissionPlan, checks: Sequence[Check], console: Console) -> None:
    """Print the mission as a table, with its sums and limits, then a line for each check."""

    def say(words: str | Text) -> None:
        console.print(words, highlight=False, soft_wrap=True)

    say(f"[bold]{plan.name}[/bold]  {plan.description}")
    console.print(_task_table(plan))
    safety, totals = plan.safety, total(plan)
    say(f"about {totals.duration_s:.0f} s and {totals.distance_m:.0f} m over ground")
    say(_camera_words(plan.camera))
    say(
        f"fence {safety.max_distance_m:g} m around and {safety.max_altitude_m:g} m above the take-off point; "
        f"line lost for {safety.line_lost_s:g} s: {safety.reactions.line_lost}; "
        f"Ctrl-C: hold, then {safety.reactions.interrupted.replace('_', ' ')}"
    )
    for check in checks:
        say(Text.assemble((f"{check.result:<8}", _STYLES[check.result]), check.line))


def _task_table(plan: MissionPlan) -> Table:
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("", justify="right", style="dim")
    table.add_column("task", style="bold")
    table.add_column("what it does", max_width=60)
    table.add_column("about", justify="right")
    table.add_column("height", justify="right")
    line_m = plan.safety.line_height_m
    if line_m is not None:
        table.add_column("over line", justify="right")
    for number, (estimate, leg) in enumerate(zip(estimate_mission(plan), reckon(plan), strict=True), start=1):
        cells = [str(number), estimate.task, estimate.sentence, f"{estimate.duration_s:.0f} s"]
        cells.append(f"{estimate.altitude_m:g} m")
        if line_m is not None:
            cells.append(f"{leg.lowest_m - line_m:.1f} m" if leg.may_be_over_line else "")
        table.add_row(*cells)
    return table


def _camera_words(camera: CameraPlan) -> str:
    lens = f"{camera.hfov_deg:g}° wide" if camera.calibration is None else f"of {camera.calibration}"
    return (
        f"camera {camera.source}, {camera.width_px} x {camera.height_px} px at {camera.rate_hz:g} Hz, lens {lens}; "
        "a dry-run simulates it"
    )
