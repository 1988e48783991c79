"""Photographs of a calibration board by a camera that is known, and the camera itself."""

import cv2
import numpy as np
from numpy.typing import NDArray

from drivers.camera.calibration import Board
from drivers.camera.camera import Intrinsics

PLAIN = Intrinsics(640, 480, 420.0, 424.0, 325.0, 236.0, (-0.21, 0.06, 0.0008, -0.0006, -0.008))
FISHEYE = Intrinsics(640, 480, 250.0, 251.0, 322.0, 238.0, (-0.03, 0.006, -0.004, 0.001), "fisheye")

_PX_PER_SQUARE = 40
_SUBSAMPLES = 2


def board_texture(board: Board) -> NDArray[np.uint8]:
    """The board from right above, with a white margin of one square."""
    side = _PX_PER_SQUARE
    if board.is_charuco:
        dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_1000)
        size = (board.columns, board.rows)
        squares = cv2.aruco.CharucoBoard(size, board.square_m, 0.75 * board.square_m, dictionary)
        picture = squares.generateImage((board.columns * side, board.rows * side))
    else:
        row, column = np.indices(((board.rows + 1) * side, (board.columns + 1) * side)) // side
        picture = np.where((row + column) % 2 == 0, 0, 255).astype(np.uint8)
    return np.asarray(cv2.copyMakeBorder(picture, side, side, side, side, cv2.BORDER_CONSTANT, value=255), np.uint8)


def photograph(board: Board, camera: Intrinsics, seed: int) -> NDArray[np.uint8]:
    """The board tilted and moved at random before the camera, (480, 640) grey, with a little noise."""
    rng = np.random.default_rng(seed)
    texture = cv2.GaussianBlur(board_texture(board), (0, 0), 1.0)
    extent = np.array([texture.shape[1], texture.shape[0]]) / _PX_PER_SQUARE  # squares
    turn, _ = cv2.Rodrigues(rng.uniform(-0.6, 0.6, 3))
    # The board's middle on a ray through a point of the frame, as far away as makes it large.
    low, high = (0.15, 0.85) if board.is_charuco else (0.42, 0.58)  # half a checkerboard cannot be found
    aim = rng.uniform(low, high, 2) * (camera.width_px, camera.height_px)
    ray = np.array([(aim[0] - camera.cx_px) / camera.fx_px, (aim[1] - camera.cy_px) / camera.fy_px, 1.0])
    middle = ray * rng.uniform(0.9, 1.4) * extent[0] * camera.fx_px / camera.width_px

    step = 1.0 / _SUBSAMPLES
    u, v = np.meshgrid(np.arange(0, camera.width_px, step), np.arange(0, camera.height_px, step))
    u, v = u + (step - 1) / 2, v + (step - 1) / 2
    pixels = np.stack([u.ravel(), v.ravel()], axis=1).reshape(-1, 1, 2)
    undistort = cv2.fisheye.undistortPoints if camera.lens == "fisheye" else cv2.undistortPoints
    rays = undistort(pixels, camera.matrix, np.array(camera.distortion)).reshape(-1, 2)
    rays = np.column_stack([rays, np.ones(len(rays))])
    distance = (middle @ turn[:, 2]) / (rays @ turn[:, 2])
    on_board = (rays * distance[:, None] - middle) @ turn[:, :2]  # squares, from the middle
    at_px = ((on_board + extent / 2) * _PX_PER_SQUARE - 0.5).reshape(*u.shape, 2).astype(np.float32)
    large = cv2.remap(texture, at_px[..., 0], at_px[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT,
                      borderValue=170)  # fmt: skip
    seen = cv2.resize(large, (camera.width_px, camera.height_px), interpolation=cv2.INTER_AREA)
    return np.clip(seen + rng.normal(0, 2, seen.shape), 0, 255).astype(np.uint8)
