"""What the page is told of a made-up flight."""

import json
import math
from dataclasses import replace

import pytest

from drivers.clock import NS_PER_S
from mission.autopilot import Setpoint, VehicleState
from mission.live.board import Board
from mission.live.settings import Batch, Briefing
from mission.log.records import LoggedMission, StatusText
from mission.records import CheckResult, LineFix, MissionEnded, PreflightCheck, Result, TaskStarted
from mission.reporting import Progress
from tests.log.synthetic_flight import LINE_NORTH_M, START_NS, TASKS, fly
from vision.records import VisionReport

MISSION = LoggedMission("follow_line", "", "", START_NS, 0, {})
RECORDS = [item for _, item in fly() if not isinstance(item, Setpoint)]
NAMES = tuple(task for task, *_ in TASKS)


@pytest.fixture(scope="module")
def flown() -> Board:
    board = Board()
    check = PreflightCheck(START_NS, "disk", CheckResult.WARNING, "make room soon")
    first = (Briefing("follow_line", NAMES), MISSION, check)
    board.add(Batch(0, (*first, *RECORDS, Progress("11_land", 10, 0.1, 0.2, math.pi, ()))), 7.0)
    return board


def test_the_state_is_json_of_the_newest_records(flown: Board) -> None:
    state = json.loads(json.dumps(flown.state(8.5), allow_nan=False))
    assert state["mission"] == "follow_line"
    assert state["tasks"] == list(NAMES)
    assert state["progress"] == {
        "stage": "11_land", "task_index": 10, "height_m": 0.1, "distance_m": 0.2, "waiting_for": [], "heading_deg": 180,
    }  # fmt: skip
    vehicle = state["vehicle"]
    assert (vehicle["mode"], vehicle["is_armed"], vehicle["battery"]) == ("hold", False, 0.79)
    assert state["vehicle_age_s"] == 1.5
    assert state["t_s"] == sum(duration_s for *_, duration_s in TASKS)
    assert state["line"]["north_m"] == LINE_NORTH_M
    assert state["line"]["heading_deg"] == 90.0
    assert state["checks"] == [{"name": "disk", "result": "warning", "reason": "make room soon"}]
    assert state["ended"]["result"] == "completed"
    texts = [event["text"] for event in state["events"]]
    assert "takeoff started" in texts
    assert texts[-1].startswith("mission completed")


def test_the_frame_comes_with_its_own_lines(flown: Board) -> None:
    newest = [item for item in RECORDS if isinstance(item, VisionReport) and item.jpeg is not None][-1]
    assert flown.frame is not None
    assert flown.frame.jpeg == newest.jpeg
    assert flown.state(8.0)["frame"]["seq"] == newest.seq
    assert len(flown.frame.lines_px) == len(newest.power_lines)
    assert flown.state(8.0)["camera_px"] == (640, 480)


def test_the_map_has_the_way_flown_the_fixes_and_the_true_line(flown: Board) -> None:
    drawn = json.loads(json.dumps(flown.map(), allow_nan=False))
    states = [item for item in RECORDS if isinstance(item, VehicleState)]
    assert math.dist(drawn["track"][0], (states[0].north_m, states[0].east_m)) < 0.01
    assert max(east_m for _, east_m in drawn["track"]) == pytest.approx(30.0, abs=0.3)
    assert {north_m for north_m, _ in drawn["fixes"]} == {LINE_NORTH_M}
    assert drawn["true_line"] == [[LINE_NORTH_M, -20.0], [LINE_NORTH_M, 50.0]]


def test_a_long_way_stays_small() -> None:
    board = Board()
    state = next(item for item in RECORDS if isinstance(item, VehicleState))
    board.add(Batch(0, tuple(replace(state, north_m=float(n), east_m=n / 3) for n in range(30_000))), 0.0)
    track = board.map()["track"]
    assert 500 < len(track) <= 2000
    assert track[0] == (0.0, 0.0)
    assert track[-1][0] > 29_900


def test_what_is_no_number_is_told_as_nothing() -> None:
    board = Board()
    state = next(item for item in RECORDS if isinstance(item, VehicleState))
    odd = replace(state, north_m=math.nan, v_down_m_s=math.inf, yaw_rad=math.nan)
    fix = LineFix(START_NS, math.nan, math.nan, math.nan, True, 3, math.nan, None)
    board.add(Batch(0, (MISSION, odd, fix)), 0.0)
    told = json.loads(json.dumps({"state": board.state(0.0), "map": board.map()}, allow_nan=False))
    assert told["state"]["vehicle"]["north_m"] is None
    assert told["state"]["vehicle"]["heading_deg"] is None
    assert told["map"]["track"] == told["map"]["fixes"] == []


def test_before_the_first_record_there_is_nothing_to_tell() -> None:
    state = json.loads(json.dumps(Board().state(0.0), allow_nan=False))
    assert (state["vehicle"], state["frame"], state["ended"], state["t_s"]) == (None, None, None, None)


def test_times_count_from_the_first_task_as_in_a_report() -> None:
    board = Board()
    before, start_ns = StatusText(START_NS, "Armed"), START_NS + 12 * NS_PER_S
    board.add(Batch(0, (MISSION, before)), 0.0)
    state = board.state(0.0)
    assert (state["t_s"], state["times_since"], state["events"][0]["t_s"]) == (None, "take-off", None)
    board.add(Batch(0, (TaskStarted(start_ns, 0, "takeoff"), TaskStarted(start_ns + 5 * NS_PER_S, 1, "ascend"))), 0.0)
    state = board.state(0.0)
    assert (state["t_s"], [event["t_s"] for event in state["events"]]) == (5.0, [-12.0, 0.0, 5.0])
    ended = MissionEnded(start_ns + 9 * NS_PER_S, Result.COMPLETED, "landed")
    board.add(Batch(0, (ended, StatusText(start_ns + 20 * NS_PER_S, "Disarmed"))), 0.0)
    assert board.state(0.0)["t_s"] == 9.0


def test_a_flight_that_is_resumed_in_the_air_does_not_count_from_a_take_off() -> None:
    board = Board()
    board.add(Batch(0, (TaskStarted(START_NS, 4, "follow_lines"),)), 0.0)
    assert board.state(0.0)["times_since"] == "the first task's start"


def test_events_are_bounded_and_without_chatter() -> None:
    board = Board()
    start = TaskStarted(START_NS, 0, "takeoff")
    words = [StatusText(START_NS + i * NS_PER_S, f"word {i}") for i in range(500)]
    board.add(Batch(3, (start, *words, StatusText(START_NS, "mavsdk ERROR: Retrying failed"))), 0.0)
    state = board.state(0.0)
    assert [event["text"] for event in state["events"]] == [f"word {i}" for i in range(400, 500)]
    assert state["events"][-1]["t_s"] == 499.0
    assert state["n_dropped"] == 3
