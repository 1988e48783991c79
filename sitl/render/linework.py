"""What is too thin for a surface: conductors, towers, poles, rails, painted lines, fences, as objects of members."""

import itertools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sitl.render.daylight import daylight_of
from sitl.render.merge import DECAL, ROUND, SHADOW
from sitl.render.relief import height_at
from sitl.render.roadside import decals_of, fences_of, rails_of
from sitl.world.height_grid import HeightGrid
from sitl.world.records import Conductor, Light, Material, Member, World

_SUN_DIAMETER_RAD = math.radians(0.53)
_FAINTEST = 0.05  # of the light on level ground: what the sun must bring before its shadows show
_PER_OBJECT_M = 40.0
_SPAN_M = 120.0
_EVERY = 8
_FINE_TO_M = 30.0  # from there on, a conductor in pieces of 4 m lies within a twentieth of a pixel
_ALUMINIUM_BGR = (0.62, 0.61, 0.59)
_GALVANISED_BGR = (0.50, 0.50, 0.49)
_BGR: dict[Material, tuple[float, float, float]] = {
    "concrete": (0.47, 0.54, 0.57),
    "wood": (0.15, 0.21, 0.28),
    "steel": (0.40, 0.41, 0.41),
    "porcelain": (0.20, 0.24, 0.36),
}
_SURFACE: dict[Material, tuple[float, float, float]] = {  # ambient, direct, gloss
    "concrete": (0.34, 0.66, 0.0),
    "wood": (0.34, 0.66, 0.0),
    "steel": (0.40, 0.60, 0.2),
    "porcelain": (0.40, 0.55, 0.5),
}
_WIRE = (0.45, 0.55, 0.55)


@dataclass(frozen=True, slots=True, eq=False)
class Linework:
    """Objects that are drawn one after the other, each made of straight members and of discs on top of them.

    `members` (n, 9) and `discs` (m, 5) float64 are what sitl.render.projection's kernels take. For each object,
    `spans` (k, 4) int64 tells its first member, the one after its last, and the same of its discs; `looks` (k, 16)
    float64 has (ambient, direct, gloss) in the day's light, its linear BGR, its kind (sitl.render.merge), the centre
    NED [m] and the radius [m] of a ball round it, how deep [m] in the ground it still shows, by how much [m] it
    counts as nearer than what it is fixed to, from and up to what distance of the ball [m] it is drawn, and its largest
    diameter [m].
    """

    members: NDArray[np.float64]
    discs: NDArray[np.float64]
    spans: NDArray[np.int64]
    looks: NDArray[np.float64]


def build_linework(world: World, wire_at_least_m: float = 0.0) -> Linework:
    """All of the world's linework in its light.

    A map draws its conductors at least `wire_at_least_m` [m] thick; their shadows keep to the truth.
    """
    build = _Builder(world.light)
    sun_ned = np.array(world.light.direction_ned)
    bars = [member for support in world.supports for member in support.members]
    wires = [_thinned(rows) for conductor in world.conductors for rows in _spans_of(conductor)]
    fences = fences_of(world.strips, world.terrain)
    if build.casts_shadows:
        lie = [cast_shadow(rows, sun_ned, world.terrain) for rows in (*wires, _rows(bars), *fences) if len(rows)]
        for rows in (pieces for shadow in lie for pieces in _pieces(shadow)):
            build.add(rows, SHADOW, build.shade_bgr, slack_m=0.5)
    for rows, bgr in decals_of(world.strips, world.terrain):
        for piece in _pieces(rows):
            build.add(piece, DECAL, bgr, slack_m=0.5)
    for rows in rails_of(world.strips, world.terrain):
        build.add(rows, ROUND, (0.50, 0.50, 0.50), _SURFACE["steel"], slack_m=0.5)
    for rows in fences:
        build.add(rows, ROUND, _BGR["wood"], _SURFACE["wood"], slack_m=0.3)
    for support in world.supports:
        for material in _BGR:
            own = [member for member in support.members if member.material == material]
            if own:
                build.add(_rows(own), ROUND, _BGR[material], _SURFACE[material], tops=own, slack_m=0.3)
    for conductor in world.conductors:
        bgr = _GALVANISED_BGR if conductor.is_shield else _ALUMINIUM_BGR
        for rows in _spans_of(conductor):
            rows[:, 6:8] = np.maximum(rows[:, 6:8], wire_at_least_m)
            build.add(rows, ROUND, bgr, _WIRE, slack_m=0.1, nearer_m=0.05, to_m=_FINE_TO_M)
            build.add(_thinned(rows), ROUND, bgr, _WIRE, slack_m=0.1, nearer_m=0.05, from_m=_FINE_TO_M)
    return build.linework()


class _Builder:
    """Collects objects; keeps what the day's light makes of all of them."""

    def __init__(self, light: Light) -> None:
        day = daylight_of(light)
        self._tint = day.table[0] + day.table[1]
        self._tint = self._tint / max(1e-6, float(self._tint.mean()))
        self._sun, self._sky = light.direct / 0.58, light.sky / 0.42  # as shares of a clear noon's
        height = max(0.0, -light.direction_ned[2])
        self._upright = 0.42 * self._sky + 0.58 * self._sun * height
        total = day.level_bgr
        self.shade_bgr = tuple(float(v) for v in np.asarray(day.table[1], dtype=np.float64) / np.maximum(total, 1e-9))
        self.casts_shadows = light.direct * height > _FAINTEST * light.sky and height > 0.02
        self._members: list[NDArray[np.float64]] = []
        self._discs: list[list[float]] = []
        self._spans: list[tuple[int, int, int, int]] = []
        self._looks: list[tuple[float, ...]] = []
        self._n = 0

    def add(
        self,
        rows: NDArray[np.float64],
        kind: int,
        bgr: tuple[float, ...],
        surface: tuple[float, float, float] = (0.0, 0.0, 0.0),
        *,
        tops: list[Member] | None = None,
        slack_m: float,
        nearer_m: float = 0.0,
        from_m: float = -math.inf,
        to_m: float = math.inf,
    ) -> None:
        """Add an object of members (n, 9)."""
        discs = [] if tops is None else _tops(tops, self._upright)
        self._spans.append((self._n, self._n + len(rows), len(self._discs), len(self._discs) + len(discs)))
        self._members.append(rows)
        self._discs += discs
        self._n += len(rows)
        ends = rows[:, :6].reshape(-1, 3)
        middle = (ends.min(axis=0) + ends.max(axis=0)) / 2.0
        widest_m = float(rows[:, 6:8].max())
        radius_m = float(np.linalg.norm(ends - middle, axis=1).max()) + widest_m
        if kind == ROUND:
            bgr = tuple(float(b * t) for b, t in zip(bgr, self._tint, strict=True))
        light = (surface[0] * self._sky, surface[1] * self._sun, surface[2] * self._sun)
        self._looks.append((*light, *bgr, float(kind), *middle, radius_m, slack_m, nearer_m, from_m, to_m, widest_m))

    def linework(self) -> Linework:
        """What was collected."""
        return Linework(
            np.ascontiguousarray(np.concatenate([*self._members, np.empty((0, 9))]), dtype=np.float64),
            np.array(self._discs, dtype=np.float64).reshape(-1, 5),
            np.array(self._spans, dtype=np.int64).reshape(-1, 4),
            np.array(self._looks, dtype=np.float64).reshape(-1, 16),
        )


def _rows(members: list[Member]) -> NDArray[np.float64]:
    rows = [[*m.start_ned_m, *m.end_ned_m, m.start_diameter_m, m.end_diameter_m, 1.0] for m in members]
    return np.array(rows, dtype=np.float64).reshape(-1, 9)


def _tops(members: list[Member], brightness: float) -> list[list[float]]:
    """The upper faces of what stands upright."""
    return [
        [*m.end_ned_m, m.end_diameter_m, brightness]
        for m in members
        if m.start_ned_m[:2] == m.end_ned_m[:2] and m.end_ned_m[2] < m.start_ned_m[2]
    ]


def _pieces(rows: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Members that follow each other, in groups that reach about as far as one looks at once."""
    length_m = np.hypot(rows[:, 3] - rows[:, 0], rows[:, 4] - rows[:, 1])
    group = np.floor(np.cumsum(length_m) / _PER_OBJECT_M).astype(int)
    return np.split(rows, np.flatnonzero(np.diff(group)) + 1)


def _spans_of(conductor: Conductor) -> list[NDArray[np.float64]]:
    """A conductor's pieces as members, in objects that end where it is highest: at its supports."""
    points = conductor.points_ned_m
    n = len(points) - 1
    rows = np.hstack([points[:-1], points[1:], np.full((n, 2), conductor.diameter_m), np.ones((n, 1))])
    up_m = -points[:, 2]
    peaks = 1 + np.flatnonzero((up_m[1:-1] > up_m[:-2]) & (up_m[1:-1] >= up_m[2:]))
    come_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points[:, :2], axis=0).T))])
    cuts = []
    for first, last in itertools.pairwise([0, *peaks.tolist(), n]):
        parts = max(1, math.ceil((come_m[last] - come_m[first]) / _SPAN_M))
        cuts += [first + (last - first) * k // parts for k in range(parts)]
    return [piece for piece in np.split(rows, [cut for cut in cuts if cut > 0]) if len(piece)]


def _thinned(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """The same run of members in longer ones, each in the place of up to _EVERY."""
    firsts = rows[::_EVERY].copy()
    lasts = np.append(np.arange(_EVERY, len(rows), _EVERY) - 1, len(rows) - 1)
    firsts[:, 3:6], firsts[:, 7] = rows[lasts, 3:6], rows[lasts, 7]
    return firsts


def cast_shadow(members: NDArray[np.float64], sun_ned: NDArray[np.float64], terrain: HeightGrid) -> NDArray[np.float64]:
    """The shadows (n, 9) that members (n, 9) cast on the terrain, as ribbons whose brightness is their depth.

    The sun is no point: a shadow's edge softens with the distance it falls, and what is thinner than that half-shadow
    takes only its own part of the sun away. So a ribbon is as wide as the half-shadow and as much fainter.
    """
    shadows = members.copy()
    place = np.array([terrain.south_m, terrain.west_m, terrain.cell_m])
    for start, diameter in ((0, 6), (3, 7)):
        up_m = -members[:, start + 2]
        for k, (north_m, east_m) in enumerate(members[:, start : start + 2]):
            ground_m, path_m = height_at(terrain.up_m, place, north_m, east_m), 0.0
            for _ in range(6):  # a level patch, then the one where the shadow falls on it, and so on
                path_m = max(0.0, float(up_m[k]) - ground_m) / -sun_ned[2]
                shadows[k, start : start + 2] = (
                    north_m - path_m * sun_ned[0],
                    east_m - path_m * sun_ned[1],
                )
                ground_m = height_at(terrain.up_m, place, shadows[k, start], shadows[k, start + 1])
            shadows[k, start + 2] = -ground_m
            shadows[k, diameter] = max(members[k, diameter], path_m * _SUN_DIAMETER_RAD)
    shadows[:, 8] = (members[:, 6] + members[:, 7]) / (shadows[:, 6] + shadows[:, 7])
    return shadows
