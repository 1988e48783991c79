"""Poles of medium and low voltage: a trunk with a cross-arm, or with brackets one below the other."""

from sitl.world.line_models import PoleModel
from sitl.world.records import Material, Member
from sitl.world.route import Stand
from sitl.world.structure import Hold, Structure

_ARM_M = {"cross_arm": (1.9, 0.35), "delta": (2.4, 0.9)}  # length, and how far below the top
_ARM_END_M = 0.15  # from the last pin to the arm's end
_PIN_M = 0.25
_TOP_PIN_M = 0.20
_LEVEL_M = 0.75  # between the conductors of a column
_BRACKET_M = 0.35
_MATERIAL: dict[str, Material] = {"wood_pole": "wood", "concrete_pole": "concrete", "steel_pole": "steel"}


def build_pole(pole: PoleModel, n_conductors: int, stand: Stand) -> Structure:
    """The members of a pole, and where it holds `n_conductors`: from left to right, or from the top down."""
    trunk = Member(
        stand.at(0.0, 0.0, 0.0),
        stand.at(0.0, 0.0, pole.height_m),
        pole.base_diameter_m,
        pole.top_diameter_m,
        _MATERIAL[pole.kind],
    )
    if pole.head == "column":
        holds = _column(pole, n_conductors)
        bars = [
            _bar(stand, (0.0, hold.fixed_m), (hold.right_m, hold.fixed_m), 0.06) for hold in holds if hold.right_m != 0
        ]
    elif n_conductors == 1:
        holds, bars = [_on_top(pole)], []
    else:
        length_m, below_m = _ARM_M[pole.head]
        length_m = pole.arm_length_m or length_m
        arm_m = pole.height_m - (pole.arm_below_top_m or below_m)
        reach_m = max(0.5 * length_m - _ARM_END_M, 0.25 * length_m)
        n_beside = n_conductors // 2
        spacing_m = reach_m / n_beside if n_conductors % 2 else 2.0 * reach_m / (n_conductors - 1)
        beside = [reach_m - k * spacing_m for k in range(n_beside)]
        holds = [Hold(-right_m, arm_m, arm_m + _PIN_M) for right_m in beside]
        holds += [_on_top(pole)] if n_conductors % 2 else []
        holds += [Hold(right_m, arm_m, arm_m + _PIN_M) for right_m in reversed(beside)]
        bars = [_bar(stand, (-0.5 * length_m, arm_m), (0.5 * length_m, arm_m), pole.arm_thickness_m)]
    return Structure((trunk, *bars), tuple(holds))


def _on_top(pole: PoleModel) -> Hold:
    return Hold(0.0, pole.height_m, pole.height_m + _TOP_PIN_M)


def _column(pole: PoleModel, n_conductors: int) -> list[Hold]:
    """The topmost conductor on the pole's top, each other one on a bracket, by turns to the left and right."""
    holds = [_on_top(pole)]
    for k in range(1, n_conductors):
        height_m = pole.height_m - k * _LEVEL_M
        side = -1.0 if k % 2 else 1.0
        holds.append(Hold(side * (0.5 * pole.base_diameter_m + _BRACKET_M), height_m, height_m + _PIN_M))
    return holds


def _bar(stand: Stand, start: tuple[float, float], end: tuple[float, float], thickness_m: float) -> Member:
    """A steel bar across the line, from and to (right, height)."""
    return Member(stand.at(0.0, *start), stand.at(0.0, *end), thickness_m, thickness_m, "steel")
