"""How a command ends: what it prints last, and the exit code.

Exit codes: 0 done · 1 a log or the output could not be written, or some of the images not read · 2 bad input (a
mission, world, camera, log or option that cannot be used), nothing was connected · 3 not ready, the vehicle was never
armed · 4 the mission ended early · 5 the pilot, or the autopilot's failsafe, has the vehicle · 6 what was compared
differs by more than is allowed · 70 a fault of lineflight's own · 130 stopped by the operator.
"""

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

import typer

from mission.log.errors import LogError

if TYPE_CHECKING:
    from mission.flight import FlightOutcome
    from mission.log.damage import Flaws
    from mission.log.flight_report import FlightReport
    from mission.plan_file import MissionFile
    from mission.simulated.aftermath import Aftermath
    from mission.simulated.simulation import World

EXIT_FAILED_FILE = 1
EXIT_BAD_INPUT = 2
EXIT_NOT_READY = 3
EXIT_ENDED_EARLY = 4
EXIT_TAKEN_OVER = 5
EXIT_DIFFERENT = 6
EXIT_FAULT = 70
EXIT_INTERRUPTED = 130


def fail(message: str, code: int) -> NoReturn:
    """Say in a sentence what is wrong, and end."""
    sys.stderr.write(message.rstrip() + "\n")
    raise typer.Exit(code)


def refuse(message: str) -> NoReturn:
    """Say in a sentence which input cannot be used, and end."""
    fail(message, EXIT_BAD_INPUT)


def read_mission(path: Path) -> "MissionFile":
    """Read a mission file, or end with what is wrong in it."""
    from mission.plan_file import MissionFileError, read_mission

    try:
        return read_mission(path)
    except MissionFileError as error:
        fail("\n".join(error.lines()), EXIT_BAD_INPUT)


def tell_flaws(log: Path, flaws: "Flaws") -> None:
    """Say what a log lacks, if anything: it was cut off, or some of it is damaged."""
    for line in flaws.lines:
        sys.stderr.write(f"{log}: {line}\n")


def read_report(log: Path) -> "FlightReport":
    """Work out the report of a flight log; raises LogError."""
    from mission.log.inspection import inspect_flight
    from mission.log.reader import read_flight

    return inspect_flight(read_flight(log))


def print_report(report: "FlightReport", *, as_json: bool) -> None:
    """Print a report, for people or programs."""
    from mission.log.flight_report import to_json

    if as_json:
        typer.echo(json.dumps(to_json(report)))
        return
    from rich.console import Console

    from mission.log.report import print_report

    print_report(report, Console())


def finish(outcome: "FlightOutcome", *, as_json: bool, aftermath: "Aftermath | None" = None) -> NoReturn:
    """Print the report, draw the picture, and exit with the code that tells how the flight ended.

    `aftermath` is a simulated flight's. One that touched something has not gone well, whatever the mission thinks.

    What cannot be read or drawn afterwards is said, and changes nothing about how the flight ended.
    """
    if outcome.log_failure is not None:
        sys.stderr.write(outcome.log_failure + "\n")
    try:
        report = read_report(outcome.log)
    except LogError as error:
        sys.stderr.write(f"{error}\nThe mission {outcome.ended.result}: {outcome.ended.reason}.\n")
        raise typer.Exit(_exit_code(outcome)) from None
    picture = _draw(outcome.log, None if aftermath is None else aftermath.world) if report.tasks else None
    page = _write_page(outcome.log, report) if report.tasks and aftermath is not None else None
    contact = None if aftermath is None else aftermath.contact
    if as_json:
        from mission.log.flight_report import to_json

        extra = {"log": str(outcome.log), "picture": _text(picture), "page": _text(page)}
        typer.echo(json.dumps(to_json(report) | extra | ({} if aftermath is None else aftermath.to_json())))
    else:
        print_report(report, as_json=False)
        if aftermath is not None and aftermath.clearances is not None:
            typer.echo(f"nearest  {aftermath.clearances}")
        typer.echo(f"log      {outcome.log}")
        if picture is not None:
            typer.echo(f"picture  {picture}")
        if page is not None:
            typer.echo(f"page     {page}")
        if aftermath is not None and aftermath.speed is not None:
            typer.echo(f"speed    {aftermath.speed:.2f} times real time")
    if contact is not None:
        sys.stderr.write(contact + "\n")
        raise typer.Exit(EXIT_ENDED_EARLY)
    raise typer.Exit(_exit_code(outcome))


def _text(path: Path | None) -> str | None:
    return None if path is None else str(path)


def _write_page(log: Path, report: "FlightReport") -> Path | None:
    """The flight's page, beside the log of a simulated flight; None, with a word, when there can be none."""
    from mission.flight_page import PageError, write_page

    try:
        return write_page(log, log.with_suffix(".html"), report)
    except PageError as error:
        sys.stderr.write(f"{error}\n")
        return None


def _exit_code(outcome: "FlightOutcome") -> int:
    from mission.records import Result

    result = outcome.ended.result
    if result is Result.FAILED and not outcome.may_have_armed:
        return EXIT_NOT_READY
    return {Result.COMPLETED: 0, Result.INTERRUPTED: EXIT_INTERRUPTED, Result.TAKEN_OVER: EXIT_TAKEN_OVER}.get(
        result, EXIT_ENDED_EARLY
    )


def _draw(log: Path, world: "World | None") -> Path | None:
    """The flight's picture, beside the log; None, with a word, when there can be none."""
    from mission.flight_picture import PictureError, write_picture

    try:
        return write_picture(log, world)
    except PictureError as error:
        sys.stderr.write(f"{error}\n")
        return None
