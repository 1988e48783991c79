"""Flights held against each other: figures, tasks side by side, and conditions for a build server."""

import io
import json
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from mission.autopilot import VehicleState
from mission.compare.circumstances import circumstances_of
from mission.compare.comparison import compare_reports, distinct_names
from mission.compare.conditions import ConditionError, parse_condition
from mission.compare.figure_words import change_words, label_of, value_words
from mission.compare.figures import figures_of, pair_tasks
from mission.compare.report import print_comparison
from mission.ending import EXIT_BAD_INPUT, EXIT_DIFFERENT, EXIT_FAILED_FILE
from mission.log.flight_report import TaskSummary
from mission.log.inspection import inspect_flight
from mission.log.reader import Flight, read_flight
from mission.records import TaskEnded, TaskStarted, TruePose
from tests.log.synthetic_flight import fly, write_log
from tests.support.command_line import lineflight


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A flight, and one that flew 0.5 m further to the north and lacks its last leg's events."""
    folder = tmp_path_factory.mktemp("logs")
    first, second = folder / "first.mcap", folder / "second.mcap"
    write_log(first, list(fly()))
    write_log(second, [(t_ns, shifted(item)) for t_ns, item in fly()])
    return first, second


def shifted(item: object) -> object:
    return replace(item, north_m=item.north_m + 0.5) if isinstance(item, VehicleState | TruePose) else item


def test_a_change_is_what_the_second_has_more(logs: tuple[Path, Path]) -> None:
    flights = [read_flight(log) for log in logs]
    comparison = compare_reports(["a", "b"], [inspect_flight(f) for f in flights], circumstances_of(flights))
    assert comparison.change("lateral_mean_m", 1) == pytest.approx(0.32, abs=0.05)
    assert comparison.change("leg_1_straightness_mean_m", 1) == pytest.approx(0.0, abs=1e-9)
    assert comparison.change("duration_s", 1) == 0.0
    assert all(pair.first is not None and pair.other is not None for pair in comparison.tasks[0])


def with_circumstances(flight: Flight, metadata: dict[str, str], **attachments: dict[str, object]) -> Flight:
    told = {f"{name}.json": json.dumps(content).encode() for name, content in attachments.items()}
    return replace(flight, mission=replace(flight.mission, metadata=metadata), attachments=told)


def test_what_flights_were_flown_with_is_told_where_it_differs(logs: tuple[Path, Path]) -> None:
    flight = read_flight(logs[0])
    first = with_circumstances(
        flight,
        {"command": "dry-run", "world": "corner", "wind_m_s": "0", "seed": "1"},
        versions={"lineflight": "0.1.0", "numpy": "2.4"},
        parameters={"MPC_XY_P": 0.95, "MPC_Z_P": 1.0},
        plan={"tasks": [{"altitude_m": 5}]},
    )
    other = with_circumstances(
        flight,
        {"command": "dry-run", "world": "hills", "wind_m_s": "8", "seed": "1", "light": "dusk"},
        versions={"lineflight": "0.2.0", "numpy": "2.4"},
        parameters={"MPC_XY_P": 0.8, "MPC_Z_P": 1.0},
        plan={"tasks": [{"altitude_m": 7.5}]},
    )
    gusty = with_circumstances(flight, first.mission.metadata | {"gust_fronts": "yes"})
    assert circumstances_of([first, gusty]).differing["gust fronts"] == ("no", "yes")
    found = circumstances_of([first, other])
    assert found.differing == {
        "world": ("corner", "hills"),
        "wind": ("0 m/s", "8 m/s"),
        "light": ("not told", "dusk"),
        "lineflight": ("0.1.0", "0.2.0"),
        "tasks.1.altitude_m (mission)": ("5", "7.5"),
        "MPC_XY_P (autopilot)": ("0.95", "0.8"),
    }
    assert found.alike["seed"] == "1"
    assert found.alike["command"] == "dry-run"
    assert circumstances_of([first, first]).differing == {}


def test_settings_of_other_missions_are_not_held_against_each_other(logs: tuple[Path, Path]) -> None:
    flight = with_circumstances(read_flight(logs[0]), {}, plan={"name": "a"})
    other = with_circumstances(replace(flight, mission=replace(flight.mission, name="b")), {}, plan={"name": "b"})
    assert circumstances_of([flight, other]).differing == {"mission": ("follow_line", "b")}


def test_people_read_the_first_of_many_settings_and_programs_all(logs: tuple[Path, Path]) -> None:
    flight = read_flight(logs[0])
    many = [with_circumstances(flight, {}, parameters={f"P{k}": k + by for k in range(100)}) for by in (0, 1)]
    found = circumstances_of(many)
    assert len(found.differing) == 100
    assert len(found.shown) + found.n_not_shown == 100
    assert found.n_not_shown > 0


@pytest.mark.parametrize(
    ("name", "value", "words", "change"),
    [
        ("events", 5.0, "5", "+5"),
        ("lateral_p95_m", 0.1205, "0.120 m", "+0.120 m"),
        ("setpoint_gap_max_ms", 50.0, "50.0 ms", "+50.0 ms"),
        ("setpoint_gap_max_ms", -1e-11, "-0.0 ms", "same"),
        ("setpoint_rate_hz", 20.0, "20.0 Hz", "+20.0 Hz"),
        ("yaw_error_p95_deg", -2.5, "-2.50°", "-2.50°"),
        ("estimates_percent", 50.0, "50.0 %", "+50.0 points"),
        ("estimates_percent", -0.01, "-0.0 %", "same"),
        ("duration_s", None, "-", "-"),
    ],
)
def test_figures_bear_their_units(name: str, value: float | None, words: str, change: str) -> None:
    assert (value_words(name, value), change_words(name, value)) == (words, change)


def test_every_figure_has_a_name_for_people(logs: tuple[Path, Path]) -> None:
    labels = [label_of(name) for name in figures_of(inspect_flight(read_flight(logs[0])))]
    assert len(set(labels)) == len(labels)
    assert [label for label in labels if "_" in label or label.endswith((" m", " ms", " deg", " hz"))] == []


def test_logs_that_are_called_alike_are_told_apart() -> None:
    assert distinct_names([Path("a/x.mcap"), Path("b/x.mcap"), Path("y.mcap")]) == ["a/x", "b/x", "y"]
    assert distinct_names([Path("a/x.mcap"), Path("a/x.mcap")]) == ["x", "x"]


def task(name: str) -> TaskSummary:
    return TaskSummary(name, 0.0, 1.0, "completed", "")


def test_tasks_are_paired_by_name_in_their_order() -> None:
    first = [task(name) for name in ("takeoff", "align", "follow_lines", "land")]
    other = [task(name) for name in ("takeoff", "follow_lines", "hold", "land")]
    pairs = [(a and a.task, b and b.task) for a, b in ((p.first, p.other) for p in pair_tasks(first, other))]
    assert pairs == [
        ("takeoff", "takeoff"),
        ("align", None),
        ("follow_lines", "follow_lines"),
        (None, "hold"),
        ("land", "land"),
    ]


@given(st.lists(st.sampled_from("abc")), st.lists(st.sampled_from("abc")))
def test_no_task_is_lost_in_pairing(first: list[str], other: list[str]) -> None:
    pairs = pair_tasks([task(name) for name in first], [task(name) for name in other])
    assert [pair.first.task for pair in pairs if pair.first is not None] == first
    assert [pair.other.task for pair in pairs if pair.other is not None] == other
    assert all(pair.first is None or pair.other is None or pair.first.task == pair.other.task for pair in pairs)


KNOWN = ["lateral_p95_m", "latency_p95_ms"]


@pytest.mark.parametrize(
    ("text", "first", "last", "fails"),
    [
        ("lateral_p95_m>0.5", 0.1, 0.6, True),
        ("lateral_p95_m>0.5", 0.9, 0.5, False),
        ("lateral_p95_m >= 0.5", 0.9, 0.5, True),
        ("lateral_p95_m<0.5", 0.9, 0.4, True),
        ("lateral_p95_m<=4e-1", 0.9, 0.4, True),
        ("change:lateral_p95_m>0.1", 0.1, 0.3, True),
        ("change:lateral_p95_m>0.1", 0.3, 0.3, False),
        ("change:lateral_p95_m<-0.1", 0.5, 0.3, True),
        ("lateral_p95_m>0.5", 0.1, None, True),  # what cannot be judged must not pass
        ("change:lateral_p95_m>0.5", None, 0.1, True),
    ],
)
def test_conditions(text: str, first: float | None, last: float | None, fails: bool) -> None:
    condition = parse_condition(text, KNOWN)
    assert (condition.failure({"lateral_p95_m": first}, {"lateral_p95_m": last}) is not None) == fails


@pytest.mark.parametrize("number", [".5", "5.", "+.5", "-.5e-3", "1e+3", "1E+03", "0", "-0.0", " 2 "])
def test_a_number_is_whatever_float_reads(number: str) -> None:
    assert parse_condition(f"lateral_p95_m>{number}", KNOWN).limit == float(number)


@given(
    st.floats(allow_nan=False, allow_infinity=False), st.sampled_from(["{!r}", "{:+}", "{:e}", "{:+.17E}", "{:.12f}"])
)
def test_every_way_in_which_python_writes_a_finite_number_is_read(limit: float, form: str) -> None:
    number = form.format(limit)
    for sign in ("<", ">", "<=", ">="):
        assert parse_condition(f"change:lateral_p95_m{sign}{number}", KNOWN).limit == float(number)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("lateral_p95_m", "is no condition"),
        ("lateral_p95_m==1", "is no condition"),
        ("lateral_p95>0.5", "did you mean lateral_p95_m"),
        ("zzz>0.5", "there are latency_p95_ms, lateral_p95_m"),
        ("lateral_p95_m>0.5; rm -rf", "is no condition"),
        ("lateral_p95_m>", "is no condition"),
        ("lateral_p95_m>1e", "is no condition"),
        ("lateral_p95_m>nan", "lateral_p95_m>nan' would always hold, or never; write a finite number"),
        ("lateral_p95_m<-inf", "write a finite number: lateral_p95_m<0.5"),
        ("change:lateral_p95_m>Infinity", "write a finite number: change:lateral_p95_m>0.5"),
        ("lateral_p95_m>1e999", "write a finite number"),
    ],
)
def test_what_is_no_condition_is_refused_in_a_sentence(text: str, words: str) -> None:
    with pytest.raises(ConditionError, match=words):
        parse_condition(text, KNOWN)


def test_the_command_compares_and_fails_where_it_is_told_to(logs: tuple[Path, Path], tmp_path: Path) -> None:
    page = tmp_path / "compared.html"
    ran = lineflight("compare", *logs, "--html", page, "--fail-if", "lateral_p95_m>0.5")
    assert ran.code == EXIT_DIFFERENT
    assert "lateral_p95_m is 0.7" in ran.err
    assert "lateral_mean_m" in ran.out
    assert "first: follow_line, completed: Every task was flown" in ran.out
    assert ran.out.index("same for all: ") < ran.out.index("Figures")
    assert all(len(line) == len(line.rstrip()) for line in ran.out.splitlines())
    assert page.stat().st_size > 1_000_000
    fine = lineflight("compare", *logs, "--json", "--fail-if", "lateral_p95_m>5")
    assert fine.code == 0
    answer = json.loads(fine.out)
    assert answer["failures"] == []
    assert answer["figures"]["duration_s"][0] == answer["figures"]["duration_s"][1]
    assert set(answer["tasks"][0][0]) == {"task", "took_s", "results"}
    assert answer["tasks"][0][0]["task"] == "takeoff"
    assert answer["figures"]["estimates_percent"][0] > 1.0
    assert answer["flown_with"]["differing"] == {}
    assert answer["flown_with"]["alike"]["mission"] == "follow_line"


def test_what_cannot_be_compared_is_refused_in_a_sentence(logs: tuple[Path, Path], tmp_path: Path) -> None:
    first, second = logs
    for arguments, code in (
        ([first], EXIT_BAD_INPUT),
        ([first, tmp_path / "no.mcap"], EXIT_BAD_INPUT),
        ([first, second, "--fail-if", "lateral>1"], EXIT_BAD_INPUT),
        ([first, second, "--html", tmp_path / "no" / "page.html"], EXIT_FAILED_FILE),
    ):
        ran = lineflight("compare", *arguments)
        assert (ran.code, ran.err.count("\n")) == (code, 1), ran.err


def test_a_task_that_only_one_has_flown_is_told(logs: tuple[Path, Path], tmp_path: Path) -> None:
    lacking = tmp_path / "lacking.mcap"
    kept = [(t, item) for t, item in fly() if not (isinstance(item, TaskStarted | TaskEnded) and item.task == "align")]
    write_log(lacking, kept)
    ran = lineflight("compare", logs[0], lacking)
    assert "align: flown in 1, not in 2" in ran.out


@pytest.mark.parametrize("width", [60, 80, 100])
@pytest.mark.parametrize("n_logs", [2, 3, 4, 7])
def test_in_a_terminal_no_number_is_cut_or_wrapped(logs: tuple[Path, Path], n_logs: int, width: int) -> None:
    flights = [read_flight(log) for log in logs]
    flights = [flights[k % 2] for k in range(n_logs)]
    comparison = compare_reports(
        [f"f{k}" for k in range(n_logs)], [inspect_flight(f) for f in flights], circumstances_of(flights)
    )
    shown = io.StringIO()
    print_comparison(comparison, Console(file=shown, width=width, force_terminal=True, color_system=None))
    text = shown.getvalue()
    assert "…" not in text
    assert max(map(len, text.splitlines())) <= width
    for name in comparison.figure_names:
        spelled = [value_words(name, figures.get(name)) for figures in comparison.figures]
        spelled += [change_words(name, comparison.change(name, k)) for k in range(1, n_logs)]
        rows = [line.removeprefix(f" {name} ") for line in text.splitlines() if line.startswith(f"  {name} ")]
        rows = [row.removeprefix(f"  {name}").replace(f" {label_of(name)} ", " ") for row in rows]
        assert " ".join(" ".join(rows).split()) == " ".join(spelled), name


def test_a_title_is_not_wrapped_at_its_tables_width(logs: tuple[Path, Path]) -> None:
    flight = read_flight(logs[0])
    flights = [with_circumstances(flight, {"seed": seed}) for seed in "12"]
    comparison = compare_reports(["a", "b"], [inspect_flight(f) for f in flights], circumstances_of(flights))
    shown = io.StringIO()
    print_comparison(comparison, Console(file=shown))
    assert "What they were flown with differs" in shown.getvalue().splitlines()
