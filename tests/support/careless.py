"""A mission that lands through the power line, and what its log must say of it."""

from pathlib import Path

from mission.log.reader import read_flight
from mission.records import Severity
from tests.support.command_line import lineflight
from tests.support.short_mission import short_mission

# Without the line's height nobody knows that it lands there.
MISSION = short_mission("camera: {rate_hz: 15}", end="land")


def write_careless_mission(folder: Path) -> Path:
    """Write the mission into a folder."""
    path = folder / "careless.yaml"
    path.write_text(MISSION)
    return path


def check_contact_in_log(log: Path, sentence: str) -> None:
    """The log names the contact once, when the vehicle was there and not when the flight was over; inspect says so."""
    flight = read_flight(log)
    (contact,) = [event for event in flight.events if event.name == "contact"]
    assert (contact.message, contact.severity) == (sentence, Severity.ERROR)
    assert "touched a conductor" in sentence
    there = min(flight.truth, key=lambda pose: abs(pose.t_ns - contact.t_ns))
    assert flight.mission_ended is not None
    assert contact.t_ns < flight.mission_ended.t_ns
    assert there.down_m < -5.0  # on the wire, not on the ground
    inspected = lineflight("inspect", log, "--json")
    assert sentence in [event["message"] for event in inspected.json["events"]]
