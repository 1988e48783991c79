"""The truth of a picture: what every pixel shows of the power lines, how far it is, and where the wires run."""

import enum
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from sitl.pose import Pose
from sitl.render.lens import camera_pose, lens_vector
from sitl.render.renderer import Renderer
from sitl.render.truth.strips import find_strips, mark_strips
from sitl.world.records import SupportKind, World

NOTHING = -1
"""The number of what is no part of a power line."""

Category = Literal["conductor", "shield_wire", SupportKind]
CATEGORIES: tuple[Category, ...] = ("conductor", "shield_wire", *get_args(SupportKind))
"""What is labelled; a category's number is its place here, from 0 in YOLO and from 1 in COCO."""

_SMALLEST_BOX_PX = 6
_LOOK_PX = 2.0  # how far apart a line's visibility is looked at


class MaskValue(enum.IntEnum):
    """What a pixel of the mask shows."""

    NOTHING = 0
    CONDUCTOR = 1
    SUPPORT = 2
    SHIELD_WIRE = 3


@dataclass(frozen=True, slots=True)
class Box:
    """Something in the picture: the tight rectangle around its visible pixels, from its first to beyond its last [px].

    `thing` is its number in Truth.numbers. With the centre of the first pixel at (0, 0), a pixel's edges lie half a
    pixel around it; here, as in COCO, they are whole numbers: the first pixel goes from 0 to 1.
    """

    thing: int
    category: Category
    left: int
    top: int
    right: int
    bottom: int


@dataclass(frozen=True, slots=True, eq=False)
class TrueLine:
    """A conductor in the picture.

    `pieces` is (n, 5) float64: x1, y1, x2, y2 [px] of straight pieces as Renderer.project gives them, and the part of
    each that is visible, 0 to 1.
    """

    thing: int
    is_shield: bool
    pieces: NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Truth:
    """What is truly in a picture; arrays are (height, width).

    `numbers` int32 is which thing a pixel shows, NOTHING for none: conductors in the world's order, then its supports.
    `mask` uint8 holds MaskValues. `depth_m` float32 [m] along the camera's axis is infinite where there is sky.
    `strips` (n, 9) float64 is strips.find_strips' with the thing's number last.
    """

    numbers: NDArray[np.int32]
    mask: NDArray[np.uint8]
    depth_m: NDArray[np.float32]
    lines: tuple[TrueLine, ...]
    boxes: tuple[Box, ...]
    strips: NDArray[np.float64]


class TruthFinder:
    """Finds the truth of what one renderer renders."""

    def __init__(self, renderer: Renderer) -> None:
        self._world = world = renderer.world
        self._renderer = renderer
        self._lens = lens_vector(renderer.intrinsics)
        x, y = renderer.rays
        self._view = np.array([x.min(), x.max(), y.min(), y.max()], dtype=np.float64)
        self._members, self._thing = _members(world)
        values = [MaskValue.SHIELD_WIRE if wire.is_shield else MaskValue.CONDUCTOR for wire in world.conductors]
        values += [MaskValue.SUPPORT] * len(world.supports)
        # NOTHING is -1: the last entry.
        self._values = np.array([*values, MaskValue.NOTHING], dtype=np.uint8)
        self._categories: list[Category] = [
            "shield_wire" if wire.is_shield else "conductor" for wire in world.conductors
        ] + [support.kind for support in world.supports]

    def find(self, pose: Pose) -> Truth:
        """The truth of the picture that a renderer makes at a pose, standing still."""
        centre, ned_from_camera = camera_pose(pose, self._renderer.mount)
        camera_from_ned = np.ascontiguousarray(ned_from_camera.T)
        strips = find_strips(self._members, centre, camera_from_ned, self._lens, self._view)
        depth_m = self._renderer.depth(pose).copy()
        numbers = np.full(depth_m.shape, NOTHING, dtype=np.int32)
        mark_strips(numbers, depth_m, strips, self._thing)
        strips[:, 8] = self._thing[strips[:, 8].astype(int)]
        return Truth(
            numbers=numbers,
            mask=self._values[numbers],
            depth_m=depth_m,
            lines=self._lines(pose, numbers),
            boxes=self._boxes(numbers),
            strips=strips,
        )

    def _lines(self, pose: Pose, numbers: NDArray[np.int32]) -> tuple[TrueLine, ...]:
        return tuple(
            TrueLine(thing, wire.is_shield, np.column_stack([pieces, _visible_parts(pieces, numbers, thing)]))
            for thing, (wire, pieces) in enumerate(
                zip(self._world.conductors, self._renderer.project(pose), strict=True)
            )
            if len(pieces)
        )

    def _boxes(self, numbers: NDArray[np.int32]) -> tuple[Box, ...]:
        boxes = []
        rows, columns = np.nonzero(numbers != NOTHING)
        seen = numbers[rows, columns]
        for thing in np.unique(seen).tolist():
            own = seen == thing
            top, bottom = int(rows[own].min()), int(rows[own].max()) + 1
            left, right = int(columns[own].min()), int(columns[own].max()) + 1
            if max(right - left, bottom - top) >= _SMALLEST_BOX_PX:
                boxes.append(Box(thing, self._categories[thing], left, top, right, bottom))
        return tuple(boxes)


def _visible_parts(pieces: NDArray[np.float64], numbers: NDArray[np.int32], thing: int) -> NDArray[np.float64]:
    """The part of each piece (n, 4) along which a pixel at most one away shows the thing."""
    height_px, width_px = numbers.shape
    parts = np.empty(len(pieces))
    for k, (x1, y1, x2, y2) in enumerate(pieces):
        n = 2 + int(np.hypot(x2 - x1, y2 - y1) / _LOOK_PX)
        along = (np.arange(n) + 0.5) / n
        u, v = np.round(x1 + along * (x2 - x1)).astype(int), np.round(y1 + along * (y2 - y1)).astype(int)
        is_seen = np.zeros(n, dtype=bool)
        for du, dv in ((0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)):
            is_seen |= numbers[np.clip(v + dv, 0, height_px - 1), np.clip(u + du, 0, width_px - 1)] == thing
        parts[k] = is_seen.mean()
    return parts


def _members(world: World) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """All straight members, (n, 8) as find_strips takes them, and the number of the thing each belongs to."""
    rows, things = [np.empty((0, 8))], [np.empty(0, dtype=np.int32)]
    for thing, wire in enumerate(world.conductors):
        points = wire.points_ned_m
        n = len(points) - 1
        rows.append(np.hstack([points[:-1], points[1:], np.full((n, 2), wire.diameter_m)]))
        things.append(np.full(n, thing, dtype=np.int32))
    for i, support in enumerate(world.supports):
        bars = [[*m.start_ned_m, *m.end_ned_m, m.start_diameter_m, m.end_diameter_m] for m in support.members]
        rows.append(np.array(bars, dtype=np.float64).reshape(-1, 8))
        things.append(np.full(len(bars), len(world.conductors) + i, dtype=np.int32))
    return np.concatenate(rows), np.concatenate(things)
