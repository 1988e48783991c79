"""A picture's truth as files: mask, depth, lines and boxes."""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from sitl.render.truth.truth import Truth

FARTHEST_M = 65.535
"""As far as a depth file tells, which is 16-bit millimetres; what is farther, and the sky, is 0."""


def depth_millimetres(depth_m: NDArray[np.float32]) -> NDArray[np.uint16]:
    """A depth picture as files keep it: (height, width) uint16 [mm], 0 beyond FARTHEST_M."""
    known = np.where(depth_m <= FARTHEST_M, depth_m, np.float32(0.0))
    return np.round(1000.0 * known).astype(np.uint16)


def png(image: NDArray[np.uint8] | NDArray[np.uint16]) -> bytes:
    """An image as a PNG file."""
    return cv2.imencode(".png", image)[1].tobytes()


def lines_entry(truth: Truth) -> list[dict[str, Any]]:
    """The wires as JSON: each piece x1, y1, x2, y2 [px] and its visible part, 0 to 1."""
    return [
        {"thing": line.thing, "is_shield": line.is_shield, "pieces": np.round(line.pieces, 3).tolist()}
        for line in truth.lines
    ]


def boxes_entry(truth: Truth) -> list[dict[str, Any]]:
    """The boxes as JSON: left, top, width, height [px]."""
    return [
        {
            "thing": box.thing,
            "category": box.category,
            "bbox": [box.left, box.top, box.right - box.left, box.bottom - box.top],
        }
        for box in truth.boxes
    ]
