"""Reading ULog, dataflash and telemetry logs: what was written comes back, and damage ends in a sentence."""

import lzma
import os
import random
import struct
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pymavlink.dialects.v20 import all as dialect
from pyulog import ULog

from mission.imports.autopilot_log import AutopilotLog
from mission.imports.errors import AutopilotLogError
from mission.imports.open import digest, read_autopilot_log
from mission.log.imported import (
    ImportedActuators,
    ImportedMode,
    ImportedPower,
    ImportedSetpoint,
    ImportedState,
    ImportedText,
)
from tests.imports.flown import Flown
from tests.imports.log_files import (
    DATAFLASH_SHIFT_M,
    dataflash_head,
    ulog_head,
    write_dataflash,
    write_telemetry,
    write_ulog,
)

WRITE: dict[str, Callable[[Path, Flown], None]] = {
    ".ulg": write_ulog,
    ".bin": write_dataflash,
    ".tlog": lambda path, flown: write_telemetry(path, flown.frames),
}


def read(path: Path) -> AutopilotLog:
    """The one log of a file."""
    (log,) = read_autopilot_log(path, lambda _: None)
    return log


def of_type(log: AutopilotLog, kind: type) -> list:
    return [record for record in log.records if isinstance(record, kind)]


def assert_states(log: AutopilotLog, flown: Flown, shift_m: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> None:
    """The states are the autopilot's estimates, in its own time; at most 20 a second."""
    true_s = np.array([state.t_ns for state in flown.estimates]) / 1e9
    states = log.states
    t_s = np.array([state.t_ns for state in states]) / 1e9
    assert len(states) == pytest.approx(20 * (true_s[-1] - true_s[0]), rel=0.02)
    assert (np.diff(t_s) > 0).all()
    shifts = {"north_m": shift_m[0], "east_m": shift_m[1], "down_m": shift_m[2]}
    for name in ("north_m", "east_m", "down_m", "v_north_m_s", "v_east_m_s", "v_down_m_s", "roll_rad", "pitch_rad"):
        true = np.interp(t_s, true_s, [getattr(state, name) for state in flown.estimates])
        found = np.array([getattr(state, name) for state in states])
        error = np.abs(found + shifts.get(name, 0.0) - true)
        assert error.mean() < 0.005, name
        assert error.max() < 0.15, name  # a touch-down jerks, and position and attitude are sampled apart
    true_yaw = np.interp(t_s, true_s, np.unwrap([state.yaw_rad for state in flown.estimates]))
    error = np.array([state.yaw_rad for state in states]) - true_yaw
    np.testing.assert_allclose((error + np.pi) % (2 * np.pi) - np.pi, 0.0, atol=0.05)


def test_a_ulog_comes_back(flown: Flown, tmp_path: Path) -> None:
    write_ulog(tmp_path / "a.ulg", flown)
    log = read(tmp_path / "a.ulg")
    assert (log.kind, log.version, log.vehicle) == ("ulog", "PX4 v1.16.1", "V5_FMU")
    assert not log.is_damaged
    assert not log.has_own_origin
    assert_states(log, flown)
    assert [(record.t_ns // 1000, record.mode) for record in of_type(log, ImportedMode)] == [
        (t_ns // 1000, mode) for t_ns, mode in flown.modes
    ]
    setpoint = of_type(log, ImportedSetpoint)[0]
    assert setpoint.north_m == pytest.approx(flown.targets[0][1][0], abs=1e-5)
    assert setpoint.v_north_m_s is None
    assert setpoint.yaw_rad == pytest.approx(flown.targets[0][1][3], abs=1e-6)
    assert of_type(log, ImportedActuators)[5].motors == pytest.approx((0.4, 0.5, 0.45, 0.55))
    assert of_type(log, ImportedPower)[0].voltage_v == pytest.approx(15.8)
    assert of_type(log, ImportedPower)[0].remaining == pytest.approx(0.8)
    assert of_type(log, ImportedText) == [ImportedText(9_000_000_000, "Takeoff detected")]


def test_a_ulog_that_pyulog_wrote_tells_the_same(flown: Flown, tmp_path: Path) -> None:
    """Another writer than ours: it writes every message of the format anew, topic after topic."""
    write_ulog(tmp_path / "ours.ulg", flown)
    ULog(str(tmp_path / "ours.ulg")).write_ulog(str(tmp_path / "theirs.ulg"))
    assert (tmp_path / "theirs.ulg").read_bytes() != (tmp_path / "ours.ulg").read_bytes()
    assert read(tmp_path / "theirs.ulg") == read(tmp_path / "ours.ulg")


def test_a_dataflash_log_comes_back(flown: Flown, tmp_path: Path) -> None:
    write_dataflash(tmp_path / "a.bin", flown)
    log = read(tmp_path / "a.bin")
    assert (log.kind, log.version) == ("dataflash", "ArduCopter V4.6.1 (abcdef12)")
    assert not log.is_damaged
    assert log.has_own_origin
    assert_states(log, flown, DATAFLASH_SHIFT_M)  # and those of the second core are left out
    assert [record.mode for record in of_type(log, ImportedMode)] == [
        "LOITER",
        "GUIDED",
        "LOITER",
        "GUIDED",
        "LAND",
        "GUIDED",
    ]
    setpoint = of_type(log, ImportedSetpoint)[0]
    assert setpoint.down_m == pytest.approx(flown.targets[0][1][2] - DATAFLASH_SHIFT_M[2], abs=1e-4)
    assert setpoint.v_down_m_s == pytest.approx(0.1)
    assert of_type(log, ImportedActuators)[5].motors == pytest.approx((0.4, 0.5, 0.6, 0.7))  # in the motors' order
    assert of_type(log, ImportedPower)[0] == ImportedPower(
        of_type(log, ImportedPower)[0].t_ns, pytest.approx(15.8), pytest.approx(12.5), pytest.approx(0.8)
    )


def test_a_telemetry_log_comes_back(flown: Flown, tmp_path: Path) -> None:
    write_telemetry(tmp_path / "a.tlog", flown.frames)
    log = read(tmp_path / "a.tlog")
    assert (log.kind, log.version) == ("telemetry", "PX4")
    assert_states(log, flown)
    modes = of_type(log, ImportedMode)
    assert [record.mode for record in modes] == [mode for _, mode in flown.modes]
    for record, (t_ns, _) in zip(modes[1:], flown.modes[1:], strict=True):  # heartbeats come once a second
        assert -0.01 < (record.t_ns - t_ns) / 1e9 < 1.05
    said = [record.text for record in of_type(log, ImportedText)]
    assert "Takeoff detected" in said
    assert said == [text.strip() for text in said]


def test_a_telemetry_log_that_mavlogdump_wrote_tells_the_same(flown: Flown, tmp_path: Path) -> None:
    """Another writer than ours, of pymavlink's tools; it keeps times to 4 us."""
    write_telemetry(tmp_path / "ours.tlog", flown.frames[:4_000])
    tool = [sys.executable, str(Path(sys.executable).with_name("mavlogdump.py")), "--quiet", "--dialect", "all"]
    files = ["--output", str(tmp_path / "theirs.tlog"), str(tmp_path / "ours.tlog")]
    subprocess.run([*tool, *files], check=True, capture_output=True, env={**os.environ, "MAVLINK20": "1"})
    for theirs, ours in zip(read(tmp_path / "theirs.tlog").records, read(tmp_path / "ours.tlog").records, strict=True):
        assert theirs.t_ns == pytest.approx(ours.t_ns, rel=0, abs=10_000)
        assert replace(theirs, t_ns=0) == replace(ours, t_ns=0)


def test_a_packed_telemetry_log_is_the_same(flown: Flown, tmp_path: Path) -> None:
    write_telemetry(tmp_path / "a.tlog", flown.frames[:4_000])
    (tmp_path / "b.tlog.xz").write_bytes(lzma.compress((tmp_path / "a.tlog").read_bytes(), preset=0))
    assert read(tmp_path / "b.tlog.xz") == read(tmp_path / "a.tlog")
    assert len(digest(tmp_path / "a.tlog")) == 64


def test_a_packed_telemetry_log_that_was_cut_is_read_up_to_there_and_says_so(flown: Flown, tmp_path: Path) -> None:
    write_telemetry(tmp_path / "a.tlog", flown.frames[:4_000])
    packed = lzma.compress((tmp_path / "a.tlog").read_bytes(), preset=0)
    whole = read(tmp_path / "a.tlog")
    assert not whole.breaks_off
    for share in (0.9, 0.5):
        (tmp_path / "cut.tlog.xz").write_bytes(packed[: int(share * len(packed))])
        cut = read(tmp_path / "cut.tlog.xz")
        assert cut.breaks_off
        assert not cut.is_damaged
        assert cut.states == whole.states[: len(cut.states)]
        assert len(cut.states) == pytest.approx(share * len(whole.states), rel=0.1)


def test_a_packed_telemetry_log_that_is_damaged_is_read_up_to_there_and_says_so(flown: Flown, tmp_path: Path) -> None:
    write_telemetry(tmp_path / "a.tlog", flown.frames[:4_000])
    packed = bytearray(lzma.compress((tmp_path / "a.tlog").read_bytes(), preset=0))
    middle = len(packed) // 2
    packed[middle : middle + 100] = random.Random(1).randbytes(100)
    (tmp_path / "damaged.tlog.xz").write_bytes(packed)
    whole, damaged = read(tmp_path / "a.tlog"), read(tmp_path / "damaged.tlog.xz")
    assert damaged.is_damaged
    assert len(damaged.states) > 0.4 * len(whole.states)


def test_streams_that_were_packed_apart_are_one_log(flown: Flown, tmp_path: Path) -> None:
    write_telemetry(tmp_path / "a.tlog", flown.frames[:4_000])
    data = (tmp_path / "a.tlog").read_bytes()
    middle = len(data) // 2
    streams = [lzma.compress(part, preset=0) for part in (data[:middle], data[middle:])]
    (tmp_path / "b.tlog.xz").write_bytes(bytes(10_000).join(streams))
    assert read(tmp_path / "b.tlog.xz") == read(tmp_path / "a.tlog")


@pytest.mark.parametrize("n_bytes", [1, 9, 20])
def test_a_telemetry_log_that_ends_within_a_message_says_so(flown: Flown, tmp_path: Path, n_bytes: int) -> None:
    frames = flown.frames[:4_001]
    write_telemetry(tmp_path / "a.tlog", frames[:-1])
    write_telemetry(tmp_path / "b.tlog", frames)
    whole, longer = (tmp_path / "a.tlog").read_bytes(), (tmp_path / "b.tlog").read_bytes()
    (tmp_path / "cut.tlog").write_bytes(longer[: len(whole) + n_bytes])
    assert read(tmp_path / "cut.tlog").breaks_off
    assert read(tmp_path / "cut.tlog").records == read(tmp_path / "a.tlog").records


def test_other_vehicles_in_a_telemetry_log_are_left_out(flown: Flown, tmp_path: Path) -> None:
    other = dialect.MAVLink(None, srcSystem=7, srcComponent=1)
    strange = other.local_position_ned_encode(9_000, 500.0, 0.0, 0.0, 0.0, 0.0, 0.0).pack(other)
    frames = [*flown.frames[:3_000], *[(t_s, strange) for t_s, _ in flown.frames[2_900:2_950]]]
    write_telemetry(tmp_path / "a.tlog", frames)
    write_telemetry(tmp_path / "b.tlog", flown.frames[:3_000])
    assert read(tmp_path / "a.tlog").records == read(tmp_path / "b.tlog").records


def test_each_start_of_the_autopilot_is_a_log_of_its_own(flown: Flown, tmp_path: Path) -> None:
    frames = flown.frames[:4_000]
    write_telemetry(tmp_path / "a.tlog", frames + [(t_s + 200.0, frame) for t_s, frame in frames])
    first, second = read_autopilot_log(tmp_path / "a.tlog", lambda _: None)
    assert [state.t_ns for state in first.states[-20:]] == [state.t_ns for state in second.states[-20:]]


def test_long_messages_of_telemetry_are_put_together(flown: Flown, tmp_path: Path) -> None:
    vehicle = dialect.MAVLink(None, srcSystem=1, srcComponent=1)
    text = b"Preflight Fail: horizontal velocity unstable and more of it\t"
    pieces = [vehicle.statustext_encode(6, text[at : at + 50], 9, at // 50).pack(vehicle) for at in (0, 50)]
    frames = [*flown.frames[:3_000], *[(flown.frames[2_999][0], piece) for piece in pieces]]
    write_telemetry(tmp_path / "a.tlog", frames)
    assert of_type(read(tmp_path / "a.tlog"), ImportedText)[-1].text == text.decode().rstrip()


@pytest.mark.parametrize("ending", WRITE)
def test_a_log_that_breaks_off_is_read_up_to_there(flown: Flown, tmp_path: Path, ending: str) -> None:
    whole = tmp_path / f"whole{ending}"
    WRITE[ending](whole, flown)
    data, n_states = whole.read_bytes(), len(read(whole).states)
    part = tmp_path / f"part{ending}"
    for share in (0.9, 0.5, 0.2):
        part.write_bytes(data[: int(len(data) * share)])
        states = read(part).states
        assert states == read(whole).states[: len(states)]
        assert len(states) == pytest.approx(share * n_states, rel=0.25)
    part.write_bytes(data[:300])
    with pytest.raises(AutopilotLogError):
        read(part)


@pytest.mark.parametrize("ending", WRITE)
def test_damage_in_the_middle_costs_little_or_is_refused_in_a_sentence(
    flown: Flown, tmp_path: Path, ending: str
) -> None:
    whole = tmp_path / f"whole{ending}"
    WRITE[ending](whole, flown)
    data, n_states = whole.read_bytes(), len(read(whole).states)
    draw = random.Random(1)
    n_good = 0
    for _ in range(6):
        damaged = bytearray(data)
        at = draw.randrange(len(data) // 4, len(data) // 2)
        damaged[at : at + 400] = draw.randbytes(400)
        part = tmp_path / f"part{ending}"
        part.write_bytes(damaged)
        try:
            n_good += len(read(part).states) > 0.9 * n_states
        except AutopilotLogError as error:
            assert "damaged" in str(error)  # noqa: PT017
    assert n_good >= 3


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.ulg", b"", "is empty"),
        ("a.bin", b"", "is empty"),
        ("a.tlog", b"", "is empty"),
        ("a.ulg", b"some text that is no log at all", "is not a ULog file"),
        ("a.bin", b"some text that is no log at all", "is not a dataflash log"),
        ("a.tlog", b"some text that is no log at all", "holds no message of an autopilot"),
        ("a.tlog", struct.pack(">Q", 1) + b"\xfd" * 5_000, "holds no message of an autopilot"),
        ("a.tlog.xz", b"some text that is no log at all", "cannot be unpacked"),
        ("a.tlog.xz", lzma.compress(bytes(100_000))[:20], "cannot be unpacked .it breaks off"),
        ("a.tlog.xz", lzma.compress(bytes(100_000))[:60], r"a\.tlog\.xz holds no message of an autopilot"),
        ("a.tlog.xz", lzma.compress(b"text"), r"a\.tlog\.xz holds no message of an autopilot"),
        ("a.ulg", ulog_head(), "holds no position with attitude"),
        ("a.ulg", ulog_head()[:7], "is damaged"),
        ("a.bin", dataflash_head(), "holds no position with attitude"),
        ("a.bin", b"\xa3\x95", r"is damaged|holds no position"),
        ("a.bin", b"\xa3\x95\x80" + bytes(500), r"is damaged|holds no position"),
        ("a.csv", b"t,x\n", r"is no log that can be imported; name one of \.ulg"),
    ],
)
def test_what_is_no_log_is_refused_in_a_sentence(tmp_path: Path, name: str, content: bytes, words: str) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(AutopilotLogError, match=words):
        read_autopilot_log(tmp_path / name, lambda _: None)


def test_missing_files_and_folders_are_refused_in_a_sentence(tmp_path: Path) -> None:
    with pytest.raises(AutopilotLogError, match="cannot be read"):
        read_autopilot_log(tmp_path / "a.ulg", lambda _: None)
    with pytest.raises(AutopilotLogError, match="is a folder"):
        read_autopilot_log(tmp_path, lambda _: None)


def test_a_wild_time_does_not_outrun_what_follows(flown: Flown, tmp_path: Path) -> None:
    from mission.imports.autopilot_log import Collector

    collector = Collector()
    for t_ns in (10**9, 2**62, -5, 2 * 10**9):
        collector.add(ImportedState(t_ns, *[0.0] * 9))
    assert [state.t_ns for state in collector.log("ulog", "", "").states] == [10**9, 2 * 10**9]
