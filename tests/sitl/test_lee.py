"""The lee is where it has to be, as deep as wind-breaks' literature has it, and ends."""

import itertools
import math

import numpy as np
import pytest

from sitl.lee import Lee, height_at, reduction_at, reduction_behind
from sitl.wind import ROUGHNESS_M, Wind
from sitl.world.height_grid import HeightGrid

TERRAIN = HeightGrid.flat(-300.0, -300.0, 300.0, 300.0, 2.0)
BREAK_M = 10.0
FROM_NORTH_RAD = 0.0


def with_block(north_m: tuple[float, float], east_m: tuple[float, float]) -> HeightGrid:
    """The terrain with something 10 m high on it."""
    up_m = np.zeros_like(TERRAIN.up_m)
    rows = [round((n - TERRAIN.south_m) / TERRAIN.cell_m) for n in north_m]
    columns = [round((e - TERRAIN.west_m) / TERRAIN.cell_m) for e in east_m]
    up_m[rows[0] : rows[1] + 1, columns[0] : columns[1] + 1] = BREAK_M
    return HeightGrid(TERRAIN.south_m, TERRAIN.west_m, TERRAIN.cell_m, up_m)


HEDGEROW = with_block((0.0, 4.0), (-200.0, 200.0))
TREE = with_block((0.0, 4.0), (-2.0, 2.0))


def lost(surface: HeightGrid, south_m: float, up_m: float, east_m: float = 0.0, from_rad: float = 0.0) -> float:
    return Lee(surface, TERRAIN, from_rad, ROUGHNESS_M).reduction((-south_m, east_m, -up_m))


def test_a_row_of_trees_takes_half_of_the_wind_at_five_heights_and_a_sixth_at_fifteen() -> None:
    assert lost(HEDGEROW, 5 * BREAK_M, 0.5 * BREAK_M) == pytest.approx(0.5, abs=0.1)
    assert lost(HEDGEROW, 15 * BREAK_M, 0.5 * BREAK_M) == pytest.approx(1 / 6, abs=0.04)


def test_the_lee_fades_with_the_distance_and_ends_at_twenty_heights() -> None:
    fading = [lost(HEDGEROW, heights * BREAK_M, 0.5 * BREAK_M) for heights in (5, 8, 11, 14, 17)]
    assert fading == sorted(fading, reverse=True)
    assert lost(HEDGEROW, 21.5 * BREAK_M, 0.5 * BREAK_M) == 0.0


def test_high_above_and_upwind_the_wind_blows_as_ever() -> None:
    assert lost(HEDGEROW, 5 * BREAK_M, 3.0 * BREAK_M) < 0.01
    assert lost(HEDGEROW, -3 * BREAK_M, 0.5 * BREAK_M) == 0.0
    assert lost(HEDGEROW, 5 * BREAK_M, 0.5 * BREAK_M, from_rad=math.pi) == 0.0


def test_a_single_tree_shelters_less_and_only_behind_itself() -> None:
    assert 0.0 < lost(TREE, 5 * BREAK_M, 0.5 * BREAK_M) < 0.7 * lost(HEDGEROW, 5 * BREAK_M, 0.5 * BREAK_M)
    assert lost(TREE, 5 * BREAK_M, 0.5 * BREAK_M, east_m=30.0) == 0.0


def test_heights_count_over_the_ground_they_stand_on() -> None:
    hill = HeightGrid(TERRAIN.south_m, TERRAIN.west_m, TERRAIN.cell_m, TERRAIN.up_m + 100.0)
    on_hill = HeightGrid(TERRAIN.south_m, TERRAIN.west_m, TERRAIN.cell_m, HEDGEROW.up_m + 100.0)
    lee = Lee(on_hill, hill, FROM_NORTH_RAD, ROUGHNESS_M)
    assert lee.reduction((-50.0, 0.0, -105.0)) == pytest.approx(lost(HEDGEROW, 50.0, 5.0))
    assert Lee(hill, hill, FROM_NORTH_RAD, ROUGHNESS_M).reduction((0.0, 0.0, -105.0)) == 0.0


def test_in_the_lee_the_mean_falls_and_the_turbulence_grows() -> None:
    def flown(lee: Lee | None) -> np.ndarray:
        wind = Wind(8.0, seed=3, from_rad=FROM_NORTH_RAD)
        wind.lee = lee
        return np.array([wind.step(0.05, 5.0, 8.0, (-50.0, 0.0, -5.0)) for _ in range(20_000)])

    lee = Lee(HEDGEROW, TERRAIN, FROM_NORTH_RAD, ROUGHNESS_M)
    share = lee.reduction((-50.0, 0.0, -5.0))
    inside, open_field = flown(lee), flown(None)
    gusts = inside.std(axis=0) / open_field.std(axis=0)
    assert gusts == pytest.approx([1 + min(share, 0.5)] * 3, rel=1e-3)
    calmed = inside[:, 0].mean() - (1 + min(share, 0.5)) * (open_field[:, 0] + Wind(8.0, 3).mean_m_s(5.0)).mean()
    assert -calmed == pytest.approx((1 - share) * Wind(8.0, 3).mean_m_s(5.0), rel=1e-3)


def test_the_lee_comes_smoothly_to_a_vehicle_that_flies_into_it() -> None:
    lee = Lee(HEDGEROW, TERRAIN, FROM_NORTH_RAD, ROUGHNESS_M)
    losses = [lee.step(0.02, (60.0 - 0.1 * n, 0.0, -5.0)) for n in range(2_000)]
    assert losses[0] == 0.0
    assert losses[-1] > 0.15
    assert max(abs(after - before) for before, after in itertools.pairwise(losses)) < 0.03


def test_the_kernels_do_compiled_what_they_do_in_python() -> None:
    grid = (TERRAIN.south_m, TERRAIN.west_m, TERRAIN.cell_m)
    draw = np.random.default_rng(2)
    hills = draw.uniform(0.0, 12.0, (40, 50)).astype(np.float32)
    for north_m, east_m in draw.uniform(-400.0, 400.0, (30, 2)).tolist():
        assert height_at(hills, grid, north_m, east_m) == pytest.approx(height_at.py_func(hills, grid, north_m, east_m))
        x_m, z_m = abs(north_m), abs(east_m) / 20
        assert reduction_behind(x_m, z_m, 8.0, 0.05) == pytest.approx(reduction_behind.py_func(x_m, z_m, 8.0, 0.05))
    for place in ((-50.0, 0.0, 5.0), (-20.0, 3.0, 12.0)):
        arguments = (place, 0.3, HEDGEROW.up_m, grid, TERRAIN.up_m, grid, ROUGHNESS_M)
        assert reduction_at(*arguments) == pytest.approx(reduction_at.py_func(*arguments))
        assert reduction_at(*arguments) > 0.0
