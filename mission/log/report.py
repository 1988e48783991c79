"""Print a flight's report for a person: what went wrong first, then the tasks, then how well the line was followed."""

from collections.abc import Iterator

from rich.console import Console
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from mission.log.damage import CUT_OFF
from mission.log.flight_report import EventSummary, ExcursionSummary, FlightReport, TaskSummary
from mission.log.paper import Part, put, table
from mission.log.task_spans import UNFINISHED
from mission.log.wording import counted, duration, with_unit, words_of
from mission.records import Result, Severity

_RESULT_STYLE = {Result.COMPLETED: "green", Result.FAILED: "bold red"}
_SEVERITY_STYLE = {Severity.INFO: "dim", Severity.WARNING: "yellow", Severity.ERROR: "bold red"}


def print_report(report: FlightReport, console: Console) -> None:
    """Print a report on `console`: in a terminal at most 100 columns wide, elsewhere as wide as it needs."""
    put(_parts(report), console)


def _parts(report: FlightReport) -> Iterator[Part]:
    yield Text()
    yield Text.assemble(
        (report.mission, "bold"),
        "  ",
        (report.headline, _result_style(report.result)),
        f"  {duration(report.duration_s)}",
        (f", counted from {report.times_since}", "dim"),
        overflow="fold",
    )
    yield Text(report.reason, style="dim")
    for style, lines in (("bold red", report.preflight.failures), ("yellow", report.preflight.warnings)):
        for line in lines:
            yield Text.assemble(("pre-flight  ", "dim"), (line, style))
    if report.is_truncated:
        yield Text(CUT_OFF, style="yellow")
    if report.damage is not None:
        yield Text(report.damage, style="yellow")
    yield Text()
    is_troubled = any(event.severity != Severity.INFO for event in report.events)
    yield from _excursions(report.excursions)
    if is_troubled:
        yield _event_table(report.events)
    if report.tasks:
        yield _task_table(report.tasks)
    yield _figures(report)
    if report.events and not is_troubled:
        yield _event_table(report.events)


def _result_style(result: str) -> str:
    return _RESULT_STYLE.get(Result(result), "yellow") if result != UNFINISHED else "red"


def _event_table(events: tuple[EventSummary, ...]) -> Table:
    found = table("Events")
    found.add_column("at", justify="right", no_wrap=True)
    found.add_column("event")
    found.add_column("what happened", ratio=1)
    found.add_column("reaction")
    for event in events:
        name = Text(words_of(event.name), style=_SEVERITY_STYLE[Severity(event.severity)])
        reaction = Text("" if event.reaction == "continue" else words_of(event.reaction))
        found.add_row(f"{event.t_s:.1f} s", name, Text(event.message), reaction)
    return found


def _excursions(excursions: tuple[ExcursionSummary, ...]) -> Iterator[Part]:
    if not excursions:
        return
    yield Text("What went wrong", style="bold")
    for one in excursions:
        yield Text.assemble(
            ("  " + words_of(one.kind), "yellow"),
            f" {with_unit(one.peak, one.unit)}, {one.start_s:.1f} s to {one.end_s:.1f} s: ",
            (f"{one.culprit}, {one.fault}", "bold"),
        )
        for line in one.evidence:
            yield Padding(Text(line, style="dim"), (0, 0, 0, 4), expand=False)
    yield Text()


def _task_table(tasks: tuple[TaskSummary, ...]) -> Table:
    found = table("Tasks")
    found.add_column("task", no_wrap=True)
    found.add_column("from", justify="right", no_wrap=True)
    found.add_column("took", justify="right", no_wrap=True)
    found.add_column("result", no_wrap=True)
    found.add_column("why", ratio=1)
    for task in tasks:
        took = "" if task.end_s is None else f"{task.end_s - task.start_s:.1f} s"
        result = Text(words_of(task.result), style=_result_style(task.result))
        found.add_row(Text(words_of(task.task)), f"{task.start_s:.1f} s", took, result, Text(task.reason, style="dim"))
    return found


def _figures(report: FlightReport) -> Table:
    found = table("Figures", has_head=False)
    found.add_column(no_wrap=True, style="dim")
    found.add_column(ratio=1)
    for number, leg in enumerate(report.legs, start=1):
        words = (
            f"{leg.avg_error_m:.3f} m mean, {leg.p95_error_m:.3f} m p95, from the straight line that fits "
            f"its own {counted(leg.n_points, 'position')} best"
        )
        found.add_row(f"leg {number}, how straight", words)
    if report.lateral is not None:
        lateral = report.lateral
        words = f"{lateral.mean_m:.2f} m mean, {lateral.p95_m:.2f} m p95, {lateral.max_m:.2f} m at most"
        found.add_row("off the true line", f"{words}, sideways from where the line really is")
    if report.yaw_error is not None:
        yaw = report.yaw_error
        found.add_row("true heading error", f"{yaw.median_deg:.1f}° median, {yaw.p95_deg:.1f}° p95")
    vision = report.vision
    words = f"a line in {vision.estimates} of {counted(vision.frames, 'frame')}, "
    words += f"{vision.doubtful} {'was' if vision.doubtful == 1 else 'were'} doubtful"
    words += "".join(f", {count} {words_of(name)}" for name, count in vision.troubles.items())
    found.add_row("vision", words if vision.frames else "no frames")
    if vision.latency_ms is not None:
        latency = vision.latency_ms
        words = f"{latency.p50:.0f} ms median, {latency.p95:.0f} ms p95, {latency.p99:.0f} ms p99"
        found.add_row("vision latency", words)
    if report.setpoints.rate_hz is not None:
        rate = f"{report.setpoints.rate_hz:.1f} Hz, longest gap {report.setpoints.max_gap_ms:.0f} ms"
        found.add_row("setpoints while offboard", rate)
    if report.landing is not None:
        motors = "disarmed" if report.landing.is_disarmed else "still armed"
        if report.is_truncated:
            motors = "where the log ends"
        found.add_row("at the end", f"{report.landing.distance_m:.2f} m from the start, {motors}")
    return found
