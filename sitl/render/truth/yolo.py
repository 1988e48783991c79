"""Labels in the form of YOLO: a text file for each picture, a line for each thing, in parts of the picture's size."""

import itertools

import numpy as np
from numpy.typing import NDArray

from sitl.render.truth.truth import CATEGORIES, Truth

_LEAST_PX = 1.0  # a polygon of a wire is at least so wide
_GAP_PX = 1.5


def yolo_boxes(truth: Truth) -> str:
    """A line "class centre_x centre_y width height" for each thing."""
    height_px, width_px = truth.mask.shape
    lines = []
    for box in truth.boxes:
        numbers = (
            (box.left + box.right) / 2 / width_px,
            (box.top + box.bottom) / 2 / height_px,
            (box.right - box.left) / width_px,
            (box.bottom - box.top) / height_px,
        )
        lines.append(_line(CATEGORIES.index(box.category), numbers))
    return "".join(lines)


def yolo_polygons(truth: Truth) -> str:
    """A line "class x1 y1 x2 y2 ..." for each visible run of each wire: the strip it covers, at least a pixel wide."""
    height_px, width_px = truth.mask.shape
    lines = []
    for box in truth.boxes:
        if box.category not in ("conductor", "shield_wire"):
            continue
        for run in _visible_runs(truth, box.thing):
            outline = np.clip((_outline(run) + 0.5) / [width_px, height_px], 0.0, 1.0)
            lines.append(_line(CATEGORIES.index(box.category), outline.ravel().tolist()))
    return "".join(lines)


def _line(category: int, numbers: "tuple[float, ...] | list[float]") -> str:
    return f"{category} " + " ".join(f"{number:.6f}" for number in numbers) + "\n"


def _visible_runs(truth: Truth, thing: int) -> list[NDArray[np.float64]]:
    """The wire's strips, joined where one begins at another's end, without what is hidden: (n, 3) x, y, width each."""
    runs: list[list[list[float]]] = []
    for x0, y0, w0, _, x1, y1, w1, _, _ in truth.strips[truth.strips[:, 8] == thing]:
        if not _is_seen(truth, thing, (x0 + x1) / 2, (y0 + y1) / 2):
            continue
        if runs and np.hypot(runs[-1][-1][0] - x0, runs[-1][-1][1] - y0) < _GAP_PX:
            runs[-1].append([x1, y1, w1])
        else:
            runs.append([[x0, y0, w0], [x1, y1, w1]])
    return [np.array(run) for run in runs]


def _is_seen(truth: Truth, thing: int, x: float, y: float) -> bool:
    height_px, width_px = truth.numbers.shape
    u, v = min(max(round(x), 0), width_px - 1), min(max(round(y), 0), height_px - 1)
    return bool(np.any(truth.numbers[max(0, v - 1) : v + 2, max(0, u - 1) : u + 2] == thing))


def _outline(run: NDArray[np.float64]) -> NDArray[np.float64]:
    """The polygon (2 n, 2) [px] around a run: along its one side and back along the other."""
    steps = np.array([later[:2] - earlier[:2] for earlier, later in itertools.pairwise(run)])
    steps /= np.maximum(1e-9, np.linalg.norm(steps, axis=1))[:, None]
    along = np.vstack([steps[:1], (steps[:-1] + steps[1:]) / 2.0, steps[-1:]])
    half = np.maximum(_LEAST_PX, run[:, 2:]) / 2.0
    across = half * np.column_stack([-along[:, 1], along[:, 0]])
    return np.concatenate([run[:, :2] + across, (run[:, :2] - across)[::-1]])
