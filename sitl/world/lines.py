"""Builds one power line of a world file: supports on their ground, with conductors, shield wires and insulators."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace

from sitl.world.errors import WrongKey
from sitl.world.height_grid import HeightGrid
from sitl.world.line_models import LineModel, TowerModel
from sitl.world.poles import build_pole
from sitl.world.records import PointNe, PowerLine, Support
from sitl.world.route import Stand
from sitl.world.stringing import bundle_offsets, insulators, runs, string_conductor
from sitl.world.structure import Hold, Structure
from sitl.world.towers import build_tower


def build_line(line: LineModel, on_level: Sequence[Stand], terrain: HeightGrid, key: str) -> PowerLine:
    """Build a line on its stands; `key` is its own in the file. Raises WrongKey when a conductor cannot hang."""
    stands = [replace(stand, up_m=terrain.at(*stand.place_ne_m)) for stand in on_level]
    spans = list(itertools.pairwise(stands))
    structures = [_structure(line, stand, terrain) for stand in stands]
    for structure in structures[:1]:
        low_m = min(hold.wire_m for hold in structure.holds)
        if low_m <= 0.0:
            raise WrongKey(f"{key}.support", f"it holds its lowest conductor {low_m:.1f} m over the ground")
    line_runs = runs(len(spans), line.missing_spans)
    conductors = []
    n_conductors = len(structures[0].holds)
    offsets = bundle_offsets(line.conductors.n_bundle, line.conductors.bundle_spacing_m)
    for k in range(n_conductors):
        for offset in offsets:
            holds = [structure.holds[k] for structure in structures]
            conductors += string_conductor(stands, line_runs, holds, line.conductors, f"{key}.conductors", offset)
    if line.shield_wires is not None:
        for k in range(line.shield_wires.n):
            holds = [structure.shield_holds[k] for structure in structures]
            conductors += string_conductor(
                stands, line_runs, holds, line.shield_wires, f"{key}.shield_wires", is_shield=True
            )
    supports = tuple(
        Support(
            line.support.kind,
            stand.at(0.0, 0.0, 0.0),
            stand.at(0.0, 0.0, line.support.height_m),
            stand.heading_rad,
            structure.members
            + tuple(
                insulator for hold in structure.holds for insulator in insulators(stands, line_runs, i, hold)
            ),
        )
        for i, (stand, structure) in enumerate(zip(stands, structures, strict=True))
    )  # fmt: skip
    axis = tuple(_middle(stand, structure.holds) for stand, structure in zip(stands, structures, strict=True))
    return PowerLine(axis, supports, tuple(conductors))


def _structure(line: LineModel, stand: Stand, terrain: HeightGrid) -> Structure:
    n = line.conductors.n
    if isinstance(line.support, TowerModel):
        n_shield = 0 if line.shield_wires is None else line.shield_wires.n
        return build_tower(line.support, n, n_shield, stand, terrain.at)
    return build_pole(line.support, n, stand)


def _middle(stand: Stand, holds: Sequence[Hold]) -> PointNe:
    """Halfway between the outermost holds, on the map."""
    rights_m = [hold.right_m for hold in holds]
    return stand.at(0.0, math.fsum((min(rights_m), max(rights_m))) / 2.0, 0.0)[:2]
