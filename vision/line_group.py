"""The line group: which of the conductors are the power line, which way it runs and where its middle passes."""

import itertools
import math

import numpy as np

from vision.conductors import Conductor
from vision.orientation import line_angle_distance_rad, main_angle_rad
from vision.records import ImageLine

_BEND_OVERLAP = 0.05  # share of the diagonal by which two pieces of one bent conductor may overlap


def choose_group(
    conductors: list[Conductor], tolerance_rad: float, min_support: float, min_contrast: float
) -> tuple[list[Conductor], float | None]:
    """The conductors of the power line, and its main angle [rad] by the histogram of oriented segments ([Ceron] 6.1).

    A conductor weighs in the histogram by the square of its length, coherence and contrast: one across the frame
    outweighs many joints of a pavement. Near the main angle, within `tolerance_rad`, those stay that have the share
    `min_support` of the best one's support and `min_contrast` of the best one's contrast, because the conductors of
    one line look alike. The angle is None where there is no conductor at all.
    """
    angles_rad = np.array([conductor.angle_rad for conductor in conductors])
    weights = np.array([(c.coherence * c.length_px * c.contrast) ** 2 for c in conductors])
    angle_rad = main_angle_rad(angles_rad, weights)
    if angle_rad is None:
        return [], None
    is_near = line_angle_distance_rad(angles_rad, angle_rad) <= tolerance_rad
    near = [conductor for conductor, keeps in zip(conductors, is_near, strict=True) if keeps]
    best_support = max(conductor.support for conductor in near)
    near = [conductor for conductor in near if conductor.support >= min_support * best_support]
    best_contrast = max(conductor.contrast for conductor in near)
    return [conductor for conductor in near if conductor.contrast >= min_contrast * best_contrast], angle_rad


def offset_px(conductor: Conductor, angle_rad: float, shape: tuple[int, int]) -> float:
    """Where the conductor passes the image centre [px], abreast of it seen along `angle_rad` (LineEstimate.offset_px).

    `shape` is the frame's (height, width).
    """
    x1, y1, x2, y2 = conductor.axis
    along_x, along_y = math.sin(angle_rad), -math.cos(angle_rad)
    from_x, from_y = x1 - (shape[1] - 1) / 2, y1 - (shape[0] - 1) / 2
    advance = (x2 - x1) * along_x + (y2 - y1) * along_y
    step = -(from_x * along_x + from_y * along_y) / advance
    abreast_x, abreast_y = from_x + step * (x2 - x1), from_y + step * (y2 - y1)
    return -abreast_x * along_y + abreast_y * along_x


def middle_offset_px(conductors: list[Conductor], angle_rad: float, shape: tuple[int, int]) -> float:
    """Offset [px] of the line halfway between the two outermost of `conductors`, at least one."""
    offsets_px = [offset_px(conductor, angle_rad, shape) for conductor in conductors]
    return 0.5 * (min(offsets_px) + max(offsets_px))


def abreast(conductors: list[Conductor], angle_rad: float, shape: tuple[int, int]) -> list[Conductor]:
    """The conductors that one cut across the group meets, the fullest of all cuts; `shape` is (height, width).

    Two pieces one behind the other, seen along `angle_rad`, are one conductor, bent where a pole holds it.
    """
    spans: list[tuple[float, float]] = []
    for conductor in conductors:
        x1, y1, x2, y2 = conductor.axis
        ends = (x * math.sin(angle_rad) - y * math.cos(angle_rad) for x, y in ((x1, y1), (x2, y2)))
        low, high = sorted(ends)
        spans.append((low, high))
    # The fullest cut is among those just behind a span's start.
    slack_px = _BEND_OVERLAP * math.hypot(*shape)
    cuts = ([low <= start + slack_px <= high for low, high in spans] for start, _ in spans)
    return list(itertools.compress(conductors, max(cuts, key=sum, default=[])))


def spacing_px(conductors: list[Conductor], angle_rad: float, shape: tuple[int, int]) -> float | None:
    """Median distance [px] of neighbours among conductors abreast of each other; None for fewer than two."""
    if len(conductors) < 2:
        return None
    offsets_px = sorted(offset_px(conductor, angle_rad, shape) for conductor in conductors)
    return float(np.median(np.diff(offsets_px)))


def one_by_one(conductors: list[Conductor], angle_rad: float, shape: tuple[int, int]) -> tuple[ImageLine, ...]:
    """Each of the conductors for itself, from left to right for one who looks along `angle_rad`."""
    from_left = sorted(conductors, key=lambda c: offset_px(c, angle_rad, shape))
    return tuple(ImageLine(c.angle_rad, offset_px(c, c.angle_rad, shape)) for c in from_left)
