"""Terrain: the heights of the ground, 0 where the vehicle starts."""

import math
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from sitl.place import Origin
from sitl.world.errors import WrongKey
from sitl.world.height_grid import HeightGrid
from sitl.world.height_map import read_height_map
from sitl.world.models import FlatModel, HeightMapModel, HillsModel
from sitl.world.records import PointNe

MARGIN_M = 100.0
_CELL_M = 4.0
_WIDEST_M = 12_000.0
_N_WAVES = 14


def build_terrain(
    model: FlatModel | HillsModel | HeightMapModel, places: Iterable[PointNe], origin: Origin, folder: Path
) -> HeightGrid:
    """The terrain over all `places` that things stand at, the start, and a margin.

    `folder` is the world file's. Raises WrongKey for a world too wide, and for a height map that cannot be read or
    does not reach so far.
    """
    norths, easts = zip((0.0, 0.0), *places, strict=True)
    bounds = (min(norths) - MARGIN_M, min(easts) - MARGIN_M, max(norths) + MARGIN_M, max(easts) + MARGIN_M)
    if max(bounds[2] - bounds[0], bounds[3] - bounds[1]) > _WIDEST_M:
        raise WrongKey("lines", f"the world is more than {_WIDEST_M / 1000:g} km wide; leave out what is far away")
    flat = HeightGrid.flat(*bounds, _CELL_M)
    if isinstance(model, FlatModel):
        return flat
    grid = _hills(model, flat) if isinstance(model, HillsModel) else read_height_map(model, flat, origin, folder)
    return HeightGrid(grid.south_m, grid.west_m, grid.cell_m, grid.up_m - np.float32(grid.at(0.0, 0.0)))


def _hills(model: HillsModel, over: HeightGrid) -> HeightGrid:
    """Waves that run in all directions, with phases and lengths by the seed: smooth, and the same however far it goes.

    The share of each wave makes the highest hills about `amplitude_m` high.
    """
    rng = np.random.default_rng(model.seed)
    rows, columns = over.up_m.shape
    north_m = (over.south_m + over.cell_m * np.arange(rows))[:, None]
    east_m = (over.west_m + over.cell_m * np.arange(columns))[None, :]
    up_m = np.zeros((rows, columns))
    first_rad = rng.uniform(0.0, math.pi)
    for k in range(_N_WAVES):
        heading_rad = first_rad + math.pi * k / _N_WAVES
        number_m = 2.0 * math.pi / (model.wavelength_m * rng.uniform(0.75, 1.5))
        phase_rad = rng.uniform(0.0, 2.0 * math.pi)
        up_m += np.sin(number_m * (north_m * math.cos(heading_rad) + east_m * math.sin(heading_rad)) + phase_rad)
    up_m *= model.amplitude_m / (2.0 * math.sqrt(0.5 * _N_WAVES))  # of two standard deviations
    return HeightGrid(over.south_m, over.west_m, over.cell_m, up_m.astype(np.float32))
