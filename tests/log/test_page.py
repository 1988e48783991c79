"""The page's data, without a browser: what is thinned keeps its peaks, what is told fits into the budget."""

import html
import json
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mission.log.imported import (
    Imported,
    ImportedActuators,
    ImportedLog,
    ImportedMode,
    ImportedPower,
    ImportedState,
    ImportedText,
)
from mission.log.inspection import inspect_flight
from mission.log.page import frames as page_frames_module
from mission.log.page.data import page_data
from mission.log.page.frames import page_frames
from mission.log.page.page import flight_page
from mission.log.page.thinning import evenly, extremes
from mission.log.reader import Flight, read_flight
from mission.log.task_spans import flight_start_ns
from tests.log.synthetic_flight import LINE_NORTH_M, START_NS, fly, write_log


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Flight:
    path = tmp_path_factory.mktemp("logs") / "flight.mcap"
    assert write_log(path, list(fly(image_period_s=2.5))).failure is None
    return read_flight(path)


@given(st.lists(st.floats(-100, 100) | st.just(math.nan), min_size=1, max_size=400), st.integers(2, 60))
def test_thinning_keeps_the_extremes(values: list[float], most: int) -> None:
    array = np.array(values)
    kept = extremes(array, most)
    assert len(kept) <= max(1.5 * most, len(values) if len(values) <= most else 0)
    assert np.isnan(array[kept]).any() == np.isnan(array).any()
    assert (np.diff(kept) > 0).all()
    if not np.isnan(array).all():
        assert np.nanmax(array[kept]) == np.nanmax(array)
        assert np.nanmin(array[kept]) == np.nanmin(array)


@given(st.integers(0, 1000), st.integers(2, 100))
def test_even_thinning_keeps_both_ends(n: int, most: int) -> None:
    kept = evenly(n, most)
    assert len(kept) == min(n, most)
    if n:
        assert (kept[0], kept[-1]) == (0, n - 1)


def test_the_page_tells_what_was_flown(flight: Flight) -> None:
    data = page_data(flight, inspect_flight(flight))
    assert json.loads(json.dumps(data, allow_nan=False)) is not None
    assert data["name"] == "follow_line"
    assert len(data["report"]["tasks"]) == 11
    curves = data["curves"]
    assert max(value for value in curves["height"]["y"] if value is not None) == pytest.approx(16.0, abs=0.01)
    off_m = [value for value in curves["off_line"]["y"] if value is not None]
    assert max(map(abs, off_m)) == pytest.approx(0.3, abs=0.02)  # as it sways
    assert {"angle_deg", "offset_px", "latency_ms", "battery", "round_trip_ms", "tick_late_ms"} <= curves.keys()
    assert set(data["fixes"]["north"]) == {LINE_NORTH_M}
    assert data["histograms"]["link, there and back"]["p50"] == 4.0
    over_m = [value for value in curves["height_over_line"]["y"] if value is not None]
    assert max(over_m) == pytest.approx(7.0, abs=0.05)  # the conductors hang 9 m up


def test_a_page_says_with_units_what_was_flown_with(flight: Flight) -> None:
    host = {"n_cores": 1, "memory_bytes": 8_000_000_000, "architecture": "aarch64", "computer": "a board"}
    told = replace(
        flight,
        mission=replace(flight.mission, metadata={"wind_m_s": "8", "wind_from_deg": "90", "speed": "2"}),
        attachments={"host.json": json.dumps(host).encode(), "versions.json": b"no JSON"},
    )
    facts = page_data(told, inspect_flight(told))["facts"]
    assert (facts["wind"], facts["wind from"], facts["speed"]) == ("8 m/s", "90°", "2 times real time")
    assert (facts["processor"], facts["memory"], facts["computer"]) == ("aarch64, 1 core", "8.0 GB", "a board")


def test_what_is_never_late_has_no_distribution(flight: Flight) -> None:
    punctual = replace(flight, ticks=tuple(replace(tick, late_s=0.0) for tick in flight.ticks))
    report = inspect_flight(flight)
    assert "control tick late by" in page_data(flight, report)["histograms"]
    assert "control tick late by" not in page_data(punctual, report)["histograms"]


def test_frames_fit_into_the_budget_and_cover_the_flight(flight: Flight, monkeypatch: pytest.MonkeyPatch) -> None:
    start_ns = flight_start_ns(flight)
    whole = page_frames(flight, start_ns)
    assert len(whole) == len(flight.image_times_ns) > 30
    monkeypatch.setattr(page_frames_module, "BUDGET_BYTES", 100_000)
    small = page_frames(flight, start_ns)
    n_bytes = sum(len(frame["jpeg"]) * 3 / 4 for frame in small)
    assert n_bytes < 115_000
    assert len(small) > 3
    assert small[0]["t"] == whole[0]["t"]
    assert small[-1]["t"] == whole[-1]["t"]


def test_a_page_can_be_made_of_a_flight_without_anything(flight: Flight) -> None:
    """A log that was cut off before take-off still makes a page."""
    bare = replace(
        flight,
        states=(),
        setpoints=(),
        reports=(),
        fixes=(),
        tasks_started=(),
        tasks_ended=(),
        truth=(),
        line=None,
        ticks=(),
        syncs=(),
        image_times_ns=frozenset(),
        mission_ended=None,
    )
    page = flight_page(bare, inspect_flight(bare))
    assert "follow_line" in page


def test_what_a_mission_says_cannot_break_out_of_the_page(flight: Flight) -> None:
    evil = "</script><script>alert(1)</script><!-- %%SCRIPT%% %%PLOTLY%%"
    named = replace(flight, mission=replace(flight.mission, name=evil, text=evil))
    page = flight_page(named, inspect_flight(named))
    assert "</script><script>alert(1)" not in page
    found = re.search(r'<script id="flight" type="application/json">(.*?)</script>', page, re.DOTALL)
    assert found is not None
    assert json.loads(found.group(1))["mission_text"] == evil


@pytest.mark.parametrize(
    "evil", ["<!-- <script>", "<!--<SCRIPT ", "</ScRiPt >", "a\u2028b\u2029c", "]]><![CDATA[", "\\u003c"]
)
def test_whatever_a_mission_is_called_its_data_stay_one_block(flight: Flight, evil: str) -> None:
    """Between `<!--` and `<script` a browser does not end a script element where it should (HTML, 4.12.1.3)."""
    named = replace(flight, mission=replace(flight.mission, name=evil, text=evil))
    page = flight_page(named, inspect_flight(named))
    begin = page.index('<script id="flight" type="application/json">')
    data = page[page.index(">", begin) + 1 : page.index("</script>", begin)]
    assert "<" not in data
    assert data.isascii()
    assert (json.loads(data)["name"], json.loads(data)["mission_text"]) == (evil, evil)
    assert html.unescape(page[page.index("<title>") + 7 : page.index("</title>")]).startswith(evil)


def test_an_imported_log_stands_in_the_page(flight: Flight) -> None:
    log = ImportedLog(
        "a.ulg", "ulog", "v1.16", "", "00", 0.0, 0.0, 0.0, "motion", None, 0.99, 60.0, 0.1, 0.1, (0, 0, 0), False
    )
    own = Imported(
        log,
        tuple(ImportedState(s.t_ns, s.north_m, s.east_m, s.down_m - 1.0, 0, 0, 0, 0, 0, 0) for s in flight.states),
        (),
        tuple(ImportedActuators(START_NS + k * 10**8, (0.5, 0.25 + k / 1000)) for k in range(100)),
        (ImportedPower(START_NS, 16.1, None, None), ImportedPower(START_NS + 10**9, 15.9, 12.0, 0.9)),
        (ImportedText(START_NS + 10**9, "Takeoff detected"),),
        (ImportedMode(START_NS, "Offboard"),),
    )
    data = page_data(replace(flight, imported=own), inspect_flight(flight))
    assert max(v for v in data["curves"]["imported_height"]["y"] if v is not None) == pytest.approx(17.0, abs=0.01)
    assert data["curves"]["motor_2"]["y"][-1] == pytest.approx(0.349)
    assert data["curves"]["imported_voltage"]["y"] == [16.1, 15.9]
    assert (1.0, "Takeoff detected") in data["texts"]
    assert "aligned by motion" in data["facts"]["the autopilot's own log"]


def test_the_page_needs_no_other_file(flight: Flight, tmp_path: Path) -> None:
    page = flight_page(flight, inspect_flight(flight))
    markup = re.sub(r"<script.*?</script>|<style.*?</style>", "", page, flags=re.DOTALL)
    assert re.findall(r'(?:src|href)="(?!data:)', markup) == []
    assert "default-src 'none'" in markup
