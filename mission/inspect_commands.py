"""`lineflight inspect`: what happened on a flight."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mission.ending import EXIT_BAD_INPUT, EXIT_FAILED_FILE, fail, print_report
from mission.fly_commands import JsonOption
from mission.log.errors import LogError

if TYPE_CHECKING:
    from mission.log.page.page import Ground
    from mission.log.reader import Flight

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
            from mission.log.page.page import flight_page

            text = flight_page(flight, report, _ground(flight))
    except LogError as error:
        fail(str(error), EXIT_BAD_INPUT)
    print_report(report, as_json=as_json)
    if html is not None:
        write_page(html, text)


def write_page(path: Path, text: str) -> None:
    """Write a page, or end with why it cannot be written."""
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        fail(
            f"The page {path} cannot be written ({error.strerror}); name a file in a folder that there is.",
            EXIT_FAILED_FILE,
        )
    sys.stderr.write(f"page     {path} ({len(text.encode()) / 1e6:.1f} MB)\n")


def _ground(flight: "Flight") -> "Ground | None":
    """The simulated world's ground under a flight; None where it was flown elsewhere, or that world is not here."""
    world_name = flight.mission.metadata.get("world")
    if world_name is None:
        return None
    from mission.simulated.page_ground import page_ground

    return page_ground(flight, world_name, flight.mission.metadata.get("light"))
