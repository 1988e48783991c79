"""Logs to export, written once for the module that asks for them."""

from pathlib import Path

import pytest

from mission.log.reader import Flight
from tests.export.exported_flight import write_flight


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Flight:
    return write_flight(tmp_path_factory.mktemp("log") / "flight.mcap")


@pytest.fixture(scope="module")
def flight_without_origin(tmp_path_factory: pytest.TempPathFactory) -> Flight:
    return write_flight(tmp_path_factory.mktemp("log") / "nowhere.mcap", has_origin=False)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "out"
