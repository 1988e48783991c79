"""The pages about flights in a real browser: nothing is missing, nothing is asked of a network, the cursor moves.

Not collected with the others, since it needs Chromium: `make test-page` runs it. PAGE_SHOTS names a folder that keeps
screenshots.
"""

import itertools
import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from mission.autopilot import Setpoint
from mission.compare.circumstances import circumstances_of
from mission.compare.comparison import compare_reports
from mission.compare.page import comparison_page
from mission.live.feed import LiveFeed
from mission.live.settings import Briefing, LiveSettings
from mission.log.inspection import inspect_flight
from mission.log.page.page import flight_page
from mission.log.reader import Flight, read_flight
from mission.operator import Wish
from mission.plan_file import read_mission
from mission.records import CheckResult, PreflightCheck, Result
from mission.simulated.page_ground import page_ground
from mission.simulated.scenario import Scenario
from mission.simulated.virtual_flight import fly_virtually
from tests.live.clients import until
from tests.log import synthetic_flight
from tests.page_browser.browser import Browser
from tests.support.command_line import ROOT, lineflight
from vision.records import VisionReport

DESKTOP, PHONE = (1440, 1100), (390, 1100)


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A flight from take-off to landing, in wind."""
    mission = read_mission(ROOT / "missions" / "follow_line.yaml")
    scenario = Scenario(seed=2, wind_m_s=8.0)
    outcome, _ = fly_virtually(mission, scenario, tmp_path_factory.mktemp("logs"), lambda _: None, lambda _: None)
    return outcome.log


@pytest.fixture(scope="module")
def flight(log: Path) -> Flight:
    return read_flight(log)


@pytest.fixture(scope="module")
def page(flight: Flight, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("pages") / "flight.html"
    path.write_text(flight_page(flight, inspect_flight(flight), page_ground(flight, "medium_voltage", None)))
    return path


@pytest.fixture(params=[DESKTOP, PHONE], ids=["desktop", "phone"])
def browser(request: pytest.FixtureRequest) -> Iterator[Browser]:
    with Browser(*request.param) as browser:
        yield browser


def keep(browser: Browser, name: str) -> None:
    if "PAGE_SHOTS" in os.environ:
        browser.screenshot(Path(os.environ["PAGE_SHOTS"]) / f"{name}.png")


def draw_all(browser: Browser) -> None:
    """Scroll past every chart, since those out of sight are drawn when they come near."""
    browser.evaluate(
        """(async () => {
          for (let y = 0; y < document.body.scrollHeight; y += 400) {
            scrollTo(0, y);
            await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
          }
          scrollTo(0, 0);
        })()"""
    )
    browser.wait_for(
        "[...document.querySelectorAll('#charts .plot, #histograms .plot')].every((plot) => plot._fullLayout)"
    )


def test_the_page_is_whole_and_asks_nothing_of_a_network(browser: Browser, page: Path) -> None:
    browser.open(page)
    draw_all(browser)
    browser.evaluate("document.querySelector('[data-view=space]').click()")
    browser.wait_for("document.getElementById('space')._fullLayout !== undefined")
    keep(browser, f"space-{browser.evaluate('innerWidth')}")
    assert browser.page.errors == []
    asked = [url for url in browser.page.requests if not url.startswith(("data:", "blob:"))]
    assert asked == [page.resolve().as_uri()]
    assert browser.evaluate("document.documentElement.scrollWidth <= innerWidth"), "it is wider than the window"


def test_the_plots_have_their_traces(browser: Browser, page: Path, flight: Flight) -> None:
    browser.open(page)
    draw_all(browser)
    names = browser.evaluate("document.getElementById('map').data.map((trace) => trace.name)")
    tasks = [started.task.replace("_", " ") for started in flight.tasks_started]
    assert [name for name in names if name in tasks] == list(dict.fromkeys(tasks))
    assert {"conductor", "supports", "line as known", "setpoint", "true way"} <= set(names)
    curves = browser.evaluate("[...document.querySelectorAll('#charts .plot')].map((p) => p.data.map((t) => t.name))")
    assert [
        "off the line",
        "the line elsewhere than told",
        "setpoint off the line as told",
        "vehicle off its setpoint",
    ] in curves
    assert ["angle"] in curves
    assert ["offset"] in curves
    assert any({"setpoint", "vehicle", "over the conductors, true"} <= set(chart) for chart in curves)
    assert ["battery"] in curves
    points = browser.evaluate(
        "Math.min(...[...document.querySelectorAll('#charts .plot')]"
        ".flatMap((p) => p.data.map((t) => t.y.filter((v) => v !== null).length)))"
    )
    assert points > 10
    bars = browser.evaluate("document.querySelectorAll('#histograms .plot').length")
    assert bars == 2  # vision's latency, and the time between frames: nothing else takes time in virtual time
    assert browser.evaluate("document.querySelectorAll('#tasks .task:not(.stage-out)').length") == len(tasks)
    empty = (
        "[...document.querySelectorAll('.card, .grid')].filter((c) => c.offsetHeight && !c.textContent.trim()).length"
    )
    assert browser.evaluate(empty) == 0, "a section stands there empty"
    keep(browser, f"page-{browser.evaluate('innerWidth')}")


def test_the_legend_names_what_the_map_shows_and_hides_it(browser: Browser, page: Path, flight: Flight) -> None:
    browser.open(page)
    entries = browser.evaluate("[...document.querySelectorAll('#maplegend button')].map((b) => b.textContent)")
    marks = {"conductors of the line, true", "supports", "the line as known in flight", "setpoints", "camera frames"}
    tasks = {started.task.replace("_", " ") for started in flight.tasks_started}
    assert marks | {"take-off", "landing"} | tasks <= set(entries)
    assert len(entries) == len(set(entries))
    shown = "document.getElementById('map').data.find((trace) => trace.name === '{}').visible !== false"
    for name, button, before in (("supports", "supports", True), ("frames", "camera frames", False)):
        assert browser.evaluate(shown.format(name)) == before
        browser.evaluate(
            f"[...document.querySelectorAll('#maplegend button')].find((b) => b.textContent === '{button}').click()"
        )
        browser.wait_for(f"({shown.format(name)}) === {str(not before).lower()}")


def test_the_way_down_has_a_name_and_trouble_is_shown_first(browser: Browser, flight: Flight, tmp_path: Path) -> None:
    """The same flight, as if its second leg had timed out and what came after it were the way down."""
    legs = [k for k, started in enumerate(flight.tasks_started) if started.task == "follow_lines"]
    last = legs[-1]
    ended = replace(flight.tasks_ended[last], result=Result.TIMED_OUT, reason="the task took longer than 10 s")
    failed = replace(
        flight,
        tasks_started=flight.tasks_started[: last + 1],
        tasks_ended=(*flight.tasks_ended[:last], ended),
        mission_ended=replace(flight.mission_ended, result=Result.TIMED_OUT, reason="the task took longer than 10 s"),
    )
    path = tmp_path / "failed.html"
    path.write_text(flight_page(failed, replace(inspect_flight(failed), excursions=()), None))
    browser.open(path)
    assert browser.evaluate("document.getElementById('result').textContent") == "timed out in follow lines"
    assert browser.evaluate("document.querySelector('.stage-out').textContent") == "going down"
    end_s = (ended.t_ns - flight.tasks_started[0].t_ns) / 1e9
    assert browser.evaluate("lineflight.now") == pytest.approx(end_s, abs=0.01)
    browser.evaluate(f"lineflight.setTime({end_s + 5.0})")
    assert browser.evaluate("document.getElementById('now').textContent").startswith("task going down")
    assert browser.evaluate("document.getElementById('begun').textContent").endswith("times from take-off")
    keep(browser, f"failed-{browser.evaluate('innerWidth')}")


def test_the_slider_moves_everything(browser: Browser, page: Path, flight: Flight) -> None:
    browser.open(page)
    draw_all(browser)

    def slide_to(t_s: float) -> tuple[int, str, str, str, str, int]:
        browser.evaluate(
            f"(() => {{ const s = document.getElementById('slider'); s.value = {t_s}; "
            "s.dispatchEvent(new Event('input')); })()"
        )
        browser.wait_for("document.getElementById('frame').complete")
        frame, clock, arrow, cursor, source = browser.evaluate(
            "[lineflight.frame, document.getElementById('clock').textContent, "
            "document.getElementById('arrow').style.transform, document.querySelector('.cursor').style.left, "
            "document.getElementById('frame').src.slice(-200)]"
        )
        return frame, clock, arrow, cursor, source, browser.evaluate("document.querySelectorAll('#lines line').length")

    follow = next(started for started in flight.tasks_started if started.task == "follow_lines")
    start_s = (follow.t_ns - flight.tasks_started[0].t_ns) / 1e9
    one, other = slide_to(start_s + 2.0), slide_to(start_s + 9.0)
    for before, after in zip(one[:5], other[:5], strict=True):
        assert before != after
    minutes, seconds = divmod(start_s + 9.0, 60.0)
    assert other[1] == f"{minutes:.0f}:{seconds:04.1f}"
    assert other[5] > 0, "no line is drawn on the frame"
    assert browser.evaluate("document.getElementById('frame').naturalWidth") > 0
    keep(browser, f"slid-{browser.evaluate('innerWidth')}")


def test_the_comparison_page_is_whole(browser: Browser, log: Path, tmp_path: Path) -> None:
    page = tmp_path / "compared.html"
    ran = lineflight("compare", log, log, "--html", page)
    assert ran.code == 0, ran.err
    browser.open(page)
    assert browser.page.errors == []
    asked = [url for url in browser.page.requests if not url.startswith(("data:", "blob:"))]
    assert asked == [page.resolve().as_uri()]
    assert browser.evaluate("document.querySelectorAll('#charts .plot').length") == 2
    assert (
        browser.evaluate("document.getElementById('map').data.filter((t) => t.name.startsWith('follow')).length") == 2
    )
    told = browser.evaluate("document.getElementById('flights').textContent")
    assert "The same for all: " in told
    figures = browser.evaluate("[...document.querySelectorAll('#figures td:nth-child(2)')].map((c) => c.textContent)")
    assert [figure for figure in figures if "." in figure and not figure[-1].isalpha() and figure[-1] not in "°%"] == []
    assert [figure for figure in figures if figure.endswith(".00")] == [], "a count is whole"
    assert browser.evaluate("document.documentElement.scrollWidth <= innerWidth"), "it is wider than the window"
    keep(browser, f"compared-{browser.evaluate('innerWidth')}")


def test_a_comparison_says_first_what_differs(browser: Browser, flight: Flight, tmp_path: Path) -> None:
    told = flight.mission.metadata
    assert flight.line is not None
    line = replace(flight.line, axis_ne_m=tuple((north_m + 9.0, east_m) for north_m, east_m in flight.line.axis_ne_m))
    metadata = told | {"wind_m_s": "3", "world": "hills"}
    other = replace(flight, mission=replace(flight.mission, metadata=metadata), line=line)
    reports = [inspect_flight(one) for one in (flight, other)]
    page = tmp_path / "compared.html"
    comparison = compare_reports(["a", "b"], reports, circumstances_of([flight, other]))
    page.write_text(comparison_page(comparison, [flight, other]))
    browser.open(page)
    rows = browser.evaluate(
        "[...document.querySelectorAll('#flights tr')].slice(1).map((r) => [...r.cells].map((c) => c.textContent))"
    )
    assert "(1 along one; 2 along another)" in browser.evaluate("document.getElementById('mapnote').textContent")
    assert not browser.evaluate("document.getElementById('mapnote').hidden")
    assert rows == [["world", "medium_voltage", "hills"], ["wind", "8 m/s", "3 m/s"]]
    assert browser.evaluate(
        "document.getElementById('flights').getBoundingClientRect().bottom"
        " < document.getElementById('figures').getBoundingClientRect().top"
    )


@pytest.mark.parametrize("n_flights", [4, 7])
def test_many_flights_beside_each_other_stay_readable(
    browser: Browser, flight: Flight, tmp_path: Path, n_flights: int
) -> None:
    told = flight.mission.metadata
    flights = [
        replace(flight, mission=replace(flight.mission, metadata=told | {"wind_m_s": str(k)})) for k in range(n_flights)
    ]
    page = tmp_path / "compared.html"
    names = [f"flight_{k}" for k in range(n_flights)]
    comparison = compare_reports(names, [inspect_flight(one) for one in flights], circumstances_of(flights))
    page.write_text(comparison_page(comparison, flights))
    browser.open(page)
    keep(browser, f"compared-{n_flights}-{browser.evaluate('innerWidth')}")
    assert browser.evaluate("document.documentElement.scrollWidth <= innerWidth"), "it is wider than the window"
    assert browser.evaluate("document.getElementById('map').clientHeight < 700")
    heights = "[...document.querySelectorAll('#figures tr')].map((row) => row.clientHeight)"
    assert browser.evaluate(f"Math.max(...{heights}) < 90")
    colours = "new Set([...document.querySelectorAll('.flights .swatch')].map((s) => s.style.background)).size"
    assert browser.evaluate(colours) == n_flights
    last = "[...document.querySelectorAll('#figures tr')].at(-1).cells"
    browser.evaluate("document.querySelector('#figures .scroll').scrollLeft = 1e5")
    assert browser.evaluate(f"[...{last}].at(-1).getBoundingClientRect().right <= innerWidth"), "it is cut"
    assert browser.evaluate(f"{last}[0].getBoundingClientRect().left >= 0"), "the figure's name is gone"


def test_it_is_dark_where_people_want_it_dark(page: Path) -> None:
    with Browser(*DESKTOP, is_dark=True) as browser:
        browser.open(page)
        draw_all(browser)
        assert browser.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(18, 22, 27)"
        keep(browser, "dark")


def test_the_live_page_shows_the_flight_and_passes_on_a_confirmed_wish(browser: Browser) -> None:
    with LiveFeed(LiveSettings(port=0, foxglove_port=0)) as feed:
        feed.record(Briefing("follow_line", ("takeoff", "follow_lines")))
        for _, item in itertools.islice(synthetic_flight.fly(), 12_000):
            if not isinstance(item, Setpoint):
                feed.record(item)
            if isinstance(item, VisionReport) and item.jpeg is not None and item.estimate is not None:
                break
        browser.go(feed.url)
        browser.wait_for("document.getElementById('camera') && document.getElementById('camera').width > 300")
        canvas = "document.getElementById('camera')"
        seen = "[...{0}.getContext('2d').getImageData(0, 0, {0}.width, {0}.height).data].some((v) => v > 0 && v < 255)"
        browser.wait_for(seen.format(canvas))
        keep(browser, f"live-{browser.evaluate('innerWidth')}")
        buttons = "[...document.querySelectorAll('button')]"
        browser.evaluate(f"{buttons}.find((b) => b.textContent.trim() === 'Hold' && b.offsetParent).click()")
        assert feed.wishes() == []  # it asks once more
        confirm = "[...document.querySelectorAll('dialog[open] button')].find((b) => /hold/i.test(b.textContent))"
        browser.wait_for(f"{confirm} !== undefined")
        browser.evaluate(f"{confirm}.click()")
        assert until(feed.wishes) == [Wish.HOLD]
    assert [error for error in browser.page.errors if "ERR_" not in error] == []
    assert all(url.startswith((feed.url.split("#")[0], "data:", "blob:")) for url in browser.page.requests)


def test_the_live_page_without_a_token_says_why_it_has_no_buttons(browser: Browser) -> None:
    with LiveFeed(LiveSettings(port=0, foxglove_port=0)) as feed:
        feed.record(Briefing("follow_line", ("takeoff", "follow_lines")))
        checks = [PreflightCheck(0, f"check_{k}", CheckResult.OK, "a reason of some length, " * 4) for k in range(20)]
        for check in checks:
            feed.record(check)
        browser.go(feed.url.partition("#")[0])
        browser.wait_for("document.querySelectorAll('#checks li').length === 20")
        assert browser.evaluate("document.getElementById('said').textContent").startswith("Without Hold and Land")
        assert not browser.evaluate("document.getElementById('hold').checkVisibility()")
        assert browser.evaluate("document.getElementById('clock').textContent") == "before take-off"
        browser.evaluate("document.getElementById('checkbox').open = true")
        assert browser.evaluate("document.documentElement.scrollWidth <= innerWidth"), "it is wider than the window"
        keep(browser, f"live-no-token-{browser.evaluate('innerWidth')}")


@pytest.mark.parametrize("address", ["127.0.0.1", "0.0.0.0"], ids=["this_computer", "any"])  # noqa: S104  # to test it
def test_the_live_page_with_another_flights_token_has_no_buttons_from_the_start(browser: Browser, address: str) -> None:
    """Where reading needs no token, and where all is refused; the right address in the same tab mends it."""
    commands = "[...document.querySelectorAll('#hold, #land')].filter((b) => b.checkVisibility()).length"
    told = "(document.getElementById('said').textContent + document.getElementById('notice').textContent)"
    with LiveFeed(LiveSettings(address=address, port=0, foxglove_port=0)) as feed:
        feed.record(Briefing("follow_line", ("takeoff", "follow_lines")))
        place, _, fragment = feed.url.partition("#")
        page = f"http://127.0.0.1:{place.rstrip('/').rpartition(':')[2]}/"
        browser.go(f"{page}#token=oldone")
        browser.wait_for(f"document.getElementById('said') && {told}.includes('use the address that the flight')")
        assert browser.evaluate(commands) == 0
        keep(browser, f"live-old-token-{browser.evaluate('innerWidth')}-{address}")
        browser.evaluate(f"location.hash = '{fragment}'")
        browser.wait_for(f"document.getElementById('hold') && {commands} === 2")
