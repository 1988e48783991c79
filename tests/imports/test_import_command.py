"""`lineflight import`, end to end: a flight's own log and the autopilot's, with clocks whose truth is known."""

import lzma
import random
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from mission.imports.align import ClockMap
from mission.imports.boot_clock import boot_clock
from mission.imports.open import digest
from mission.log.damage import CUT_OFF
from mission.log.imported import Imported, ImportedState
from mission.log.reader import find_flaws, read_flight
from mission.log.summary import summarise
from mission.records import ClockSync
from tests.imports.flown import LATENCY_S, Flown, flight_ns, fly, write_ours
from tests.imports.log_files import DATAFLASH_SHIFT_M, write_dataflash, write_telemetry, write_ulog
from tests.support.command_line import Ran, lineflight

WRITE: dict[str, Callable[[Path, Flown], None]] = {
    ".ulg": write_ulog,
    ".bin": write_dataflash,
    ".tlog": lambda path, flown: write_telemetry(path, flown.frames),
}


@pytest.fixture(scope="module")
def ours(flown: Flown, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("ours") / "flight.mcap"
    write_ours(path, flown)
    return path


@pytest.fixture(scope="module")
def theirs(flown: Flown, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("theirs") / "log_7.ulg"
    write_ulog(path, flown)
    return path


def imported_by(ran: Ran, out: Path, told: str = "") -> Imported:
    assert ran.code == 0, ran.err
    assert ran.err == told
    assert str(out) in ran.out
    imported = read_flight(out).imported
    assert imported is not None
    return imported


def place(state: ImportedState) -> tuple[float, ...]:
    """A position as a log's 32 bits have it: no two estimates of a noisy sensor are alike."""
    return tuple(float(np.float32(value)) for value in (state.north_m, state.east_m, state.down_m))


def times_off_s(states: tuple[ImportedState, ...], flown: Flown) -> list[float]:
    """How far states are from their true flight time [s]: those whose estimate was noted with the autopilot's time."""
    boot_ns = {place(state): state.t_ns for state in flown.estimates}
    off_s = [(state.t_ns - flight_ns(boot_ns[place(state)] / 1e9)) / 1e9 for state in states if place(state) in boot_ns]
    assert len(off_s) > 200
    return off_s


@pytest.mark.parametrize("ending", WRITE)
def test_the_time_sync_puts_every_kind_of_log_where_it_belongs(
    flown: Flown, ours: Path, tmp_path: Path, ending: str
) -> None:
    log, out = tmp_path / f"theirs{ending}", tmp_path / "both.mcap"
    WRITE[ending](log, flown)
    ran = lineflight("import", ours, log, "--out", out)
    imported = imported_by(ran, out)
    assert imported.log.aligned_by == "time_sync"
    assert imported.log.sha256 == digest(log)
    assert imported.log.file == log.name
    assert imported.log.correlation > 0.999
    assert imported.log.position_rms_m < 0.05
    assert imported.log.drift_ppm == pytest.approx(40.0, abs=2.0)
    assert imported.log.telemetry_lag_s == pytest.approx(LATENCY_S, abs=0.01)
    assert f"{imported.log.correlation:.3f}" in ran.out
    if ending == ".bin":
        assert imported.log.shift_ned_m == pytest.approx(DATAFLASH_SHIFT_M, abs=0.05)
        assert "moved by +0.40 m north" in ran.out
    else:
        assert imported.log.shift_ned_m == (0.0, 0.0, 0.0)
        assert max(map(abs, times_off_s(imported.states, flown))) < 0.005
    for state in imported.states[::50]:  # in our frame, too
        nearest = min(flown.states, key=lambda each: abs(each.t_ns - LATENCY_S * 1e9 - state.t_ns))
        assert state.east_m == pytest.approx(nearest.east_m, abs=0.25)
    assert imported.setpoints
    assert imported.modes


def test_motion_alone_finds_the_clock(flown: Flown, theirs: Path, tmp_path: Path) -> None:
    """Our states are stamped when they arrived, and so the autopilot's come to lie where these are."""
    ours, out = tmp_path / "flight.mcap", tmp_path / "flight-with-autopilot.mcap"
    write_ours(ours, flown, with_syncs=False, with_boot=False)
    imported = imported_by(lineflight("import", ours, theirs), out)
    assert imported.log.aligned_by == "motion"
    assert imported.log.telemetry_lag_s is None
    late_s = times_off_s(imported.states, flown)
    assert min(late_s) > LATENCY_S - 0.01
    assert max(late_s) < LATENCY_S + 0.01


def test_boot_times_of_telemetry_do_where_no_sync_is(flown: Flown, theirs: Path, tmp_path: Path) -> None:
    ours = tmp_path / "flight.mcap"
    write_ours(ours, flown, with_syncs=False)
    imported = imported_by(lineflight("import", ours, theirs), tmp_path / "flight-with-autopilot.mcap")
    assert imported.log.aligned_by == "boot_times"
    assert max(abs(off_s - LATENCY_S) for off_s in times_off_s(imported.states, flown)) < 0.005


def contents(path: Path) -> tuple[list[object], ...]:
    """All that a log holds beside what was imported: messages, attachments, metadata, header."""
    with path.open("rb") as file:
        reader = make_reader(file)
        messages = [
            (
                *(channel.topic, channel.message_encoding, tuple(sorted(channel.metadata.items()))),
                *((schema.name, schema.encoding, schema.data) if schema else ()),
                *(message.log_time, message.publish_time, message.sequence, message.data),
            )
            for schema, channel, message in reader.iter_messages(log_time_order=False)
            if not channel.topic.startswith("/imported/")
        ]
        attachments = [(a.name, a.media_type, a.create_time, a.log_time, a.data) for a in reader.iter_attachments()]
        metadata = [(m.name, m.metadata) for m in reader.iter_metadata()]
        header = reader.get_header()
        return messages, attachments, metadata, [header.profile]


def test_our_own_log_is_in_the_new_one_whole(ours: Path, theirs: Path, tmp_path: Path) -> None:
    out = tmp_path / "both.mcap"
    before = ours.read_bytes()
    imported_by(lineflight("import", ours, theirs, "--out", out), out)
    assert contents(out) == contents(ours)
    assert len(contents(ours)[0]) > 5_000
    assert ours.read_bytes() == before
    old, new = read_flight(ours), read_flight(out)
    assert replace(new, path=ours, imported=None) == old
    assert summarise(new) == summarise(old)
    assert [file.name for file in tmp_path.iterdir()] == ["both.mcap"]
    with out.open("rb") as file:
        times = [message.log_time for _, _, message in make_reader(file).iter_messages(["/imported/state"])]
    assert times == [state.t_ns + new.mission.unix_minus_flight_ns for state in new.imported.states]


def test_a_log_of_ours_that_was_cut_off_stays_one(ours: Path, theirs: Path, tmp_path: Path) -> None:
    """The companion lost its power: the autopilot's log goes on, and the copy must not look complete."""
    cut = tmp_path / "cut.mcap"
    data = ours.read_bytes()
    cut.write_bytes(data[: int(len(data) * 0.7)])
    out = tmp_path / "cut-with-autopilot.mcap"
    told = f"{cut}: {CUT_OFF}\n"
    imported = imported_by(lineflight("import", cut, theirs), out, told)
    assert find_flaws(out).is_cut_off
    flight = read_flight(out)
    assert flight.is_truncated
    assert flight.states == read_flight(cut).states
    assert imported.states[-1].t_ns > flight.states[-1].t_ns + 5 * 10**9
    assert flight.end_ns == read_flight(cut).end_ns


def test_a_packed_log_that_was_cut_is_imported_and_the_cut_said(flown: Flown, ours: Path, tmp_path: Path) -> None:
    write_telemetry(tmp_path / "whole.tlog", flown.frames)
    packed = lzma.compress((tmp_path / "whole.tlog").read_bytes(), preset=0)
    cut = tmp_path / "cut.tlog.xz"
    cut.write_bytes(packed[: int(0.9 * len(packed))])
    ran = lineflight("import", ours, cut, "--out", tmp_path / "out.mcap")
    assert ran.code == 0, ran.err
    assert ran.err == f"{cut} breaks off; what there is of it was imported.\n"
    imported = read_flight(tmp_path / "out.mcap").imported
    assert imported is not None
    assert len(imported.states) > 100


def test_what_exists_is_not_overwritten(ours: Path, theirs: Path, tmp_path: Path) -> None:
    out = tmp_path / "there.mcap"
    out.write_bytes(b"mine")
    ran = lineflight("import", ours, theirs, "--out", out)
    assert ran.code == 2
    assert "exists already" in ran.err
    assert out.read_bytes() == b"mine"


def test_a_log_that_was_imported_into_is_refused(ours: Path, theirs: Path, tmp_path: Path) -> None:
    out = tmp_path / "both.mcap"
    assert lineflight("import", ours, theirs, "--out", out).code == 0
    ran = lineflight("import", out, theirs, "--out", tmp_path / "again.mcap")
    assert ran.code == 2
    assert "holds the autopilot's log log_7.ulg already" in ran.err


def test_a_place_that_cannot_be_written_is_exit_1(ours: Path, theirs: Path, tmp_path: Path) -> None:
    ran = lineflight("import", ours, theirs, "--out", tmp_path / "none" / "both.mcap")
    assert ran.code == 1
    assert "cannot be written" in ran.err
    assert "Traceback" not in ran.err


def test_positions_of_another_origin_are_said_and_left(flown: Flown, ours: Path, tmp_path: Path) -> None:
    log, out = tmp_path / "moved.ulg", tmp_path / "both.mcap"
    write_ulog(log, replace(flown, estimates=[replace(state, north_m=state.north_m + 3) for state in flown.estimates]))
    ran = lineflight("import", ours, log, "--out", out)
    assert ran.code == 0
    assert "3.0 m away from ours" in ran.err
    imported = read_flight(out).imported
    assert imported is not None
    assert imported.log.shift_ned_m == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("with_clock", [True, False])
def test_another_flight_of_the_same_mission_is_refused(flown: Flown, tmp_path: Path, with_clock: bool) -> None:
    """The same commands at the same times after boot, in other gusts."""
    ours, log = tmp_path / "flight.mcap", tmp_path / "other.ulg"
    write_ours(ours, flown, with_syncs=with_clock, with_boot=with_clock)
    write_ulog(log, fly(seed=8))
    ran = lineflight("import", ours, log)
    assert ran.code == 2
    assert "cannot be laid beside" in ran.err
    assert "flights" in ran.err
    assert len(ran.err.splitlines()) == 1
    assert not (tmp_path / "flight-with-autopilot.mcap").exists()


def test_bad_logs_end_in_a_sentence_and_write_nothing(ours: Path, theirs: Path, tmp_path: Path) -> None:
    bad = {
        "empty.ulg": b"",
        "noise.ulg": random.Random(1).randbytes(5_000),
        "noise.bin": random.Random(2).randbytes(5_000),
        "noise.tlog": random.Random(3).randbytes(5_000),
        "noise.tlog.xz": random.Random(4).randbytes(5_000),
        "cut.ulg": theirs.read_bytes()[:900],
        "notes.txt": b"text",
    }
    for name, content in bad.items():
        (tmp_path / name).write_bytes(content)
        ran = lineflight("import", ours, tmp_path / name, "--out", tmp_path / "out.mcap")
        assert ran.code == 2, name
        assert len(ran.err.splitlines()) == 1, ran.err
        assert name in ran.err
        assert ran.err.rstrip().endswith(".")
    for log in ("none.mcap", theirs):
        assert lineflight("import", log, theirs, "--out", tmp_path / "out.mcap").code == 2
    assert not (tmp_path / "out.mcap").exists()


def test_a_slow_answer_does_not_bend_the_clock() -> None:
    """A minute of syncs, each tenth of which took 200 ms one way."""
    syncs = [
        ClockSync(
            at * 10**9,
            -(10**12) + 20_000 * at + (90_000_000 if at % 10 == 0 else 0),
            190_000_000 if at % 10 == 0 else 8_000_000,
        )
        for at in range(100)
    ]
    known = boot_clock([], syncs)
    assert known is not None
    assert known.is_synced
    for at in (0, 50, 99):
        boot_ns = at * 10**9 - 10**12 + 20_000 * at
        assert known.clock.ours_ns(boot_ns) == pytest.approx(at * 10**9, abs=100_000)


def test_a_restarted_autopilot_has_no_one_boot_clock() -> None:
    syncs = [ClockSync(at * 10**9, -(10**12) if at < 50 else -(2 * 10**12), 8_000_000) for at in range(100)]
    assert boot_clock([], syncs) is None
    assert boot_clock([], []) is None


def test_a_short_flight_has_no_drift() -> None:
    known = boot_clock([], [ClockSync(at * 10**9, -(10**12) + 1_000 * at, 8_000_000) for at in range(20)])
    assert known is not None
    assert known.clock == ClockMap(known.clock.offset_s, 0.0, known.clock.reference_s)
