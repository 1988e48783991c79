"""What of the power line there is to draw: layers of straight members, from the farthest below to the topmost."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sitl.world.records import Material, Member, World

_SUN_DIAMETER_RAD = math.radians(0.53)
_ALUMINIUM_BGR = (0.80, 0.79, 0.77)
_BGR: dict[Material, tuple[float, float, float]] = {
    "concrete": (0.47, 0.54, 0.57),
    "wood": (0.19, 0.26, 0.34),
    "steel": (0.16, 0.21, 0.25),
    "porcelain": (0.20, 0.24, 0.36),
}
_SURFACE: dict[Material, tuple[float, float, float]] = {  # ambient, direct, gloss
    "concrete": (0.34, 0.66, 0.0),
    "wood": (0.34, 0.66, 0.0),
    "steel": (0.40, 0.60, 0.2),
    "porcelain": (0.40, 0.55, 0.5),
}


@dataclass(frozen=True, slots=True, eq=False)
class Layer:
    """Members drawn together. What sitl.render.projection's kernels take; colours are linear light, 0 to 1.

    `members` (n, 9) and `discs` (n, 5) are float64, `material` is (ambient, direct, gloss) as (3,) float64, `bgr` (3,)
    float64. A shadow's layer darkens what lies below it instead of covering it.
    """

    members: NDArray[np.float64]
    discs: NDArray[np.float64]
    is_ribbon: bool
    is_shadow: bool
    material: NDArray[np.float64]
    bgr: NDArray[np.float64]


def build_layers(world: World, wire_at_least_m: float = 0.0) -> list[Layer]:
    """The world's line as layers, in drawing order.

    A map draws its conductors at least `wire_at_least_m` [m] thick; their shadows keep to the truth.
    """
    sun_ned = np.array(world.light.direction_ned)
    upright = 0.42 + 0.58 * -sun_ned[2]  # how bright a horizontal face is: sky and sun
    members = [member for support in world.supports for member in support.members]
    by_material = {material: [m for m in members if m.material == material] for material in _BGR}
    wires = [_wire(conductor.points_ned_m, conductor.diameter_m) for conductor in world.conductors]
    wire = np.concatenate([*wires, np.empty((0, 9))])
    drawn = wire.copy()
    drawn[:, 6:8] = np.maximum(wire[:, 6:8], wire_at_least_m)
    shadows = np.concatenate([cast_shadow(body, sun_ned) for body in (_rows(members), wire)])
    return [
        _layer(shadows, [], (0.0, 0.0, 0.0), (0.30, 0.24, 0.20), is_ribbon=True, is_shadow=True),
        *(
            _layer(_rows(bars), _tops(bars, upright), _SURFACE[material], _BGR[material])
            for material, bars in by_material.items()
            if bars
        ),
        _layer(drawn, [], (0.45, 0.55, 0.55), _ALUMINIUM_BGR),
    ]


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


def cast_shadow(members: NDArray[np.float64], sun_ned: NDArray[np.float64]) -> NDArray[np.float64]:
    """The shadows (n, 9) that members (n, 9) cast on the plane down = 0, as ribbons whose brightness is their depth.

    The sun is no point: a shadow's edge softens with the distance it falls, and what is thinner than that half-shadow
    takes only its own part of the sun away. So a ribbon is as wide as the half-shadow and as much fainter.
    """
    shadows = members.copy()
    for start, diameter in ((0, 6), (3, 7)):
        height_m = np.maximum(0.0, -members[:, start + 2])
        path_m = height_m / -sun_ned[2]
        shadows[:, start : start + 2] -= path_m[:, None] * sun_ned[:2]
        shadows[:, start + 2] = 0.0
        shadows[:, diameter] = np.maximum(members[:, diameter], path_m * _SUN_DIAMETER_RAD)
    shadows[:, 8] = (members[:, 6] + members[:, 7]) / (shadows[:, 6] + shadows[:, 7])
    return shadows


def _wire(points_ned_m: NDArray[np.float64], diameter_m: float) -> NDArray[np.float64]:
    n = len(points_ned_m) - 1
    return np.hstack([points_ned_m[:-1], points_ned_m[1:], np.full((n, 2), diameter_m), np.ones((n, 1))])


def _layer(
    members: NDArray[np.float64],
    discs: list[list[float]],
    material: tuple[float, float, float],
    bgr: tuple[float, float, float],
    *,
    is_ribbon: bool = False,
    is_shadow: bool = False,
) -> Layer:
    return Layer(
        members=np.ascontiguousarray(members, dtype=np.float64),
        discs=np.array(discs, dtype=np.float64).reshape(-1, 5),
        is_ribbon=is_ribbon,
        is_shadow=is_shadow,
        material=np.array(material),
        bgr=np.array(bgr),
    )
