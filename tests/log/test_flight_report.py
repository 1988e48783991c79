"""What a flight's report says: figures with known answers, and the page a person reads."""

import io
import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from rich.console import Console

from drivers.clock import NS_PER_S
from mission.log.flight_report import FlightReport, PreflightSummary, to_json
from mission.log.measures import line_fit_distances_m, nearest_on_axis, offboard_gaps_s
from mission.log.reader import Flight, read_flight
from mission.log.report import print_report
from mission.log.summary import summarise
from mission.log.wording import counted
from mission.records import CheckResult, Event, MissionEnded, PreflightCheck, Result, Severity, TaskEnded, TruePose
from tests.log.synthetic_flight import START_NS, SWAY_M, TASKS, fly, write_log
from vision.records import Track, Trouble

coordinates_m = st.floats(-1e3, 1e3)


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Flight:
    path = tmp_path_factory.mktemp("logs") / "flight.mcap"
    write_log(path, list(fly()))
    return read_flight(path)


@pytest.fixture(scope="module")
def report(flight: Flight) -> FlightReport:
    return summarise(flight)


def printed(report: FlightReport, width: int = 100, *, is_terminal: bool = True) -> str:
    console = Console(file=io.StringIO(), width=width, force_terminal=is_terminal, color_system=None)
    print_report(report, console)
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


def rotation(yaw_rad: float, pitch_rad: float) -> np.ndarray:
    c, s, cp, sp = math.cos(yaw_rad), math.sin(yaw_rad), math.cos(pitch_rad), math.sin(pitch_rad)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])


@given(
    arrays(np.float64, (12,), elements=st.floats(0.0, 50.0), unique=True),
    st.floats(0.01, 0.5),
    st.floats(-math.pi, math.pi),
    st.floats(-1.5, 1.5),
    arrays(np.float64, (3,), elements=coordinates_m),
)
def test_a_zigzag_is_its_amplitude_away_from_its_line(along, amplitude_m, yaw_rad, pitch_rad, origin) -> None:
    # Each place is passed once on either side, so that the fitted line runs in the middle.
    along = np.sort(along) + np.arange(12.0)
    sides = np.repeat([amplitude_m, -amplitude_m], 12)
    flat = np.column_stack([np.tile(along, 2), sides, np.zeros(24)])
    distances = line_fit_distances_m(flat @ rotation(yaw_rad, pitch_rad).T + origin)
    np.testing.assert_allclose(distances, amplitude_m, rtol=1e-6)


def test_points_on_a_line_are_no_distance_from_it() -> None:
    points = np.outer(np.linspace(0, 30, 20), [0.3, -0.9, 0.1]) + np.array([4.0, 5.0, -6.0])
    np.testing.assert_allclose(line_fit_distances_m(points), 0.0, atol=1e-12)


def test_right_of_the_axis_is_positive_and_beyond_its_end_the_end_counts() -> None:
    axis = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0]])  # north, then east
    points = np.array([[5.0, 2.0], [5.0, -2.0], [11.0, 5.0], [-3.0, 4.0], [10.0, 13.0]])
    distance_m, direction_rad = nearest_on_axis(points, axis)
    np.testing.assert_allclose(distance_m[:3], [2.0, -2.0, -1.0])
    np.testing.assert_allclose(np.abs(distance_m[3:4]), [5.0])
    np.testing.assert_allclose(direction_rad, [0.0, 0.0, math.pi / 2, 0.0, math.pi / 2])


@given(coordinates_m, coordinates_m, st.floats(-math.pi, math.pi), st.floats(-20, 20), st.floats(-5, 5))
def test_distance_from_an_axis_does_not_depend_on_where_it_lies(north, east, turn_rad, along, aside) -> None:
    turned = np.array([[math.cos(turn_rad), -math.sin(turn_rad)], [math.sin(turn_rad), math.cos(turn_rad)]])
    axis = np.array([[-50.0, 0.0], [0.0, 0.0], [50.0, 0.0]]) @ turned.T + [north, east]
    distance_m, _ = nearest_on_axis(np.array([[along, aside]]) @ turned.T + [north, east], axis)
    assert distance_m[0] == pytest.approx(aside, abs=1e-9)


def test_gaps_run_on_between_offboard_tasks_but_not_over_one_that_the_autopilot_flew() -> None:
    times_ns = np.array([0, 100, 250, 300, 900, 950], dtype=np.int64) * 1_000_000
    windows = [(start * 1_000_000, end * 1_000_000) for start, end in ((0, 120), (120, 400), (400, 850), (850, 1000))]
    np.testing.assert_allclose(offboard_gaps_s(times_ns, windows), [0.1, 0.15, 0.05, 0.05])


def test_a_stall_across_two_offboard_tasks_is_a_gap(flight: Flight) -> None:
    stall = (START_NS + 23 * NS_PER_S, START_NS + 25 * NS_PER_S)  # move_until ends after 24 s
    kept = tuple(setpoint for setpoint in flight.setpoints if not stall[0] < setpoint.t_ns < stall[1])
    assert summarise(flight).setpoints.max_gap_ms == pytest.approx(50.0)
    assert summarise(replace(flight, setpoints=kept)).setpoints.max_gap_ms == pytest.approx(2050.0, abs=51.0)


def test_the_figures_of_a_flight_that_is_known(report: FlightReport) -> None:
    assert (report.mission, report.result, report.is_truncated) == ("follow_line", "completed", False)
    assert report.duration_s == pytest.approx(sum(duration_s for *_, duration_s in TASKS))
    assert [(task.task, task.result) for task in report.tasks] == [(name, "completed") for name, *_ in TASKS]
    assert [task.start_s for task in report.tasks][:4] == pytest.approx([0.0, 6.0, 14.0, 24.0])
    assert report.lateral is not None
    assert report.lateral.mean_m == pytest.approx(SWAY_M * 2 / math.pi, rel=0.01)
    assert report.lateral.max_m == pytest.approx(SWAY_M, rel=0.01)
    assert len(report.legs) == 2
    for leg in report.legs:
        assert leg.task == "follow_lines"
        assert leg.avg_error_m == pytest.approx(SWAY_M * 2 / math.pi, rel=0.05)
        assert leg.avg_error_m < leg.p95_error_m <= SWAY_M * 1.2
    assert report.yaw_error is not None
    assert report.yaw_error.p95_deg == pytest.approx(0.0, abs=1.0)
    assert report.setpoints.rate_hz == pytest.approx(20.0)
    assert report.vision.latency_ms is not None
    assert report.vision.latency_ms.p50 == pytest.approx(33.0)
    assert 0 < report.vision.estimates < report.vision.frames == 20 * round(report.duration_s)
    assert report.landing is not None
    assert report.landing.distance_m == pytest.approx(math.hypot(0.2, 0.1))
    assert report.landing.is_disarmed
    assert [(event.t_s, event.name) for event in report.events] == [(24.0, "line_found")]


def test_the_heading_error_is_to_the_line_whichever_way_it_is_flown(flight: Flight) -> None:
    turned = tuple(replace(pose, yaw_rad=pose.yaw_rad + math.radians(3.0)) for pose in flight.truth)
    yaw = summarise(replace(flight, truth=turned)).yaw_error
    assert yaw is not None
    assert (yaw.median_deg, yaw.p95_deg) == pytest.approx((3.0, 3.0))


def test_a_real_flight_has_no_true_figures(flight: Flight) -> None:
    report = summarise(replace(flight, truth=(), line=None))
    assert (report.lateral, report.yaw_error) == (None, None)
    assert to_json(report)["lateral"] is None
    assert report.landing is not None
    assert "true" not in printed(report)


def test_doubtful_and_troubled_frames_are_counted(flight: Flight) -> None:
    first, second, third, *others = flight.reports
    marked = [
        replace(first, track=Track.DOUBTFUL),
        replace(second, trouble=Trouble.DARK, track=Track.DOUBTFUL),
        replace(third, trouble=Trouble.DARK),
    ]
    vision = summarise(replace(flight, reports=(*marked, *others))).vision
    assert (vision.doubtful, vision.troubles) == (2, {"dark": 2})
    assert "2 were doubtful, 2 dark" in printed(summarise(replace(flight, reports=(*marked, *others))))


def test_the_json_keeps_its_shape(report: FlightReport) -> None:
    data = json.loads(json.dumps(to_json(report)))
    assert data.keys() >= {
        "mission", "result", "duration_s", "tasks", "legs", "lateral", "vision", "setpoints", "events",
    }  # fmt: skip
    assert data["tasks"][0].keys() >= {"task", "start_s", "end_s", "result"}
    assert data["legs"][0].keys() == {"task", "n_points", "avg_error_m", "p95_error_m"}
    assert data["lateral"].keys() == {"mean_m", "p95_m", "max_m"}
    assert data["vision"].keys() == {"frames", "estimates", "doubtful", "troubles", "latency_ms"}
    assert data["vision"]["latency_ms"].keys() == {"p50", "p95", "p99"}
    assert data["setpoints"].keys() == {"rate_hz", "max_gap_ms"}
    assert data["events"][0].keys() == {"t_s", "name", "severity", "message", "reaction"}


def test_a_flight_that_breaks_off_is_unfinished(flight: Flight) -> None:
    broken = replace(
        flight, tasks_ended=flight.tasks_ended[:4], tasks_started=flight.tasks_started[:5], mission_ended=None,
        is_truncated=True,
    )  # fmt: skip
    report = summarise(broken)
    assert report.result == "unfinished"
    assert (report.tasks[-1].task, report.tasks[-1].end_s, report.tasks[-1].result) == (
        "follow_lines",
        None,
        "unfinished",
    )
    assert len(report.legs) == 1
    text = printed(report)
    assert "unfinished" in text
    assert "The log was cut off" in text


def test_a_log_of_nothing_but_its_start_has_a_report(tmp_path: Path) -> None:
    write_log(tmp_path / "a.mcap", [])
    report = summarise(read_flight(tmp_path / "a.mcap"))
    assert (report.result, report.duration_s, report.tasks, report.legs) == ("unfinished", 0.0, (), ())
    assert (report.setpoints.rate_hz, report.vision.latency_ms, report.landing) == (None, None, None)
    assert "unfinished" in printed(report)


def test_a_task_that_is_flown_twice_is_paired_with_its_own_end(flight: Flight) -> None:
    first, second = flight.tasks_started[0], replace(flight.tasks_started[0], t_ns=START_NS + 3 * NS_PER_S)
    ends = (
        TaskEnded(START_NS + 2 * NS_PER_S, 0, "takeoff", Result.TIMED_OUT, "a"),
        TaskEnded(START_NS + 5 * NS_PER_S, 0, "takeoff", Result.COMPLETED, "b"),
    )
    report = summarise(replace(flight, tasks_started=(first, second), tasks_ended=ends))
    assert [(task.start_s, task.end_s, task.reason) for task in report.tasks] == [(0.0, 2.0, "a"), (3.0, 5.0, "b")]


@pytest.mark.parametrize("width", [60, 80, 100, 200])
def test_the_page_fits_its_width(report: FlightReport, width: int) -> None:
    lines = printed(report, width).splitlines()
    assert max(len(line) for line in lines) <= min(width, 100)


def test_the_page_tells_tasks_figures_and_events(report: FlightReport) -> None:
    text = printed(report)
    for words in (
        "follow_line",
        "completed",
        "1 min 47 s",
        "move until",
        "leg 2",
        "0.186 m mean",
        "line found",
        "disarmed",
    ):
        assert words in text
    assert text.index("Tasks") < text.index("Figures") < text.index("Events")


LONG = "the vehicle has been tilted by 45 degrees for 3 s, which is about as long as anybody can read on one line of it"


@pytest.fixture
def timed_out(flight: Flight) -> Flight:
    """The same flight, whose align took too long: 10 s of going down come after it."""
    end_ns = flight.tasks_started[3].t_ns + 6 * NS_PER_S
    ended = replace(flight.tasks_ended[3], t_ns=end_ns, result=Result.TIMED_OUT, reason=LONG)
    return replace(
        flight,
        tasks_started=flight.tasks_started[:4],
        tasks_ended=(*flight.tasks_ended[:3], ended),
        events=(Event(end_ns, "task_timed_out", Severity.ERROR, LONG, "land_clear"),),
        mission_ended=MissionEnded(end_ns + 10 * NS_PER_S, Result.TIMED_OUT, LONG),
    )


def test_the_headline_names_the_task_that_was_not_completed(timed_out: Flight, report: FlightReport) -> None:
    assert summarise(timed_out).headline == "timed out in align"
    assert "follow_line  timed out in align  40 s, counted from take-off" in printed(summarise(timed_out))
    assert report.headline == "completed"


def test_the_way_down_after_a_failed_task_is_a_stage(timed_out: Flight, report: FlightReport) -> None:
    (stage,) = summarise(timed_out).stages
    assert (stage.name, stage.start_s, stage.end_s) == ("going down", 30.0, 40.0)
    assert to_json(summarise(timed_out))["stages"] == [{"name": "going down", "start_s": 30.0, "end_s": 40.0}]
    assert report.stages == ()


def test_rejoining_is_a_stage_until_the_next_task(flight: Flight) -> None:
    begun_ns = flight.tasks_started[0].t_ns + 2 * NS_PER_S
    rejoining = Event(begun_ns, "rejoining", Severity.INFO, "back to where it was")
    (stage,) = summarise(replace(flight, events=(rejoining,))).stages
    assert (stage.name, stage.start_s, stage.end_s) == ("rejoining", 2.0, 6.0)


def test_into_a_pipe_nothing_is_cut_or_drawn(timed_out: Flight) -> None:
    text = printed(summarise(timed_out), width=80, is_terminal=False)
    lines = text.splitlines()
    assert any(LONG in line and line.startswith("align") for line in lines), "the row of the task was wrapped"
    assert any(LONG in line and "land clear" in line for line in lines)
    assert [line for line in lines if line != line.rstrip()] == []
    assert "\x1b" not in text
    assert not set("─━│┃╭╮") & set(text)
    assert LONG not in printed(summarise(timed_out), width=80)  # in a terminal it is wrapped


def test_one_of_a_thing_is_not_spelled_as_many(flight: Flight) -> None:
    first = replace(flight.reports[0], track=Track.DOUBTFUL)
    text = printed(summarise(replace(flight, reports=(first,))))
    assert "of 1 frame, 1 was doubtful" in text
    assert (counted(1, "task"), counted(0, "task"), counted(2, "task")) == ("1 task", "0 tasks", "2 tasks")


def test_trouble_comes_first(flight: Flight) -> None:
    troubled = replace(
        flight,
        events=(Event(START_NS + NS_PER_S, "line_lost", Severity.ERROR, "No [line] for 2 s.", "hold"),),
        mission_ended=MissionEnded(flight.end_ns, Result.FAILED, "The line was lost."),
    )
    text = printed(summarise(troubled))
    assert text.index("Events") < text.index("Tasks")
    assert "No [line] for 2 s." in text
    assert "hold" in text


def test_what_preflight_found_is_told_when_it_was_not_fine(tmp_path: Path) -> None:
    checks = [
        PreflightCheck(START_NS, "health", CheckResult.OK, "the autopilot would arm"),
        PreflightCheck(START_NS, "stick_takeover", CheckResult.WARNING, "the sticks are ignored"),
        PreflightCheck(START_NS, "return_altitude", CheckResult.FAILED, "set it to 16"),
    ]
    write_log(tmp_path / "a.mcap", [(START_NS, check) for check in checks])
    report = summarise(read_flight(tmp_path / "a.mcap"))
    assert report.preflight == PreflightSummary(
        3, ("stick takeover: the sticks are ignored",), ("return altitude: set it to 16",)
    )
    lines = printed(report).splitlines()
    assert [line for line in lines if "pre-flight" in line] == [
        "pre-flight  return altitude: set it to 16",
        "pre-flight  stick takeover: the sticks are ignored",
    ]


def test_true_poses_outside_following_do_not_count(flight: Flight) -> None:
    stray = TruePose(START_NS + 2 * NS_PER_S, 500.0, 500.0, 0.0, 1.0)
    assert summarise(replace(flight, truth=(*flight.truth, stray))).lateral == summarise(flight).lateral
