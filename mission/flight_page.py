"""The page of a flight, written to a file."""

import contextlib
from pathlib import Path

from mission.log.errors import LogError
from mission.log.flight_report import FlightReport
from mission.log.page.page import Ground, flight_page
from mission.log.reader import Flight, read_flight


class PageError(Exception):
    """The page of a flight could not be made; the message is one sentence."""


def write_page(log: Path, file: Path, report: FlightReport) -> Path:
    """Write the page of a flight whose report is known. Raises PageError."""
    try:
        flight = read_flight(log)
        write_text(file, flight_page(flight, report, ground_of(flight)))
    except LogError as error:
        raise PageError(f"The page {file} cannot be made: {error}") from error
    return file


def write_text(file: Path, text: str) -> None:
    """Write a page's text, in place of an older page. Raises PageError; what stood there then stays."""
    if file.suffix.lower() not in (".html", ".htm"):
        raise PageError(f"A page's name ends in .html: {file} does not.")
    part = file.with_name(file.name + ".part")
    try:
        part.write_text(text, encoding="utf-8")
        part.replace(file)
    except OSError as error:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)
        words = f"The page {file} cannot be written ({error.strerror}); name a file in a folder that can be written."
        raise PageError(words) from error


def ground_of(flight: Flight) -> Ground | None:
    """The simulated world's ground under a flight; None where it was flown elsewhere, or that world is not here."""
    world_name = flight.mission.metadata.get("world")
    if world_name is None:
        return None
    from mission.simulated.page_ground import page_ground

    return page_ground(flight, world_name, flight.mission.metadata.get("light"))
