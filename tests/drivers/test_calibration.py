"""Calibration from photographs of boards by a camera that is known, and the file that keeps it."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from drivers.camera.calibration import MIN_VIEWS, Board, BoardFinder, Calibration, View, calibrate
from drivers.camera.calibration_file import read_calibration, write_calibration
from drivers.camera.camera import CameraError, Intrinsics
from tests.drivers.board_photos import FISHEYE, PLAIN, photograph

CHECKERBOARD, CHARUCO = Board(9, 6), Board(7, 5, is_charuco=True)
GRID = np.stack(np.meshgrid(np.linspace(60, 580, 9), np.linspace(50, 430, 7)), axis=-1).reshape(-1, 1, 2)


LENS = "{{width_px: 640, height_px: 480, fx_px: {fx}, fy_px: 400, cx_px: 320, cy_px: 240, distortion: {distortion}}}"


def views_of(board: Board, camera: Intrinsics, n_photos: int) -> list[View]:
    finder = BoardFinder(board)
    found = (finder.find(f"{seed}.png", photograph(board, camera, seed)) for seed in range(n_photos))
    return [view for view in found if view is not None]


def grid_seen_by(found: Intrinsics, camera: Intrinsics) -> np.ndarray:
    """Where the found camera sees what the true camera sees at GRID, (n, 2) [px]."""
    undistort = cv2.fisheye.undistortPoints if camera.lens == "fisheye" else cv2.undistortPoints
    rays = undistort(GRID, camera.matrix, np.array(camera.distortion)).reshape(-1, 1, 2)
    project = cv2.fisheye.projectPoints if found.lens == "fisheye" else cv2.projectPoints
    points = np.concatenate([rays, np.ones((len(rays), 1, 1))], axis=2)
    seen, _ = project(points, np.zeros(3), np.zeros(3), found.matrix, np.array(found.distortion))
    return seen.reshape(-1, 2)


@pytest.fixture(scope="module", params=[(CHARUCO, PLAIN), (CHARUCO, FISHEYE), (CHECKERBOARD, PLAIN)], ids=str)
def calibrated(request) -> tuple[Calibration, Intrinsics]:
    board, camera = request.param
    return calibrate(views_of(board, camera, 14), camera.width_px, camera.height_px), camera


def test_the_camera_is_found_again(calibrated: tuple[Calibration, Intrinsics]) -> None:
    found, camera = calibrated
    assert found.intrinsics.lens == camera.lens
    assert found.rms_px < 0.5
    assert found.coverage > 0.4
    # Single coefficients trade off against each other; where the pixels look is what counts.
    error_px = np.abs(grid_seen_by(found.intrinsics, camera) - GRID.reshape(-1, 2)).max(axis=1)
    assert np.median(error_px) < 0.5
    assert error_px.max() < 3.0


def test_too_few_views_are_refused() -> None:
    with pytest.raises(CameraError, match=f"found in 3 photographs, but a calibration needs {MIN_VIEWS}"):
        calibrate(views_of(CHARUCO, PLAIN, 3), 640, 480)


def test_views_that_fit_no_lens_are_refused() -> None:
    rng = np.random.default_rng(1)
    corners = rng.uniform(0, 400, (10, 30, 2)).astype(np.float32)
    on_board = views_of(CHARUCO, PLAIN, 1)[0].on_board_m[:20]
    nonsense = [View(str(i), on_board, corners[i, : len(on_board)]) for i in range(10)]
    with pytest.raises(CameraError, match="No lens model fits"):
        calibrate(nonsense, 640, 480)


@pytest.mark.parametrize("board", [CHECKERBOARD, CHARUCO], ids=str)
def test_no_board_no_view(board: Board) -> None:
    noise = np.random.default_rng(2).integers(0, 256, (240, 320, 3), dtype=np.uint8)
    assert BoardFinder(board).find("noise.png", noise) is None


@pytest.mark.parametrize("camera", [PLAIN, FISHEYE], ids=["plain", "fisheye"])
def test_the_file_gives_back_what_was_written(tmp_path: Path, camera: Intrinsics) -> None:
    file = tmp_path / "new" / "camera.yaml"
    write_calibration(file, camera, 0.2, "14 photographs of a board")
    assert read_calibration(file) == camera


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (None, "cannot be read"),
        ("{", "is not YAML"),
        ("- 1", "is wrong at the file"),
        ("width_px: 640", "is wrong at height_px: field required"),
        ("{width_px: 0, height_px: 480, fx_px: 1, fy_px: 1, cx_px: 1, cy_px: 1, distortion: []}", "wrong at width_px"),
        (
            "{width_px: 640, height_px: 480, fx_px: 1, fy_px: 1, cx_px: 1, cy_px: 1, distortion: [1, 2]}",
            "a pinhole lens has 5 distortion coefficients, not 2",
        ),
        (
            "{lens: fisheye, width_px: 640, height_px: 480, fx_px: 1, fy_px: 1, cx_px: .nan, cy_px: 1, "
            "distortion: [0, 0, 0, 0]}",
            "is wrong at cx_px",
        ),
        ("a: 1" + " " * 70_000, "larger than 64 KB"),
        ("[" * 5000, "nested too deeply"),
        (LENS.format(fx=400, distortion="[12, 0, 0, 0, 0]"), "folds the image"),
        (LENS.format(fx=400, distortion="[-0.9, 0, 0, 0, 0]"), "folds the image"),
        (LENS.format(fx=20_000, distortion="[0, 0, 0, 0, 0]"), "no lens is like this"),
        (LENS.format(fx=5, distortion="[0, 0, 0, 0, 0]"), "no lens is like this"),
        (LENS.format(fx="1e-300", distortion="[0, 0, 0, 0, 0]"), "wrong at fx_px"),
        (LENS.format(fx=400, distortion="[true, 0, 0, 0, 0]"), "wrong at distortion.0"),
        (LENS.format(fx=400, distortion="null"), "wrong at distortion"),
    ],
)
def test_a_bad_file_is_refused_in_a_sentence(tmp_path: Path, text: str | None, words: str) -> None:
    file = tmp_path / "camera.yaml"
    if text is not None:
        file.write_text(text)
    with pytest.raises(CameraError, match=words):
        read_calibration(file)
