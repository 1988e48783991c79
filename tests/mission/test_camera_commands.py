"""`lineflight camera`: what it prints, what it writes, and what it answers to bad input."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from drivers.camera.calibration import Board
from drivers.camera.calibration_file import read_calibration, write_calibration
from tests.drivers.board_photos import PLAIN, photograph
from tests.mission.test_cli import assert_plain, draw_line_photo
from tests.support.command_line import ROOT, lineflight


def test_a_computer_without_cameras_says_so() -> None:
    listed = json.loads(lineflight("camera", "list", "--json").out)
    assert isinstance(listed, list)
    ran = lineflight("camera", "list")
    assert_plain(ran, 0)
    assert ("no V4L2 camera" in ran.out) is (listed == [])


def test_show_says_what_a_camera_gives_and_keeps_a_still(tmp_path: Path) -> None:
    for i in range(3):
        draw_line_photo(tmp_path / f"{i}.png")
    still, kept = tmp_path / "out" / "still.png", tmp_path / "kept.png"
    ran = lineflight("camera", "show", f"file:{tmp_path}", "--rate", "20", "--still", still, "--keep", kept, "--json")
    assert_plain(ran, 0)
    assert 2 <= ran.json["frames"] + ran.json["dropped"] <= 3  # a busy computer misses some
    assert ran.json["rate_hz"] == pytest.approx(20.0, rel=0.01)
    assert ran.json["size"] == [640, 480]
    assert ran.json["power_line"] is True
    drawn, plain = cv2.imread(str(still)), cv2.imread(str(kept))
    assert drawn.shape == plain.shape == (480, 640, 3)
    assert not np.array_equal(drawn, plain)
    said = lineflight("camera", "show", f"file:{tmp_path / '0.png'}").out
    assert "640 x 480 px at ? Hz: 1 frames, 0 dropped" in said


def test_show_takes_the_camera_of_a_mission(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "small.png"), np.zeros((240, 320), np.uint8))
    spec = f"file:{tmp_path / 'small.png'}"
    ran = lineflight("camera", "show", spec, "--mission", ROOT / "missions" / "follow_line.yaml")
    assert_plain(ran, 2)
    assert "320 x 240 px but the camera settings ask for 640 x 480 px" in ran.err
    dark = lineflight("camera", "show", spec)
    assert_plain(dark, 0)
    assert "the frame is dark" in dark.out


def test_calibrate_writes_what_a_mission_can_name(tmp_path: Path) -> None:
    board = Board(7, 5, is_charuco=True)
    photos = tmp_path / "photos"
    photos.mkdir()
    for seed in range(12):
        cv2.imwrite(str(photos / f"{seed:02d}.png"), photograph(board, PLAIN, seed))
    cv2.imwrite(str(photos / "empty.png"), np.full((480, 640), 90, np.uint8))
    out = tmp_path / "camera.yaml"
    ran = lineflight("camera", "calibrate", photos, "--board", "7x5", "--charuco", "--out", out)
    assert_plain(ran, 0)
    assert "00.png: found" in ran.err
    assert "empty.png: no board" in ran.err
    assert "pinhole lens, 640 x 480 px" in ran.out
    found = read_calibration(out)
    assert found.fx_px == pytest.approx(PLAIN.fx_px, rel=0.01)

    mission = tmp_path / "mission.yaml"
    mission.write_text(
        "version: 1\nname: x\ntasks:\n  - {task: takeoff}\n  - {task: land}\ncamera: {calibration: camera.yaml}\n"
    )
    assert_plain(lineflight("check", mission), 0)


@pytest.mark.parametrize(
    ("camera", "line", "words"),
    [
        ("{calibration: none.yaml}", 7, "none.yaml cannot be read"),
        ("{calibration: lens.yaml, width_px: 1280, height_px: 720}", 7, "of 640 x 480 px, but the mission's camera"),
        ("{calibration: lens.yaml, hfov_deg: 70}", 7, "either calibration or hfov_deg"),
        ("{calibration: mission.yaml}", 7, "is wrong at"),
        ('{calibration: "a\\0b.yaml"}', 7, "cannot be read"),
        ("{controls: {brightness: loud}}", 7, "camera.controls.brightness"),
        ("{pixel_format: jpg}", 7, "camera.pixel_format"),
    ],
)
def test_a_camera_that_cannot_be_is_refused_with_its_line(tmp_path: Path, camera: str, line: int, words: str) -> None:
    write_calibration(tmp_path / "lens.yaml", PLAIN, 0.2, "a test")
    mission = tmp_path / "mission.yaml"
    mission.write_text(
        f"# a comment\nversion: 1\nname: x\ntasks:\n  - {{task: takeoff}}\n  - {{task: land}}\ncamera: {camera}\n"
    )
    ran = lineflight("check", mission)
    assert_plain(ran, 2)
    assert f"{mission}:{line}: camera" in ran.err
    assert words in ran.err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("show", "webcam"), "'webcam' is not of a kind we know"),
        (("show", "v4l2:/dev/video99"), "/dev/video99"),
        (("show", "file:none"), "no recording at none"),
        (("show", "file:README.md"), "neither an image nor a video"),
        (("show", "file:none", "--size", "big"), "--size is 'big'"),
        (("show", "v4l2:/dev/video99", "--control", "brightness"), "--control is 'brightness'"),
        (("show", "v4l2:/dev/video99", "--pixel-format", "YUV"), "--pixel-format is 'YUV'"),
        (("calibrate", "missions", "--board", "\u00b2x4"), "--board is"),
        (("calibrate", "missions", "--board", "2x4"), "--board is '2x4'"),
        (("calibrate", "none"), "no folder none"),
        (("calibrate", "missions"), "holds no photographs"),
        (("calibrate", "missions", "--board", "9by6"), "--board is '9by6'"),
    ],
)
def test_bad_input_is_one_sentence_and_exit_2(arguments: tuple[str, ...], words: str) -> None:
    ran = lineflight("camera", *arguments)
    assert_plain(ran, 2)
    assert words in ran.err


def test_photographs_without_a_board_are_one_sentence(tmp_path: Path) -> None:
    for name in ("a.png", "b.png"):
        assert cv2.imwrite(str(tmp_path / name), np.full((240, 320, 3), 120, np.uint8))
    ran = lineflight("camera", "calibrate", tmp_path)
    assert_plain(ran, 2)
    assert "found in no photograph" in ran.err
