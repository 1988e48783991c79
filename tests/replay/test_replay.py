"""The golden flight, flown again: the regression test for every change of vision and guidance."""

import json
import math
from dataclasses import replace
from io import StringIO
from pathlib import Path

import pytest
from rich.console import Console

from drivers.mcap_stream import Damage
from mission.autopilot import Setpoint, VehicleState
from mission.ending import EXIT_BAD_INPUT, EXIT_DIFFERENT
from mission.log import channels
from mission.log.copying import write_copy
from mission.log.errors import LogError
from mission.log.reader import Flight, read_flight, stream_log
from mission.log.records import VisionEntry
from mission.records import ControlTick
from mission.replay.differences import Differences, Tolerance, estimate_differences, setpoint_differences
from mission.replay.pairing import frame_of, moments_of
from mission.replay.replay import Replay, differences, replay, write_reference
from mission.replay.report import print_differences
from tests.log.synthetic_flight import fly, write_log
from tests.replay.golden import GOLDEN
from tests.replay.own_estimates import replay_own_estimates
from tests.support.command_line import lineflight
from tests.support.damaged_log import damage_chunks, write_in_chunks
from vision.records import LineEstimate

REPORTS = channels.CHANNEL_OF[VisionEntry].topic


@pytest.fixture(scope="module")
def golden() -> Flight:
    return read_flight(GOLDEN)


@pytest.fixture(scope="module")
def replayed(golden: Flight) -> Replay:
    return replay(golden)


def test_today_the_golden_flight_is_what_it_was(golden: Flight, replayed: Replay) -> None:
    found = differences(golden, replayed)
    assert found.is_reference
    assert found.estimates.n == len(golden.image_times_ns) > 50
    assert found.setpoints.n > 300
    assert found.beyond(Tolerance()) == ()


def test_on_one_computer_two_replays_are_the_same_to_the_bit(golden: Flight, replayed: Replay) -> None:
    again = replay(golden)
    assert [report.estimate for report in again.reports] == [report.estimate for report in replayed.reports]
    assert again.ticks == replayed.ticks


def test_with_the_flights_own_estimates_every_setpoint_is_the_same_to_the_bit(golden: Flight) -> None:
    """Guidance alone: no tick is paired with another task, state or report than its own."""
    ticks = replay_own_estimates(golden)
    assert len(ticks) > 300
    assert {tick.task for tick in ticks} == {"takeoff", "ascend", "move_until", "align", "follow_lines"}
    assert [tick.t_ns for tick in ticks if tick.replayed != tick.flown] == []


@pytest.mark.parametrize("latency_ms", [0, 400])
def test_a_tick_uses_the_reports_that_it_took_whatever_their_latency_says(tmp_path: Path, latency_ms: int) -> None:
    """Over MAVLink a report is on its way for a while after vision made it, and may come a tick later."""

    def change(topic: str, _: int, data: bytes) -> bytes:
        if topic != REPORTS:
            return data
        return channels.encode(replace(channels.decode(topic, data), latency_ns=latency_ms * 1_000_000))

    write_copy(GOLDEN, tmp_path / "late.mcap", [], lambda _: None, change)
    ticks = replay_own_estimates(read_flight(tmp_path / "late.mcap"))
    assert len(ticks) > 300
    assert [tick.t_ns for tick in ticks if tick.replayed != tick.flown] == []


def test_two_frames_of_one_time_are_told_apart(golden: Flight, tmp_path: Path) -> None:
    """A computer under load stamps two frames with one time: each tick has its own of them all the same."""
    told = [moment for moment in moments_of(golden).moments if moment.reports]
    first, second = told[20].reports[0], told[21].reports[0]

    def change(topic: str, _: int, data: bytes) -> bytes:
        if topic != REPORTS or channels.decode(topic, data).seq != second.seq:
            return data
        return channels.encode(replace(channels.decode(topic, data), t_ns=first.t_capture_ns))

    write_copy(GOLDEN, tmp_path / "twice.mcap", [], lambda _: None, change)
    again = [moment for moment in moments_of(read_flight(tmp_path / "twice.mcap")).moments if moment.reports]
    assert [[r.seq for r in moment.reports] for moment in again] == [[r.seq for r in moment.reports] for moment in told]
    assert again[21].reports[0].t_capture_ns == first.t_capture_ns


def test_a_log_that_was_sorted_by_time_is_paired_by_time_and_says_so(golden: Flight, tmp_path: Path) -> None:
    kinds = (ControlTick, VehicleState, VisionEntry)
    records = [(t_ns, record) for _, t_ns, record in stream_log(GOLDEN) if isinstance(record, kinds)]
    topics = {channels.CHANNEL_OF[kind].topic for kind in kinds}
    write_copy(
        GOLDEN,
        tmp_path / "sorted.mcap",
        sorted(records, key=lambda record: record[0]),
        lambda _: None,
        lambda topic, _, data: None if topic in topics else data,
    )
    paired = moments_of(read_flight(tmp_path / "sorted.mcap"))
    assert moments_of(golden).is_by_order
    assert not paired.is_by_order
    # In virtual time a report is there as soon as it is made: its latency tells all.
    assert all(tick.replayed == tick.flown for tick in replay_own_estimates(golden, paired))
    shown = lineflight("replay", tmp_path / "sorted.mcap")
    assert "The log was sorted by time since it was flown" in " ".join(shown.out.split())


def test_the_replay_is_near_to_what_was_flown(golden: Flight, replayed: Replay) -> None:
    bare = replace(golden, reference_estimates=(), reference_setpoints=())
    found = differences(bare, replayed)
    assert not found.is_reference
    assert found.setpoints.distance_m is not None
    assert found.setpoints.distance_m.p95 < 0.01  # JPEG is what the frames have gone through since
    assert found.estimates.angle_deg is not None
    assert found.estimates.angle_deg.p95 < 0.1


def test_a_reference_of_which_nothing_is_left_does_not_pass(golden: Flight, replayed: Replay) -> None:
    (words,) = differences(golden, Replay((), (), is_by_order=True)).beyond(Tolerance())
    assert "nothing of the reference is left" in words
    half = replace(replayed, ticks=replayed.ticks[::2])
    found = differences(golden, half).beyond(Tolerance())
    assert any("setpoints of the reference are not sent now" in words for words in found)


def test_vision_that_has_changed_is_told(golden: Flight, replayed: Replay) -> None:
    turned = tuple(
        report
        if report.estimate is None
        else replace(report, estimate=replace(report.estimate, angle_rad=report.estimate.angle_rad + 0.01))
        for report in replayed.reports
    )
    (words,) = differences(golden, replace(replayed, reports=turned)).beyond(Tolerance())
    assert "angles differ by up to 0.573 degrees" in words


def estimate(angle_rad: float, offset_px: float) -> LineEstimate:
    return LineEstimate(angle_rad, offset_px, 3, None, 1.0, 0)


def test_a_line_seen_the_other_way_round_is_the_same_line() -> None:
    found = estimate_differences({0: estimate(math.pi / 2, 7.0)}, {0: estimate(0.001 - math.pi / 2, -7.0)})
    assert found.angle_deg is not None
    assert found.angle_deg.max == pytest.approx(math.degrees(0.001))
    assert found.offset_px is not None
    assert found.offset_px.max == 0.0


def test_lines_that_come_and_go_are_counted() -> None:
    now = {0: estimate(0.0, 0.0), 1: None, 2: None, 3: estimate(0.0, 0.0)}
    then = {0: None, 1: estimate(0.0, 0.0), 2: None, 4: None}
    found = estimate_differences(now, then)
    assert (found.n, found.n_same, found.n_only_now, found.n_only_then) == (3, 1, 1, 1)
    assert found.angle_deg is None
    assert setpoint_differences([]).distance_m is None


def test_the_command_replays_and_says_so(tmp_path: Path) -> None:
    ran = lineflight("replay", GOLDEN, "--json")
    assert ran.code == 0, ran.err
    assert json.loads(ran.out)["beyond"] == []
    shown = lineflight("replay", GOLDEN)
    assert "held against the reference in the log" in shown.out
    assert "the same, within the tolerance of 5 mm, 0.05 degrees and 0.25 px (p95)" in shown.out
    assert all(line == line.rstrip() for line in shown.out.splitlines())


def test_the_command_ends_with_6_where_the_reference_is_another(replayed: Replay, tmp_path: Path) -> None:
    reports = tuple(
        replace(r, estimate=None if r.estimate is None else replace(r.estimate, offset_px=r.estimate.offset_px + 5.0))
        for r in replayed.reports
    )
    bare = tmp_path / "bare.mcap"
    strip_reference(GOLDEN, bare)
    write_reference(
        read_flight(bare), Replay(reports, replayed.ticks, is_by_order=True), tmp_path / "moved.mcap", lambda _: None
    )
    ran = lineflight("replay", tmp_path / "moved.mcap")
    assert ran.code == EXIT_DIFFERENT
    assert "offsets differ by up to 5 px" in ran.out


def test_what_cannot_be_replayed_is_refused_in_a_sentence(tmp_path: Path) -> None:
    write_log(tmp_path / "synthetic.mcap", list(fly()))
    ran = lineflight("replay", tmp_path / "synthetic.mcap")
    assert (ran.code, ran.err.count("\n")) == (EXIT_BAD_INPUT, 1)
    assert "does not tell its camera" in ran.err
    again = lineflight("replay", GOLDEN, "--write", tmp_path / "golden.mcap")
    assert again.code == EXIT_BAD_INPUT
    assert "holds a reference already" in again.err
    bare = tmp_path / "bare.mcap"
    strip_reference(GOLDEN, bare)
    there = lineflight("replay", bare, "--write", bare)
    assert there.code == EXIT_BAD_INPUT
    assert "exists already" in there.err


def test_a_tick_before_a_hole_sees_nothing_of_what_comes_after_it(golden: Flight, tmp_path: Path) -> None:
    small, holed = tmp_path / "small.mcap", tmp_path / "holed.mcap"
    write_in_chunks(GOLDEN, small, 20_000)
    assert damage_chunks(small, holed, lambda number, _: number > 5 and number % 3 == 0) > 5
    flight = read_flight(holed)
    whole = {moment.tick.t_ns: moment for moment in moments_of(golden).moments}
    moments = moments_of(flight).moments
    assert len(moments) < len(whole)
    for moment in moments:
        before = whole[moment.tick.t_ns]
        assert moment.state in (None, before.state)
        assert {frame_of(report) for report in moment.reports} <= {frame_of(report) for report in before.reports}


def test_a_damaged_reference_says_what_its_verdict_is_worth(tmp_path: Path) -> None:
    small, holed = tmp_path / "small.mcap", tmp_path / "holed.mcap"
    write_in_chunks(GOLDEN, small, 100_000)
    assert damage_chunks(small, holed, lambda number, _: number == 5) == 1
    ran = lineflight("replay", holed)
    assert "are missing" in ran.err
    assert "The log is damaged: what came before a hole is not remembered" in ran.out


def test_a_damaged_log_is_refused_for_what_it_lost(golden: Flight) -> None:
    damage = Damage(1, 2, (), is_all_known=True, n_nameless=0)
    lost = replace(golden, mission=replace(golden.mission, text=""), attachments={}, damage=damage)
    with pytest.raises(LogError, match=r"The mission file in the log .* is damaged; it cannot be replayed"):
        replay(lost)
    with pytest.raises(LogError, match=r"holds no frames: there"):
        replay(replace(golden, image_times_ns=frozenset(), damage=damage))
    with pytest.raises(LogError, match=r"holds no frames \(vision.log_rate_hz was 0\)"):
        replay(replace(golden, image_times_ns=frozenset()))


def test_a_reference_that_was_written_is_named(tmp_path: Path) -> None:
    bare, out = tmp_path / "bare.mcap", tmp_path / "ref.mcap"
    strip_reference(GOLDEN, bare)
    ran = lineflight("replay", bare, "--write", out)
    assert ran.code == 0
    assert ran.err == f"reference  {out} ({out.stat().st_size / 1e6:.1f} MB)\n"
    assert " at most at " in ran.out


def test_sizes_are_told_with_a_floor() -> None:
    moved = Setpoint(0.00002, 0.0, 0.0, 0.0), Setpoint(0.0, 0.0, 0.0, 0.0)
    text = StringIO()
    setpoints = setpoint_differences([moved], times_s=[7.25])
    found = Differences(False, True, estimate_differences({}, {}), setpoints)
    print_differences(found, (), Tolerance(), Console(file=text))
    assert "differs by under 0.1 mm median, under 0.1 mm p95, under 0.1 mm at most at 7.2 s" in text.getvalue()


def strip_reference(log: Path, out: Path) -> None:
    """A log without its reference."""
    write_copy(log, out, [], lambda _: None, lambda topic, _, data: None if topic.startswith("/replayed/") else data)
