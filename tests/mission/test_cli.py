"""The command line: what it answers to good and to bad input. Nothing here flies."""

import json
import socket
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.support.command_line import ROOT, Ran, lineflight

MISSION = ROOT / "missions" / "follow_line.yaml"
COMMANDS = ("dry-run", "run", "sitl", "check", "detect", "camera", "inspect", "export", "import", "compare", "replay")
BAD_MISSIONS = {
    "wrong unit": (b"version: 1\nname: x\ntasks:\n  - {task: takeoff, altitude_ft: 5}\n  - {task: land}\n", ":4: "),
    "unknown task": (b"version: 1\nname: x\ntasks:\n  - {task: takeoff}\n  - {task: loop}\n", ":5: tasks[1].task"),
    "align first": (b"version: 1\nname: x\ntasks:\n  - {task: align}\n  - {task: land}\n", ":4: tasks[0].task"),
    "no land": (b"version: 1\nname: x\ntasks:\n  - {task: takeoff}\n", "allowed: land or return as the last task"),
    "negative": (
        b"version: 1\nname: x\ntasks:\n  - {task: takeoff}\n  - {task: hold, duration_s: -1}\n  - {task: land}\n",
        ":5: tasks[1].duration_s: found -1",
    ),
    "not YAML": (b"tasks: [\n", "not valid YAML"),
    "empty": (b"", "empty"),
    "10 MB": (b"a" * 10_000_000, "larger than"),
    "binary": (bytes(range(256)), "not text"),
}


def assert_plain(ran: Ran, code: int) -> None:
    """The exit code, and no traceback."""
    assert ran.code == code, ran.err
    assert "Traceback" not in ran.err + ran.out


def test_help_names_every_command() -> None:
    ran = lineflight("--help")
    assert_plain(ran, 0)
    assert all(command in ran.out for command in COMMANDS)


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help(command: str) -> None:
    assert_plain(lineflight(command, "--help"), 0)


@pytest.mark.parametrize("name", BAD_MISSIONS)
@pytest.mark.parametrize("command", ["check", "dry-run"])
def test_bad_missions_exit_2_before_anything_connects(tmp_path: Path, name: str, command: str) -> None:
    content, expected = BAD_MISSIONS[name]
    file = tmp_path / "bad.yaml"
    file.write_bytes(content)
    logs = tmp_path / "logs"
    ran = lineflight(command, file, *(["--log", str(logs)] if command == "dry-run" else []))
    assert_plain(ran, 2)
    assert f"{file}:" in ran.err
    assert expected in ran.err
    assert not logs.exists()


def test_check_explains_each_task() -> None:
    ran = lineflight("check", MISSION)
    assert_plain(ran, 0)
    for words in (
        "follow_line", "climb to 16 m", "follow the line for 30 m", "land here and disarm", "fence 150 m",
        "camera v4l2:/dev/video0, 640 x 480 px at 30 Hz, lens 80° wide", "ok energy: about", "ok time limits: ",
        "ok line height: at least 5.7 m over the line of 10.3 m", "ok fence: ",
    ):  # fmt: skip
        assert words in " ".join(ran.out.split())


def test_check_refuses_a_mission_beyond_the_battery(tmp_path: Path) -> None:
    file = tmp_path / "far.yaml"
    file.write_text(MISSION.read_text() + "vehicle: {battery_wh: 5}\n")
    ran = lineflight("check", file)
    assert_plain(ran, 2)
    assert "failed  energy: " in ran.out
    assert "refused" in ran.err


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (("check", "none.yaml"), "no such file"),
        (("dry-run", MISSION, "--world", "atlantis"), "atlantis"),
        (("dry-run", MISSION, "--speed", "fast"), "--speed"),
        (("run", MISSION, "--camera", "webcam"), "webcam"),
        (("run", MISSION, "--camera", "sim:atlantis"), "atlantis"),
        (("inspect", "none.mcap"), "none.mcap"),
        (("inspect", MISSION), "follow_line.yaml"),
        (("detect", "none.jpg"), "none.jpg"),
        (("nonsense",), "nonsense"),
    ],
)
def test_bad_input_is_one_sentence_and_exit_2(arguments: tuple[str | Path, ...], expected: str) -> None:
    ran = lineflight(*arguments)
    assert_plain(ran, 2)
    assert expected in ran.err


def draw_line_photo(file: Path) -> None:
    """Three bright conductors at +20 degrees over a dull, grainy ground."""
    ground = np.random.default_rng(1).normal(95, 6, (480, 640)).clip(0, 255).astype(np.uint8)
    for offset in (-60, 0, 60):
        centre = np.array([320 + offset, 240])
        along = 500 * np.array([np.sin(np.radians(20)), -np.cos(np.radians(20))])
        start, end = ((centre - along) * 16).astype(int), ((centre + along) * 16).astype(int)
        cv2.line(ground, start.tolist(), end.tolist(), 220, 1, cv2.LINE_AA, shift=4)
    assert cv2.imwrite(str(file), ground)


def test_detect_prints_one_object_a_line_and_draws(tmp_path: Path) -> None:
    photos = tmp_path / "photos"
    photos.mkdir()
    draw_line_photo(photos / "a.png")
    draw_line_photo(photos / "b.jpg")
    (photos / "notes.txt").write_text("not an image")
    ran = lineflight("detect", photos, "--json", "--draw", tmp_path / "drawn")
    assert_plain(ran, 0)
    entries = [json.loads(line) for line in ran.out.splitlines()]
    assert [Path(entry["file"]).name for entry in entries] == ["a.png", "b.jpg"]
    for entry in entries:
        assert set(entry) == {
            "file", "width", "height", "segments", "power_lines", "angle_deg", "offset_px", "n_lines",
            "spacing_px", "confidence", "present", "elapsed_ms",
        }  # fmt: skip
        assert (entry["width"], entry["height"]) == (640, 480)
        assert entry["present"] is True
        assert entry["angle_deg"] == pytest.approx(20.0, abs=1.0)
    assert sorted(file.name for file in (tmp_path / "drawn").iterdir()) == ["a.png", "b.png"]


@pytest.mark.parametrize("detector", ["cbs", "steerable", "lsd"])
def test_detect_compares_detectors(tmp_path: Path, detector: str) -> None:
    draw_line_photo(tmp_path / "a.png")
    ran = lineflight("detect", tmp_path / "a.png", "--json", "--detector", detector)
    assert_plain(ran, 0)
    assert json.loads(ran.out)["angle_deg"] == pytest.approx(20.0, abs=1.0)


def test_detect_names_the_detectors_it_has(tmp_path: Path) -> None:
    ran = lineflight("detect", tmp_path, "--detector", "magic")
    assert_plain(ran, 2)
    assert "projection" in ran.err


def test_detect_goes_on_after_a_broken_image(tmp_path: Path) -> None:
    (tmp_path / "a.jpg").write_bytes(b"not a jpeg")
    draw_line_photo(tmp_path / "b.png")
    ran = lineflight("detect", tmp_path)
    assert_plain(ran, 1)
    assert "a.jpg" in ran.err
    assert "power line at +" in ran.out


def test_a_log_folder_that_cannot_be_made_ends_before_connecting(tmp_path: Path) -> None:
    blocker = tmp_path / "file"
    blocker.write_text("in the way")
    ran = lineflight("run", MISSION, "--camera", f"file:{tmp_path}", "--log", blocker / "logs")
    assert_plain(ran, 1)
    assert "cannot be made" in ran.err


def test_a_live_view_needs_real_time() -> None:
    ran = lineflight("dry-run", MISSION, "--virtual-time", "--live")
    assert_plain(ran, 2)
    assert ran.err == "--virtual-time goes too fast to be watched: leave out --live, or --virtual-time.\n"


@pytest.mark.parametrize(
    "option", [("--live-port", "9000"), ("--live-address", "192.168.7.2"), ("--live-foxglove-port", "9")]
)
@pytest.mark.parametrize("command", ["run", "dry-run"])
def test_options_of_the_live_view_need_it(tmp_path: Path, command: str, option: tuple[str, str]) -> None:
    ran = lineflight(command, MISSION, *option, "--log", tmp_path / "logs")
    assert_plain(ran, 2)
    assert "belong to --live" in ran.err
    assert not (tmp_path / "logs").exists()


def test_a_live_view_that_cannot_be_served_is_said_before_anything_connects(tmp_path: Path) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = str(taken.getsockname()[1])
        ran = lineflight(
            "run",
            MISSION,
            "--camera",
            f"file:{MISSION.parent}",
            "--live",
            "--live-port",
            port,
            "--log",
            tmp_path / "logs",
        )
    assert_plain(ran, 2)
    assert f"127.0.0.1:{port}" in ran.err
    assert "--live-port" in ran.err
    assert not (tmp_path / "logs").exists()
