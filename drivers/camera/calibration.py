"""Calibrate a camera from photographs of a board: a checkerboard, or a ChArUco board, by OpenCV."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from drivers.camera.camera import CameraError, Intrinsics, Lens
from drivers.camera.distortion import is_plausible

MIN_VIEWS = 8
"""Fewer photographs do not tell focal length, distortion and the board's distance apart."""

_MIN_CORNERS = 8
_FISHEYE_GAIN = 0.7  # the fisheye model is taken when it leaves this share of the plain model's error, or less
_MARKER_SHARE = 0.75  # of a ChArUco square
_COVERAGE_CELLS = 8
_MAX_RMS_SHARE = 0.005  # of the image's width: 3 px of 640; a good calibration is ten times better
_CRITERIA = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-9)


@dataclass(frozen=True, slots=True)
class Board:
    """What was photographed: `columns` x `rows` inner corners (checkerboard) or squares (ChArUco, DICT_5X5_1000).

    `square_m` is the side of a square; it does not matter to the intrinsics.
    """

    columns: int
    rows: int
    square_m: float = 0.025
    is_charuco: bool = False

    def __str__(self) -> str:
        return f"{'ChArUco board' if self.is_charuco else 'checkerboard'} {self.columns}x{self.rows}"


@dataclass(frozen=True, slots=True, eq=False)  # arrays have no single answer to ==
class View:
    """One photograph's corners: on the board (n, 3) [m] and in the image (n, 2) [px], both float32."""

    name: str
    on_board_m: NDArray[np.float32]
    in_image_px: NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class Calibration:
    """A calibrated camera, and how well it explains the photographs.

    `rms_px` is the root mean square distance of corners from where the model has them, `view_rms_px` that of each
    photograph; `coverage` is the share of the frame, in 8 x 8 cells, where any corner lay.
    """

    intrinsics: Intrinsics
    rms_px: float
    view_rms_px: tuple[float, ...]
    coverage: float


class BoardFinder:
    """Finds a board's corners in photographs."""

    def __init__(self, board: Board) -> None:
        self._board = board
        self._charuco = _charuco_detector(board) if board.is_charuco else None

    def find(self, name: str, image: NDArray[np.uint8]) -> View | None:
        """The board in `image`, (h, w) or (h, w, 3) BGR uint8; None where it is not to be seen."""
        grey = image if image.ndim == 2 else np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), dtype=np.uint8)
        return self._checkerboard(name, grey) if self._charuco is None else self._charuco_view(name, grey)

    def _checkerboard(self, name: str, grey: NDArray[np.uint8]) -> View | None:
        board = self._board
        size = (board.columns, board.rows)
        flags = cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY
        try:
            is_found, corners = cv2.findChessboardCornersSB(grey, size, flags=flags)
        except cv2.error as error:
            raise CameraError(f"A {board} cannot be looked for in {name}: {error.err}.") from None
        if not is_found:
            return None
        columns, rows = np.meshgrid(np.arange(board.columns), np.arange(board.rows))
        on_board = np.stack([columns.ravel(), rows.ravel(), np.zeros(columns.size)], axis=1) * board.square_m
        return View(name, on_board.astype(np.float32), np.asarray(corners, dtype=np.float32).reshape(-1, 2))

    def _charuco_view(self, name: str, grey: NDArray[np.uint8]) -> View | None:
        assert self._charuco is not None  # noqa: S101  the board says so
        corners, ids, _, _ = self._charuco.detectBoard(grey)
        if ids is None or len(ids) < _MIN_CORNERS:
            return None
        on_board = np.asarray(self._charuco.getBoard().getChessboardCorners(), dtype=np.float32)
        return View(name, on_board[np.ravel(ids)], np.asarray(corners, dtype=np.float32).reshape(-1, 2))


def calibrate(views: Sequence[View], width_px: int, height_px: int, lens: Lens | None = None) -> Calibration:
    """Fit a camera of that image size to the views; `lens` None takes the model that explains them better.

    Raises CameraError for fewer than MIN_VIEWS views, and where no model fits.
    """
    if not views:
        raise CameraError(
            "The board was found in no photograph: count its inner corners (checkerboard) or squares (ChArUco) for "
            "--board, and say --charuco where it is one."
        )
    if len(views) < MIN_VIEWS:
        raise CameraError(
            f"The board was found in {len(views)} photographs, but a calibration needs {MIN_VIEWS} or more: take some "
            "with the board tilted to all sides, near and far, up to the frame's corners."
        )
    if lens is not None:
        found = _fit(views, width_px, height_px, lens)
    else:
        plain, fisheye = (_fit(views, width_px, height_px, kind) for kind in ("pinhole", "fisheye"))
        found = plain
        if fisheye is not None and (plain is None or fisheye.rms_px < _FISHEYE_GAIN * plain.rms_px):
            found = fisheye
    if found is None or found.rms_px > _MAX_RMS_SHARE * width_px:
        raise CameraError(
            "No lens model fits the photographs: check the board's size, and take sharp ones with the board tilted."
        )
    return found


def _fit(views: Sequence[View], width_px: int, height_px: int, lens: Lens) -> Calibration | None:
    """The best camera of a lens model; None where the fit fails, or folds the image over itself."""
    on_board = [view.on_board_m.reshape(1, -1, 3) for view in views]
    in_image = [view.in_image_px.reshape(1, -1, 2) for view in views]
    size = (width_px, height_px)
    try:
        if lens == "fisheye":
            on_board_64 = [points.astype(np.float64) for points in on_board]
            in_image_64 = [points.astype(np.float64) for points in in_image]
            flags = cv2.CALIB_RECOMPUTE_EXTRINSIC | cv2.CALIB_FIX_SKEW
            _, matrix, distortion, turns, moves = cv2.fisheye.calibrate(
                on_board_64, in_image_64, size, np.eye(3), np.zeros(4), flags=flags, criteria=_CRITERIA
            )
        else:
            _, matrix, distortion, turns, moves = cv2.calibrateCamera(
                on_board, in_image, size, np.eye(3), np.zeros(5), criteria=_CRITERIA
            )
        coefficients = tuple(float(value) for value in np.ravel(distortion))
        camera = Intrinsics(
            width_px,
            height_px,
            float(matrix[0, 0]),
            float(matrix[1, 1]),
            float(matrix[0, 2]),
            float(matrix[1, 2]),
            coefficients,
            lens,
        )
    except (cv2.error, ValueError):
        return None
    if not is_plausible(camera):
        return None
    errors_px = []
    for i, view in enumerate(views):
        project = cv2.fisheye.projectPoints if lens == "fisheye" else cv2.projectPoints
        seen, _ = project(on_board[i].astype(np.float64), turns[i], moves[i], camera.matrix, np.array(coefficients))
        errors_px.append(np.linalg.norm(np.reshape(seen, (-1, 2)) - view.in_image_px, axis=1))
    return Calibration(
        camera,
        float(np.sqrt(np.mean(np.concatenate(errors_px) ** 2))),
        tuple(float(np.sqrt(np.mean(errors**2))) for errors in errors_px),
        _coverage(views, width_px, height_px),
    )


def _coverage(views: Sequence[View], width_px: int, height_px: int) -> float:
    corners_px = np.concatenate([view.in_image_px for view in views])
    counts, _, _ = np.histogram2d(
        corners_px[:, 0], corners_px[:, 1], bins=_COVERAGE_CELLS, range=((0, width_px), (0, height_px))
    )
    return float(np.mean(counts > 0))


def _charuco_detector(board: Board) -> cv2.aruco.CharucoDetector:
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_1000)
    marker_m = _MARKER_SHARE * board.square_m
    return cv2.aruco.CharucoDetector(
        cv2.aruco.CharucoBoard((board.columns, board.rows), board.square_m, marker_m, dictionary)
    )
