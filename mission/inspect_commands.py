"""`lineflight inspect`, `compare` and `replay`: what happened on a flight, and what would happen today."""

import json
import sys
from pathlib import Path
from typing import Annotated

import typer

from mission.ending import EXIT_BAD_INPUT, EXIT_DIFFERENT, EXIT_FAILED_FILE, fail, print_report, tell_flaws
from mission.fly_commands import JsonOption
from mission.log.errors import LogError

LogArgument = Annotated[Path, typer.Argument(help="A flight log (.mcap).")]


def inspect(
    log: LogArgument,
    html: Annotated[
        Path | None, typer.Option("--html", help="Write one page that holds everything, to open without a network.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Say what happened in a flight, and whose fault it was."""
    from mission.log.inspection import inspect_flight
    from mission.log.reader import read_flight

    try:
        flight = read_flight(log)
        report = inspect_flight(flight)
        if html is not None:
            from mission.flight_page import ground_of
            from mission.log.page.page import flight_page

            text = flight_page(flight, report, ground_of(flight))
    except LogError as error:
        fail(str(error), EXIT_BAD_INPUT)
    print_report(report, as_json=as_json)
    if html is not None:
        _write(html, text)


def compare(
    logs: Annotated[list[Path], typer.Argument(metavar="LOG LOG...", help="Flight logs (.mcap), two at least.")],
    html: Annotated[Path | None, typer.Option("--html", help="Write one page, to open without a network.")] = None,
    fail_if: Annotated[
        list[str] | None,
        typer.Option(help="End with exit code 6 where this holds: lateral_p95_m>0.5, or change:latency_p95_ms>20."),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Hold flights against the first one, figure by figure and task by task.

    A condition is on the last flight's figure, or with change: on how it differs from the first one's.
    """
    from rich.console import Console

    from mission.compare.circumstances import circumstances_of
    from mission.compare.comparison import compare_reports, distinct_names
    from mission.compare.conditions import ConditionError, parse_condition
    from mission.compare.report import print_comparison
    from mission.log.inspection import inspect_flight
    from mission.log.reader import read_flight

    if len(logs) < 2:
        fail("compare needs two logs at least; name another one.", EXIT_BAD_INPUT)
    try:
        flights = [read_flight(log) for log in logs]
        reports = [inspect_flight(flight) for flight in flights]
        comparison = compare_reports(distinct_names(logs), reports, circumstances_of(flights))
        conditions = [parse_condition(text, comparison.figure_names) for text in fail_if or ()]
    except (LogError, ConditionError) as error:
        fail(str(error), EXIT_BAD_INPUT)
    for log, flight in zip(logs, flights, strict=True):
        tell_flaws(log, flight.flaws)
    found = [condition.failure(comparison.figures[0], comparison.figures[-1]) for condition in conditions]
    failures = [words for words in found if words is not None]
    if as_json:
        typer.echo(json.dumps(comparison.to_json() | {"failures": failures}))
    else:
        print_comparison(comparison, Console())
    if html is not None:
        from mission.compare.page import comparison_page

        _write(html, comparison_page(comparison, flights))
    if failures:
        fail("\n".join(failures), EXIT_DIFFERENT)


def replay(
    log: LogArgument,
    write: Annotated[
        Path | None, typer.Option("--write", help="Write a copy of the log that holds this replay as its reference.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Run today's vision and guidance on a log's frames and states, and say where they differ.

    A log that holds a reference is held against that, and the exit code is 6 where it differs beyond the tolerance.
    """
    from rich.console import Console
    from rich.progress import Progress, SpinnerColumn, TextColumn

    from mission.log.copying import CopyError
    from mission.log.reader import read_flight
    from mission.replay.differences import Tolerance
    from mission.replay.replay import differences, write_reference
    from mission.replay.replay import replay as fly_again
    from mission.replay.report import print_differences

    shown = Progress(
        SpinnerColumn(),
        TextColumn("frame {task.completed} of {task.total}"),
        console=Console(stderr=True),
        transient=True,
        disable=not sys.stderr.isatty(),
    )
    if write is not None and write.exists():
        fail(f"{write} exists already; name another file, or remove it.", EXIT_BAD_INPUT)
    try:
        flight = read_flight(log)
        tell_flaws(log, flight.flaws)
        with shown as progress:
            frames = progress.add_task("", total=len(flight.image_times_ns))
            replayed = fly_again(flight, lambda: progress.advance(frames))
        found = differences(flight, replayed)
        if write is not None:
            write_reference(flight, replayed, write, lambda _: None)
    except LogError as error:
        fail(str(error), EXIT_BAD_INPUT)
    except CopyError as error:
        fail(str(error), EXIT_FAILED_FILE)
    tolerance = Tolerance()
    beyond = found.beyond(tolerance) if found.is_reference else ()
    if as_json:
        typer.echo(json.dumps(found.to_json() | {"beyond": list(beyond)}))
    else:
        print_differences(found, beyond, tolerance, Console(), is_damaged=flight.damage is not None)
    if write is not None:
        sys.stderr.write(f"reference  {write} ({write.stat().st_size / 1e6:.1f} MB)\n")
    if beyond:
        raise typer.Exit(EXIT_DIFFERENT)


def _write(path: Path, text: str) -> None:
    """Write a page, or end with why it cannot be written."""
    from mission.flight_page import PageError, write_text

    try:
        write_text(path, text)
    except PageError as error:
        fail(str(error), EXIT_BAD_INPUT if path.suffix.lower() not in (".html", ".htm") else EXIT_FAILED_FILE)
    sys.stderr.write(f"page     {path} ({len(text.encode()) / 1e6:.1f} MB)\n")
