"""Print a flight's report for a person: what went wrong first, then the tasks, then how well the line was followed."""

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from mission.log.summary import UNFINISHED, EventSummary, ExcursionSummary, FlightReport, TaskSummary
from mission.log.wording import words_of
from mission.records import Result, Severity

_RESULT_STYLE = {Result.COMPLETED: "green", Result.FAILED: "bold red"}
_SEVERITY_STYLE = {Severity.INFO: "dim", Severity.WARNING: "yellow", Severity.ERROR: "bold red"}


def print_report(report: FlightReport, console: Console) -> None:
    """Print a report on `console`, at most 100 columns wide."""
    width = min(console.width, 100)
    heading = Text.assemble(
        (report.mission, "bold"), "  ", _result(report.result), f"  {_duration(report.duration_s)}", overflow="fold"
    )
    console.print()
    console.print(heading, width=width)
    console.print(Text(report.reason, style="dim"), width=width)
    for style, lines in (("bold red", report.preflight.failures), ("yellow", report.preflight.warnings)):
        for line in lines:
            console.print(Text.assemble(("pre-flight  ", "dim"), (line, style)), width=width)
    if report.is_truncated:
        console.print(Text("The log was cut off; this is what it still holds.", style="yellow"), width=width)
    if report.damage is not None:
        console.print(Text(report.damage, style="yellow"), width=width)
    is_troubled = any(event.severity != Severity.INFO for event in report.events)
    if report.excursions:
        _print_excursions(report.excursions, console, width)
    if is_troubled:
        _print_events(report.events, console, width)
    if report.tasks:
        console.print(_task_table(report.tasks, width))
    console.print(_figures(report, width))
    if report.events and not is_troubled:
        _print_events(report.events, console, width)
    console.print()


def _result(result: str) -> Text:
    return Text(words_of(result), style=_RESULT_STYLE.get(Result(result), "yellow") if result != UNFINISHED else "red")


def _print_events(events: tuple[EventSummary, ...], console: Console, width: int) -> None:
    table = Table(title="Events", title_justify="left", title_style="bold", box=SIMPLE_HEAD, width=width)
    table.add_column("at", justify="right", no_wrap=True)
    table.add_column("event")
    table.add_column("what happened", ratio=1)
    table.add_column("reaction")
    for event in events:
        name = Text(words_of(event.name), style=_SEVERITY_STYLE[Severity(event.severity)])
        table.add_row(f"{event.t_s:.1f} s", name, Text(event.message), Text(words_of(event.reaction)))
    console.print(table)


def _print_excursions(excursions: tuple[ExcursionSummary, ...], console: Console, width: int) -> None:
    console.print()
    console.print(Text("What went wrong", style="bold"), width=width)
    for one in excursions:
        words = Text.assemble(
            ("  " + words_of(one.kind), "yellow"),
            f" {one.peak:.2f} {one.unit}, {one.start_s:.1f} s to {one.end_s:.1f} s: ",
            (f"{one.culprit}, {one.fault}", "bold"),
        )
        console.print(words, width=width)
        for line in one.evidence:
            console.print(Padding(Text(line, style="dim"), (0, 0, 0, 4)), width=width)


def _task_table(tasks: tuple[TaskSummary, ...], width: int) -> Table:
    table = Table(title="Tasks", title_justify="left", title_style="bold", box=SIMPLE_HEAD, width=width)
    table.add_column("task", no_wrap=True)
    table.add_column("from", justify="right", no_wrap=True)
    table.add_column("took", justify="right", no_wrap=True)
    table.add_column("result", no_wrap=True)
    table.add_column("why", ratio=1)
    for task in tasks:
        took = "" if task.end_s is None else f"{task.end_s - task.start_s:.1f} s"
        why = Text(task.reason, style="dim")
        table.add_row(Text(words_of(task.task)), f"{task.start_s:.1f} s", took, _result(task.result), why)
    return table


def _figures(report: FlightReport, width: int) -> Table:
    table = Table(title="Figures", title_justify="left", title_style="bold", box=None, show_header=False, width=width)
    table.add_column(no_wrap=True, style="dim")
    table.add_column(ratio=1)
    for number, leg in enumerate(report.legs, start=1):
        table.add_row(
            f"  leg {number}, straightness",
            f"{leg.avg_error_m:.3f} m mean, {leg.p95_error_m:.3f} m p95  ({leg.n_points} positions)",
        )
    if report.lateral is not None:
        lateral = report.lateral
        words = f"{lateral.mean_m:.2f} m mean, {lateral.p95_m:.2f} m p95, {lateral.max_m:.2f} m at most"
        table.add_row("  true distance from the line", words)
    if report.yaw_error is not None:
        yaw = report.yaw_error
        table.add_row("  true heading error", f"{yaw.median_deg:.1f}° median, {yaw.p95_deg:.1f}° p95")
    vision = report.vision
    words = f"a line in {vision.estimates} of {vision.frames} frames, {vision.doubtful} were doubtful"
    words += "".join(f", {count} {name}" for name, count in vision.troubles.items())
    table.add_row("  vision", words)
    if vision.latency_ms is not None:
        latency = vision.latency_ms
        words = f"{latency.p50:.0f} ms median, {latency.p95:.0f} ms p95, {latency.p99:.0f} ms p99"
        table.add_row("  vision latency", words)
    if report.setpoints.rate_hz is not None:
        rate = f"{report.setpoints.rate_hz:.1f} Hz, longest gap {report.setpoints.max_gap_ms:.0f} ms"
        table.add_row("  setpoints while offboard", rate)
    if report.landing is not None:
        motors = "disarmed" if report.landing.is_disarmed else "still armed"
        if report.is_truncated:
            motors = "where the log ends"
        table.add_row("  at the end", f"{report.landing.distance_m:.2f} m from the start, {motors}")
    return table


def _duration(duration_s: float) -> str:
    minutes, seconds = divmod(round(duration_s), 60)
    return f"{minutes} min {seconds:02d} s" if minutes else f"{seconds} s"
