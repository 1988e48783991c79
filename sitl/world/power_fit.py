"""Keeps an imported line off the ground: the map knows no ground, and tells no sags."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

from sitl.world.line_models import PoleModel, TowerModel
from sitl.world.poles import build_pole
from sitl.world.power_line_guess import Guess
from sitl.world.records import PointNe
from sitl.world.route import Stand
from sitl.world.towers import build_tower
from sitl.world.wires import WIRES

_ROOM_M = 5.0
_USUAL_SHARE, _TIGHTEST_SHARE = 0.15, 0.55  # of what the wire bears


@dataclass(frozen=True, slots=True)
class Fit:
    """The tension [N] that keeps a line's wires off level ground, None where the usual one does.

    `missing`, counted from 1, are too long for any tension.
    """

    tension_n: float | None
    missing: tuple[int, ...]
    longest_m: float


def fit(found: Guess, places: Sequence[PointNe]) -> Fit:
    """Find the tension for the longest span that can be hung at all."""
    wire = WIRES[found.wire]
    room_m = _lowest_hold_m(found) - _ROOM_M
    spans_m = [math.dist(here, there) for here, there in itertools.pairwise(places)]

    def needed_n(span_m: float) -> float:
        return wire.weight_n_m * span_m**2 / (8.0 * room_m)

    tightest_n = _TIGHTEST_SHARE * wire.strength_n
    missing = tuple(k for k, span_m in enumerate(spans_m, start=1) if needed_n(span_m) > tightest_n)
    longest_m = max((span_m for k, span_m in enumerate(spans_m, start=1) if k not in missing), default=0.0)
    needs_n = needed_n(longest_m)
    return Fit(None if needs_n <= _USUAL_SHARE * wire.strength_n else needs_n, missing, longest_m)


def _lowest_hold_m(found: Guess) -> float:
    """How high its lowest conductor is held."""
    support = {"kind": found.kind, "height_m": found.height_m, "head": found.head}
    stand = Stand((0.0, 0.0), 0.0, 0.0)
    if found.kind == "lattice_tower":
        tower = TowerModel.model_validate(support)
        structure = build_tower(tower, found.n, found.n_shield, stand, lambda _north_m, _east_m: 0.0)
    else:
        structure = build_pole(PoleModel.model_validate(support), found.n, stand)
    return min(hold.wire_m for hold in structure.holds)
