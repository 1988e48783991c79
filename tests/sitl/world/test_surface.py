"""The surface stands as high as what is there."""

import numpy as np
import pytest

from sitl.world.height_grid import HeightGrid
from sitl.world.records import Building, Strip, Tree
from sitl.world.surface import (
    HEDGE_HEIGHT_M,
    building_row,
    bumps,
    crown_up_m,
    hedge_rows,
    lattice,
    raise_crowns,
    raise_hedges,
    raise_roof,
    refine,
    surface_of,
    tree_rows,
)
from tests.sitl.render.scenes import scene

TREES = tuple(
    Tree(kind, 12.0 * k - 20.0, 5.0, 9.0, 3.0) for k, kind in enumerate(("broadleaf", "conifer", "poplar", "bush"))
)
HEDGE = Strip("hedge", ((-20.0, -20.0), (0.0, -20.0), (20.0, -10.0)), 1.5)


def test_an_empty_world_is_its_terrain() -> None:
    world = scene()
    assert surface_of(world) is world.terrain


def test_a_gable_roof_has_its_ridge_along_its_length() -> None:
    house = Building((10.0, -5.0), np.pi / 2, 12.0, 8.0, 4.0, 6.0, "tile")  # its length runs east
    surface = surface_of(scene(buildings=(house,)))
    assert surface.at(10.0, -5.0) == pytest.approx(6.0, abs=0.02)
    assert surface.at(10.0, -0.5) == pytest.approx(6.0, abs=0.02)
    assert surface.at(12.0, -5.0) == pytest.approx(5.0, abs=0.02)
    assert surface.at(13.9, -5.0) == pytest.approx(4.05, abs=0.1)
    assert surface.at(14.6, -5.0) == 0.0
    assert surface.at(10.0, 1.6) == 0.0


@pytest.mark.parametrize("tree", TREES, ids=lambda tree: tree.kind)
def test_a_crown_reaches_its_height_within_its_radius(tree: Tree) -> None:
    surface = surface_of(scene(trees=(tree,)))
    north_m = surface.south_m + surface.cell_m * np.arange(surface.up_m.shape[0]) - tree.north_m
    east_m = surface.west_m + surface.cell_m * np.arange(surface.up_m.shape[1]) - tree.east_m
    away_m = np.hypot(north_m[:, None], east_m[None, :])
    assert np.all(surface.up_m[away_m > 1.15 * tree.crown_radius_m] == 0.0)
    assert surface.up_m.max() == pytest.approx(tree.height_m, rel=0.25)
    assert np.mean(surface.up_m[away_m < 0.5 * tree.crown_radius_m] > 0.2 * tree.height_m) > 0.9


def test_things_stand_on_the_terrain() -> None:
    terrain = HeightGrid(-48.0, -48.0, 4.0, np.tile(np.linspace(-5.0, 5.0, 25)[:, None], (1, 25)))
    surface = surface_of(
        scene(terrain=terrain, trees=TREES[:1], buildings=(Building((24.0, 0.0), 0.0, 8.0, 8.0, 3.0, 3.0, "flat"),))
    )
    assert surface.at(24.0, 0.0) == pytest.approx(terrain.at(24.0, 0.0) + 3.0, abs=0.02)
    assert surface.bounds_ne_m == pytest.approx(terrain.bounds_ne_m)
    for place in ((-40.0, 30.0), (3.3, -41.7)):
        assert surface.at(*place) == pytest.approx(terrain.at(*place), abs=1e-4)


def test_a_hedge_is_as_high_all_along() -> None:
    surface = surface_of(scene(strips=(HEDGE,)))
    along = [surface.at(n, -20.0) for n in np.arange(-19.0, -0.5, 0.5)]
    assert min(along) > 0.6 * HEDGE_HEIGHT_M
    assert surface.up_m.max() < 1.3 * HEDGE_HEIGHT_M
    assert surface.at(-10.0, -22.0) == 0.0


def test_the_same_world_has_the_same_surface() -> None:
    one, other = (surface_of(scene(trees=TREES, strips=(HEDGE,))) for _ in range(2))
    np.testing.assert_array_equal(one.up_m, other.up_m)


def test_compiled_kernels_equal_plain_python() -> None:
    for place in ((0.3, 0.2), (-1.7, 2.1)):
        assert bumps(*place) == pytest.approx(bumps.py_func(*place), abs=1e-12)
        for kind in range(4):
            arguments = (*place, 9.0, 3.0, kind, 17.3)
            assert crown_up_m(*arguments) == pytest.approx(crown_up_m.py_func(*arguments), abs=1e-9)
    assert [lattice(i, -3) for i in range(5)] == [lattice.py_func(i, -3) for i in range(5)]

    place = np.array([-24.0, -24.0, 0.5])
    house = building_row(Building((3.0, 2.0), 0.5, 8.0, 5.0, 3.0, 4.0, "tile"))
    grids = np.zeros((2, 97, 97), dtype=np.float32)
    ground = np.zeros((97, 97), dtype=np.float32)
    for grid, python in ((grids[0], False), (grids[1], True)):
        for kernel, arguments in (
            (raise_hedges, (ground, place, hedge_rows((HEDGE,)))),
            (raise_roof, (place, house, 0.5)),
            (raise_crowns, (place, tree_rows(TREES), np.zeros(4))),
        ):
            (kernel.py_func if python else kernel)(grid, *arguments)
    np.testing.assert_allclose(grids[0], grids[1], atol=1e-4)
    assert grids[0].max() > 8.0


def test_refining_keeps_the_heights() -> None:
    coarse = np.random.default_rng(1).normal(size=(4, 5)).astype(np.float32)
    fine = refine(coarse, 4)
    assert fine.shape == (13, 17)
    np.testing.assert_allclose(fine[::4, ::4], coarse, atol=1e-6)
    np.testing.assert_allclose(fine[2, ::4], (coarse[0] + coarse[1]) / 2, atol=1e-6)
