"""Lattice towers: four legs, crossed braces on each face, a straight cage above, cross-arms on it, and peaks.

A tower is drawn in its own frame: ahead along the line, right of it, up from its foot.
"""

import itertools
from collections.abc import Callable

from sitl.world.line_models import TowerModel
from sitl.world.records import Member
from sitl.world.route import Stand
from sitl.world.structure import Hold, Structure

Point = tuple[float, float, float]
"""Ahead, right, up [m] in the tower's frame."""

_LEG_M, _CAGE_M, _BRACE_M, _ARM_M = 0.20, 0.14, 0.08, 0.10
_CORNERS = ((1.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (-1.0, 1.0))
_ARM_DEPTH = 0.45  # of a level: how much higher an arm's upper chords start than its lower ones


def build_tower(
    tower: TowerModel, n_conductors: int, n_shield: int, stand: Stand, up_at: Callable[[float, float], float]
) -> Structure:
    """The members of a tower, and where it holds its conductors, level by level from the top, left before right.

    `up_at` tells the ground's height [m] at a place north, east [m]: on a slope each leg has its own length.
    """
    height_m = tower.height_m
    level_m = tower.level_m or 0.14 * height_m
    reach_m = tower.arm_m or 0.15 * height_m
    base_m = 0.5 * (tower.base_width_m or 0.17 * height_m)
    cage_m = min(0.5 * base_m, 0.025 * height_m + 0.1)
    tall = _levels(tower, n_conductors, level_m, reach_m)
    waist_m = tall[-1][0] - 0.25 * level_m
    top_m = tall[0][0] + _ARM_DEPTH * level_m

    bars: list[tuple[Point, Point, float]] = []
    bars += _body(base_m, cage_m, waist_m, 5)
    bars += _body(cage_m, cage_m, top_m - waist_m, max(3, round((top_m - waist_m) / (2.6 * cage_m))), waist_m)
    holds = []
    for up_m, sides in tall:
        for side, arm_m, n_on_arm in sides:
            bars += _cross_arm(cage_m, side, arm_m, up_m, _ARM_DEPTH * level_m)
            spacing_m = (arm_m - cage_m) / n_on_arm
            rights = sorted(side * (arm_m - k * spacing_m) for k in range(n_on_arm))
            holds += [Hold(right_m, up_m, up_m - tower.string_m) for right_m in rights]
    peaks = [0.0] if n_shield < 2 else [-0.5 * reach_m, 0.5 * reach_m]
    bars += [
        ((ahead * cage_m, right * cage_m, top_m), (0.0, peak_m, height_m), _ARM_M)
        for peak_m in peaks
        for ahead, right in _CORNERS
    ]
    shield_holds = tuple(Hold(peak_m, height_m, height_m) for peak_m in peaks[:n_shield])
    return Structure(tuple(_place(bar, stand, up_at) for bar in bars), tuple(holds), shield_holds)


def _levels(
    tower: TowerModel, n_conductors: int, level_m: float, reach_m: float
) -> list[tuple[float, list[tuple[float, float, int]]]]:
    """From the top: each level's height, and its arms as (side, reach, conductors on it)."""
    top_m = tower.height_m - 1.1 * level_m
    if tower.head == "one_level":
        if n_conductors == 3:  # two on the left arm would pull the tower over: the third has an arm of its own above
            return [(top_m, [(1.0, 0.75 * reach_m, 1)]), (top_m - level_m, [(-1.0, reach_m, 1), (1.0, reach_m, 1)])]
        return [(top_m, [(-1.0, reach_m, n_conductors // 2), (1.0, reach_m, n_conductors // 2)])]
    reaches = (0.82 * reach_m, reach_m, 0.82 * reach_m)
    if n_conductors == 3:
        return [(top_m - k * level_m, [((-1.0) ** k, arm_m, 1)]) for k, arm_m in enumerate(reaches)]
    return [
        (top_m - k * level_m, [(-1.0, arm_m, 1), (1.0, arm_m, 1)])
        for k, arm_m in enumerate(reaches[: max(1, n_conductors // 2)])
    ]


def _body(base_m: float, top_m: float, height_m: float, n_panels: int, from_m: float = 0.0) -> list[
    tuple[Point, Point, float]
]:  # fmt: skip
    """Legs from half-width `base_m` to `top_m`, in panels as high as they are wide, with crossed braces and girths."""
    ratio = (top_m / base_m) ** (1.0 / n_panels)
    shares = [ratio**k for k in range(n_panels)]
    bars: list[tuple[Point, Point, float]] = []
    low_m = 0.0
    thickness_m = _LEG_M if top_m < base_m else _CAGE_M
    for share in shares:
        high_m = low_m + height_m * share / sum(shares)
        rings = []
        for up_m in (low_m, high_m):
            half_m = base_m + (top_m - base_m) * up_m / height_m
            rings.append([(ahead * half_m, right * half_m, from_m + up_m) for ahead, right in _CORNERS])
        lower, upper = rings
        for k, j in itertools.pairwise((0, 1, 2, 3, 0)):
            bars += [
                (lower[k], upper[k], thickness_m),
                (lower[k], upper[j], _BRACE_M),
                (lower[j], upper[k], _BRACE_M),
                (upper[k], upper[j], _BRACE_M),
            ]
        low_m = high_m
    return bars


def _cross_arm(cage_m: float, side: float, reach_m: float, up_m: float, depth_m: float) -> list[
    tuple[Point, Point, float]
]:  # fmt: skip
    """Two lower chords, level, and two upper ones, down to the tip; with lacing between."""
    tip = (0.0, side * reach_m, up_m)
    bars: list[tuple[Point, Point, float]] = []
    for ahead in (-1.0, 1.0):
        low, high = (ahead * cage_m, side * cage_m, up_m), (ahead * cage_m, side * cage_m, up_m + depth_m)
        bars += [(low, tip, _ARM_M), (high, tip, _ARM_M)]
        for share in (0.3, 0.6):
            bars.append((_between(low, tip, share), _between(high, tip, share), _BRACE_M))
            bars.append((_between(low, tip, share), _between((-low[0], *low[1:]), tip, share + 0.15), _BRACE_M))
    return bars


def _between(start: Point, end: Point, share: float) -> Point:
    return (
        start[0] + share * (end[0] - start[0]),
        start[1] + share * (end[1] - start[1]),
        start[2] + share * (end[2] - start[2]),
    )


def _place(bar: tuple[Point, Point, float], stand: Stand, up_at: Callable[[float, float], float]) -> Member:
    """The bar in the world; what stands at the tower's foot goes down, or up, to the ground there."""
    ends = []
    for ahead_m, right_m, up_m in bar[:2]:
        north_m, east_m, down_m = stand.at(ahead_m, right_m, up_m)
        ends.append((north_m, east_m, -up_at(north_m, east_m) if up_m == 0.0 else down_m))
    return Member(ends[0], ends[1], bar[2], bar[2], "steel")
