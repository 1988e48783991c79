"""What is recorded is read back: every record type, damaged and cut files, and disks that fail."""

import hashlib
import math
import os
import random
import subprocess
import sys
import time
from dataclasses import fields, replace
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import Writer

from drivers.clock import NS_PER_S
from drivers.mcap_stream import McapFile
from mission.autopilot import Setpoint, VehicleState
from mission.log import channels
from mission.log.backlog import Backlog
from mission.log.copying import Copier
from mission.log.disk import log_path
from mission.log.errors import LogError
from mission.log.imported import (
    ImportedActuators,
    ImportedLog,
    ImportedMode,
    ImportedPower,
    ImportedSetpoint,
    ImportedState,
    ImportedText,
)
from mission.log.reader import Flight, read_flight
from mission.log.recorder import Recorder
from mission.log.records import LogHealth, SentSetpoint, StatusText
from mission.records import (
    AutopilotTarget,
    ClockSync,
    ControlTick,
    Event,
    LineFix,
    MissionEnded,
    Origin,
    PreflightCheck,
    Severity,
    TaskEnded,
    TaskStarted,
    TruePose,
)
from mission.safety import Hazard, Reaction
from tests.log import synthetic_flight
from tests.log.synthetic_flight import (
    LINE,
    MISSION_TEXT,
    ORIGIN,
    PARAMETERS,
    START,
    START_NS,
    TICK_NS,
    FixedClock,
    fly,
    put_down,
    write_log,
)
from vision.records import VisionReport

DEADLINE_S = 60.0


@pytest.fixture(scope="module")
def flown() -> list[tuple[int, object]]:
    return list(fly())


@pytest.fixture(scope="module")
def log(flown: list[tuple[int, object]], tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("logs") / "flight.mcap"
    assert write_log(path, flown).failure is None
    return path


def of_type(flown: list[tuple[int, object]], kind: type) -> tuple[object, ...]:
    return tuple(item for _, item in flown if type(item) is kind)


def test_every_record_comes_back_as_it_was(flown: list[tuple[int, object]], log: Path) -> None:
    flight = read_flight(log)
    assert flight.states == of_type(flown, VehicleState)
    assert flight.tasks_started == of_type(flown, TaskStarted)
    assert flight.tasks_ended == of_type(flown, TaskEnded)
    assert (flight.mission_ended,) == of_type(flown, MissionEnded)
    assert flight.events == of_type(flown, Event)
    assert flight.fixes == of_type(flown, LineFix)
    assert flight.truth == of_type(flown, TruePose)
    assert flight.ticks == of_type(flown, ControlTick)
    assert flight.syncs == of_type(flown, ClockSync)
    assert flight.origin == ORIGIN
    assert flight.start == START
    assert flight.attachments == {PARAMETERS.name: PARAMETERS.data}
    assert set(flight.targets) < set(of_type(flown, AutopilotTarget))  # thinned to 10 Hz
    assert len(flight.targets) == pytest.approx(len(of_type(flown, AutopilotTarget)) / 2, rel=0.05)
    assert flight.line == LINE
    sent = [(t_ns, item) for t_ns, item in flown if isinstance(item, Setpoint)]
    assert flight.setpoints == tuple(SentSetpoint(t, s.north_m, s.east_m, s.down_m, s.yaw_rad) for t, s in sent)
    assert not flight.is_truncated


def test_vision_reports_come_back_with_their_images_when_asked(flown: list[tuple[int, object]], log: Path) -> None:
    reported = [item for _, item in flown if isinstance(item, VisionReport)]
    assert sum(report.jpeg is not None for report in reported) > 10
    for with_images in (False, True):
        reports = read_flight(log, with_images=with_images).reports
        for before, after in zip(reported, reports, strict=True):
            np.testing.assert_allclose(after.power_lines, before.power_lines, atol=0.005)
            assert not after.power_lines.flags.writeable
            for field in fields(VisionReport):
                if field.name not in ("power_lines", "jpeg"):
                    assert getattr(after, field.name) == getattr(before, field.name)
            assert after.jpeg == (before.jpeg if with_images else None)


def test_the_mission_file_and_the_metadata_are_in_the_log(log: Path) -> None:
    mission = read_flight(log).mission
    assert (mission.name, mission.text, mission.start_ns) == ("follow_line", MISSION_TEXT, START_NS)
    assert mission.sha256 == hashlib.sha256(MISSION_TEXT.encode()).hexdigest()
    assert mission.metadata == {"vehicle": "none"}


def test_log_time_is_unix_time(tmp_path: Path) -> None:
    before_ns = time.time_ns()
    write_log(tmp_path / "a.mcap", [(START_NS, Event(START_NS + 5, "x", Severity.INFO, "y"))])
    with (tmp_path / "a.mcap").open("rb") as file:
        (time_ns,) = (message.log_time for _, _, message in make_reader(file).iter_messages(["/event"]))
    assert before_ns < time_ns < time.time_ns() + NS_PER_S


def test_the_log_holds_the_channels_of_the_table_with_their_schemas(log: Path) -> None:
    with log.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    found = {channel.topic: summary.schemas[channel.schema_id] for channel in summary.channels.values()}
    imported = {
        channel.topic for channel in channels.RECORD_CHANNELS if channel.topic.startswith(("/imported/", "/replayed/"))
    }
    unused = {"/status_text", "/preflight/check", *imported}
    for channel in channels.RECORD_CHANNELS:
        if channel.topic not in unused:
            assert found[channel.topic].encoding == "jsonschema"
            assert found[channel.topic].name == f"lineflight.{channel.record.__name__}"
    for viewer_channel in channels.FOXGLOVE_CHANNELS:
        assert found[viewer_channel.topic].name == viewer_channel.schema
    assert len(found) == len(channels.RECORD_CHANNELS) + len(channels.FOXGLOVE_CHANNELS) - len(unused)


def test_units_stand_in_the_schema() -> None:
    properties = channels.json_schema(VehicleState)["properties"]
    assert {"t_ns", "north_m", "v_down_m_s", "yaw_rad", "is_armed"} <= properties.keys()


st.register_type_strategy(float, st.floats(allow_nan=False, allow_infinity=False))


@given(
    st.builds(VehicleState)
    | st.builds(TaskEnded)
    | st.builds(Event)
    | st.builds(StatusText)
    | st.builds(TruePose)
    | st.builds(LineFix)
    | st.builds(PreflightCheck)
    | st.builds(ControlTick)
    | st.builds(Origin)
    | st.builds(LogHealth)
    | st.builds(ImportedLog)
    | st.builds(ImportedState)
    | st.builds(ImportedSetpoint)
    | st.builds(ImportedActuators)
    | st.builds(ImportedPower)
    | st.builds(ImportedText)
    | st.builds(ImportedMode)
)
def test_any_record_survives_json(record: object) -> None:
    topic = channels.CHANNEL_OF[type(record)].topic
    assert channels.decode(topic, channels.encode(record)) == record


@settings(max_examples=30)
@given(st.integers(10, 200), st.floats(0.0, 0.2), st.integers(0, 10_000))
def test_a_rate_limit_keeps_the_rate_whatever_comes(source_hz: int, jitter: float, seed: int) -> None:
    draw = random.Random(seed)  # hypothesis' own would swing from one extreme to the other: that is no jitter
    limit = channels.RateLimit(20.0)
    period_ns = NS_PER_S // source_hz
    times_ns = [tick * period_ns + round(draw.uniform(-jitter, jitter) * period_ns) for tick in range(10 * source_hz)]
    kept = sum(limit.admits(t_ns) for t_ns in times_ns)
    assert kept <= 10 * 20 + 2
    assert kept >= 10 * min(20, source_hz) * 0.95


def test_true_poses_are_thinned(tmp_path: Path) -> None:
    poses = [(0, TruePose(START_NS + tick * NS_PER_S // 100, 0.0, 0.0, 0.0, 0.0)) for tick in range(1_000)]
    write_log(tmp_path / "a.mcap", poses)
    assert len(read_flight(tmp_path / "a.mcap").truth) == pytest.approx(200, abs=1)


def check_is_beginning(part: Flight, whole: Flight) -> None:
    assert part.is_truncated
    for field in ("states", "setpoints", "tasks_started", "tasks_ended", "events", "truth"):
        records = getattr(part, field)
        assert records == getattr(whole, field)[: len(records)]


def test_a_log_cut_anywhere_is_read_up_to_the_cut(log: Path, tmp_path: Path) -> None:
    whole, data = read_flight(log), log.read_bytes()
    part_path = tmp_path / "part.mcap"
    n_states = []
    for length in np.linspace(len(data) - 1, 9, 40).astype(int).tolist():
        part_path.write_bytes(data[:length])
        try:
            part = read_flight(part_path, with_images=True)
        except LogError as error:
            assert "cut off at its very start" in str(error)  # noqa: PT017
            n_states.append(0)
            continue
        check_is_beginning(part, whole)
        n_states.append(len(part.states))
    assert n_states == sorted(n_states, reverse=True)
    assert n_states[0] == len(whole.states)
    assert len(set(n_states)) > 10


WRITE_FOREVER = """
import threading
from pathlib import Path
import sys
from tests.log.synthetic_flight import *
records = list(fly(image_period_s=1.0))[:1000]
recorder = Recorder(Path(sys.argv[1]), mission_text=MISSION_TEXT, mission_name="m", metadata={}, clock=FixedClock())
recorder.__enter__()
for t_ns, item in records:
    put_down(recorder, t_ns, item)
threading.Event().wait()
"""


def child_environment() -> dict[str, str]:
    root = Path(synthetic_flight.__file__).parents[2]
    return {**os.environ, "PYTHONPATH": str(root)}


def test_a_killed_program_leaves_what_it_recorded(flown: list[tuple[int, object]], tmp_path: Path) -> None:
    path = tmp_path / "killed.mcap"
    expected = of_type(flown[:1000], VehicleState)
    with subprocess.Popen([sys.executable, "-c", WRITE_FOREVER, str(path)], env=child_environment()) as writer:
        deadline_s = time.monotonic() + DEADLINE_S
        n_read = 0
        # The program never closes its log: what can be read has been flushed while it ran.
        while n_read < len(expected) and time.monotonic() < deadline_s and writer.poll() is None:
            try:
                n_read = len(read_flight(path).states)
            except LogError:
                n_read = 0
        writer.kill()
    flight = read_flight(path, with_images=True)
    assert flight.states == expected
    assert flight.is_truncated
    assert flight.mission_ended is None
    assert any(report.jpeg for report in flight.reports)


FILL_THE_DISK = """
import resource
from pathlib import Path
import sys
import random
from tests.log.synthetic_flight import *
records = list(fly(image_period_s=1.0))
resource.setrlimit(resource.RLIMIT_FSIZE, (400_000, 400_000))
recorder = write_log(Path(sys.argv[1]), records)
print(recorder.failure)
"""


def test_a_full_disk_is_a_failure_to_look_at_and_no_exception(tmp_path: Path) -> None:
    path = tmp_path / "full.mcap"
    command = [sys.executable, "-W", "error", "-c", FILL_THE_DISK, str(path)]
    done = subprocess.run(command, env=child_environment(), capture_output=True, text=True, check=True)
    assert f"The log {path} cannot be written any more" in done.stdout
    assert done.stderr == ""
    flight = read_flight(path)
    assert flight.is_truncated
    assert 0 < len(flight.states) < 2_000


NO_ROOM = """
import resource, sys
from pathlib import Path
from mission.log.errors import LogError
from mission.log.recorder import Recorder
resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))
try:
    Recorder(Path(sys.argv[1]), mission_text="", mission_name="m", metadata={}).__enter__()
except LogError as error:
    print(error)
"""


def test_a_disk_that_takes_nothing_is_refused_before_the_flight(tmp_path: Path) -> None:
    path = tmp_path / "none.mcap"
    command = [sys.executable, "-W", "error", "-c", NO_ROOM, str(path)]
    done = subprocess.run(command, env=child_environment(), capture_output=True, text=True, check=True)
    assert done.stdout.startswith(f"The log {path} cannot be written any more (File too large)")
    assert done.stdout.endswith("Name a folder on another disk.\n")


def test_a_record_that_cannot_be_logged_is_a_failure_and_the_rest_is_kept(tmp_path: Path) -> None:
    event = Event(START_NS, "x", Severity.INFO, "y")
    recorder = write_log(tmp_path / "a.mcap", [(0, object()), (0, event)])
    assert recorder.failure is not None
    assert "object" in recorder.failure
    assert read_flight(tmp_path / "a.mcap").events == (event,)


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_number_that_json_lacks_is_a_failure_and_the_rest_can_be_read(tmp_path: Path, value: float) -> None:
    event = Event(START_NS, "x", Severity.INFO, "y")
    recorder = write_log(tmp_path / "a.mcap", [(0, TruePose(START_NS, value, 0.0, 0.0, 0.0)), (0, event)])
    assert recorder.failure is not None
    assert "lacks a TruePose that it could not encode (its north_m is no finite number)" in recorder.failure
    assert read_flight(tmp_path / "a.mcap").events == (event,)


def test_names_from_an_enum_are_logged_as_their_words(tmp_path: Path) -> None:
    event = Event(START_NS, Hazard.LINE_LOST, Severity.WARNING, "No line for 2 s.", Reaction.LAND)
    assert write_log(tmp_path / "a.mcap", [(0, event)]).failure is None
    (read,) = read_flight(tmp_path / "a.mcap").events
    assert (type(read.name), read.name, read.reaction) == (str, str(Hazard.LINE_LOST), str(Reaction.LAND))


def test_a_log_that_exists_or_cannot_be_made_is_refused_before_the_flight(tmp_path: Path) -> None:
    (tmp_path / "there.mcap").touch()
    (tmp_path / "file").touch()
    for path in (tmp_path / "there.mcap", tmp_path / "file" / "a.mcap"):
        with pytest.raises(LogError, match="cannot be made"):
            write_log(path, [])


def test_a_slow_disk_costs_images_before_data(flown: list[tuple[int, object]]) -> None:
    (report,) = [item for _, item in flown if isinstance(item, VisionReport) and item.jpeg][:1]
    backlog = Backlog(max_records=10, max_images=2)
    for _ in range(12):
        backlog.put(report)
    taken = backlog.take(0.0)
    assert taken is not None
    assert taken[:2] == [report, report]
    assert [(kept.seq, kept.jpeg) for kept in taken[2:]] == [(report.seq, None)] * 8
    assert (backlog.n_dropped_images, backlog.n_dropped_records) == (8, 2)
    backlog.put(report)
    backlog.close()
    backlog.put(report)
    assert [backlog.take(0.0), backlog.take(0.0)] == [[report], None]
    assert backlog.n_dropped_records == 3


def test_status_texts_and_setpoints_take_their_time_from_the_caller(tmp_path: Path) -> None:
    with Recorder(tmp_path / "a.mcap", mission_text="", mission_name="m", metadata={}, clock=FixedClock()) as recorder:
        recorder.record_status_text(START_NS + 7, "Armed by external command")
        put_down(recorder, START_NS + TICK_NS, Setpoint(1.0, 2.0, -3.0, 0.5))
    flight = read_flight(tmp_path / "a.mcap")
    assert flight.status_texts == (StatusText(START_NS + 7, "Armed by external command"),)
    assert flight.setpoints == (SentSetpoint(START_NS + TICK_NS, 1.0, 2.0, -3.0, 0.5),)
    assert flight.end_ns == START_NS + TICK_NS


def test_a_log_is_named_after_mission_and_utc_start() -> None:
    start = datetime(2026, 3, 4, 23, 5, 6, tzinfo=timezone(timedelta(hours=-5)))
    assert log_path(Path("logs"), "Follow line/2", start) == Path("logs/Follow-line-2-20260305T040506Z.mcap")
    assert log_path(Path("logs"), "..", start.astimezone(UTC)).name == "mission-20260305T040506Z.mcap"


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "is empty"),
        (b"some text that is no log", "is not an MCAP file"),
        (b"\x89MCAP0\r\n", "holds no mission"),
    ],
)
def test_what_is_no_log_is_refused_in_a_sentence(tmp_path: Path, content: bytes, words: str) -> None:
    (tmp_path / "a.mcap").write_bytes(content)
    with pytest.raises(LogError, match=words):
        read_flight(tmp_path / "a.mcap")


def test_a_missing_log_and_a_folder_are_refused_in_a_sentence(tmp_path: Path) -> None:
    with pytest.raises(LogError, match=r"cannot be read \(No such file"):
        read_flight(tmp_path / "nothing.mcap")
    with pytest.raises(LogError, match="is a folder; name one of the"):
        read_flight(tmp_path)


def test_the_log_tells_at_its_end_how_it_did_as_a_whole(
    flown: list[tuple[int, object]], log: Path, tmp_path: Path
) -> None:
    last = read_flight(log).health[-1]
    assert (last.n_waiting, last.n_dropped_images, last.n_dropped_records) == (0, 0, 0)
    assert 0.95 * log.stat().st_size < last.n_bytes < log.stat().st_size
    assert last.t_ns == max(state.t_ns for state in of_type(flown, VehicleState))  # type: ignore[attr-defined]


def test_a_frame_from_the_far_future_makes_no_flight_longer(flown: list[tuple[int, object]], tmp_path: Path) -> None:
    (report,) = [item for _, item in flown if isinstance(item, VisionReport)][:1]
    late = replace(report, t_capture_ns=START_NS + 10**6 * NS_PER_S)
    path = tmp_path / "a.mcap"
    write_log(path, [*flown[:500], (0, late)])
    flight = read_flight(path)
    assert flight.reports[-1].t_capture_ns == late.t_capture_ns
    assert flight.end_ns < START_NS + 100 * NS_PER_S
    assert flight.health[-1].t_ns < START_NS + 100 * NS_PER_S


def test_a_log_copied_behind_itself_says_once_what_it_says_once(log: Path, tmp_path: Path) -> None:
    whole, path = read_flight(log), tmp_path / "twice.mcap"
    later_ns = 1000 * NS_PER_S
    with path.open("wb") as file:
        writer = Writer(file)
        copier = Copier(writer)
        for k in range(2):
            with log.open("rb") as source:
                for record in McapFile(source).records():
                    copier.copy(record, later_ns=k * later_ns)
        writer.finish()
    twice = read_flight(path)
    assert twice.damage is None
    assert len(twice.states) == 2 * len(whole.states)
    assert twice.attachments == whole.attachments
    with path.open("rb") as file:
        summary = make_reader(file, validate_crcs=True).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    assert (summary.statistics.attachment_count, summary.statistics.metadata_count) == (1, 1)
    first_ns, last_ns = summary.statistics.message_start_time, summary.statistics.message_end_time
    assert last_ns - first_ns == later_ns + whole.end_ns - START_NS
