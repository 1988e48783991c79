"""Rendered flights in virtual time: they come home, touch nothing, and are the same to the bit every time."""

from pathlib import Path

import pytest

from mission.log.reader import Flight, read_flight
from mission.log.summary import summarise
from mission.plan_file import read_mission
from mission.records import Result
from mission.simulated.aftermath import Aftermath
from mission.simulated.scenario import Scenario
from mission.simulated.virtual_flight import fly_virtually
from tests.support.careless import check_contact_in_log, write_careless_mission
from tests.support.command_line import lineflight
from tests.support.short_mission import short_mission

SHORT_MISSION = short_mission("camera: {rate_hz: 15}\nsafety: {line_height_m: 10.3}")


def fly(folder: Path, scenario: Scenario) -> tuple[Flight, Aftermath, Result]:
    folder.mkdir()
    mission = folder / "short.yaml"
    mission.write_text(SHORT_MISSION)
    outcome, aftermath = fly_virtually(read_mission(mission), scenario, folder, lambda _: None, lambda _: None)
    return read_flight(outcome.log), aftermath, outcome.ended.result


def test_the_same_scenario_is_the_same_flight_to_the_bit(tmp_path: Path) -> None:
    scenario = Scenario(seed=3, wind_m_s=4.0)
    first, aftermath, result = fly(tmp_path / "one", scenario)
    again, _, _ = fly(tmp_path / "two", scenario)
    assert first.truth == again.truth
    assert first.setpoints == again.setpoints
    assert first.states == again.states
    assert [report.estimate for report in first.reports] == [report.estimate for report in again.reports]
    assert result is Result.COMPLETED
    assert aftermath.contact is None
    lateral = summarise(first).lateral
    assert lateral is not None
    assert lateral.mean_m < 0.3
    assert aftermath.testimony is not None
    assert aftermath.testimony.conductor is not None


def test_a_vehicle_that_lands_through_the_line_touches_it_and_says_so(tmp_path: Path) -> None:
    mission = write_careless_mission(tmp_path)
    ran = lineflight("dry-run", mission, "--virtual-time", "--seed", "1", "--log", tmp_path, "--json")
    assert ran.code == 4, ran.err
    assert "touched a conductor" in ran.err
    assert "touched a conductor" in ran.json["contact"]
    assert ran.json["clearance_m"]["conductor"] < 0.5
    assert "Traceback" not in ran.err
    check_contact_in_log(Path(ran.json["log"]), ran.json["contact"])


@pytest.mark.parametrize(
    ("option", "value", "words"),
    [("--world", "atlantis", "There is no world 'atlantis'"), ("--airframe", "dove", "dove"), ("--light", "x", "x")],
)
def test_what_there_is_not_is_said(tmp_path: Path, option: str, value: str, words: str) -> None:
    mission = tmp_path / "short.yaml"
    mission.write_text(SHORT_MISSION)
    ran = lineflight("dry-run", mission, "--virtual-time", option, value, "--log", tmp_path)
    assert ran.code == 2
    assert words in ran.err
    assert "Traceback" not in ran.err
