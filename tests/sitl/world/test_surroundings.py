"""Houses and trees stand where they may, the same each time."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sitl.world.errors import WorldError
from sitl.world.extent import corners, distances_m, distances_to_building_m
from sitl.world.models import AreaModel, ScatterModel
from sitl.world.records import Building, Strip
from sitl.world.scatter import half_width_m, scatter_trees
from tests.sitl.world.worlds import world_of

LINE = """\
  - points_ne_m: [[20, -120], [20, -60], [20, 0], [50, 60], [50, 120]]
    support: {kind: wood_pole, height_m: 12}
    conductors: {wire: penguin}
"""
VILLAGE = """\
strips:
  - {kind: road, points_ne_m: [[-30, -120], [-30, 120]]}
  - {kind: road, points_ne_m: [[-80, 40], [70, 40]]}
house_rows:
  - {strip: 1, setback_m: 5, every_m: 20, roofs: [tile, flat], seed: 3}
  - {strip: 2, setback_m: 5, every_m: 15, seed: 4}
"""
FAR = "trees: [{kind: bush, place_ne_m: [5000, 5000], height_m: 1}]\n"
BOUNDS = (-150.0, -220.0, 180.0, 220.0)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    density=st.floats(1.0, 400.0),
    keep_m=st.floats(0.0, 60.0),
    seed=st.integers(0, 2**32 - 1),
    kinds=st.lists(st.sampled_from(["broadleaf", "conifer", "poplar", "bush"]), min_size=1, max_size=4),
)
def test_scattered_trees_keep_clear(tmp_path: Path, density: float, keep_m: float, seed: int, kinds: list[str]) -> None:
    world = world_of(tmp_path, LINE)
    road = Strip("road", ((-50.0, -200.0), (-60.0, 200.0)), 6.0)
    house = Building((80.0, -20.0), 0.4, 20.0, 10.0, 3.0, 6.0, "tile")
    model = ScatterModel.model_validate(
        {"kinds": kinds, "density_per_ha": density, "keep_clear_m": keep_m, "keep_start_clear_m": 12, "seed": seed}
    )
    trees = scatter_trees(model, BOUNDS, world.lines, [road], [house], "key")
    assert trees == scatter_trees(model, BOUNDS, world.lines, [road], [house], "key")
    places = np.array([[t.north_m, t.east_m] for t in trees]).reshape(-1, 2)
    radii_m = np.array([t.crown_radius_m for t in trees])
    for conductor in world.conductors:
        assert np.all(distances_m(places, conductor.points_ned_m[::4, :2]) > keep_m + radii_m - 1e-6)
    assert np.all(np.hypot(*places.T) > 12.0 + radii_m)
    assert np.all(distances_m(places, np.array(road.points_ne_m)) > 3.0)
    assert np.all(distances_to_building_m(places, house) > radii_m)
    assert {t.kind for t in trees} <= set(kinds)


def test_trees_are_as_dense_as_asked(tmp_path: Path) -> None:
    world = world_of(tmp_path, LINE)
    model = ScatterModel.model_validate({"kinds": ["bush"], "density_per_ha": 50, "keep_clear_m": 0})
    n_wanted = 50 * (BOUNDS[2] - BOUNDS[0]) * (BOUNDS[3] - BOUNDS[1]) / 1e4
    assert len(scatter_trees(model, BOUNDS, world.lines, [], [], "key")) == pytest.approx(n_wanted, rel=0.1)
    area = AreaModel(south_m=0, west_m=0, north_m=100, east_m=100)
    trees = scatter_trees(model.model_copy(update={"area": area}), BOUNDS, [], [], [], "key")
    assert len(trees) == pytest.approx(50, abs=8)
    assert all(0 <= t.north_m <= 100 and 0 <= t.east_m <= 100 for t in trees)


def test_another_seed_gives_other_trees(tmp_path: Path) -> None:
    scattered = "scattered_trees: [{{kinds: [conifer], density_per_ha: 30, seed: {}}}]\n"
    one, other = (world_of(tmp_path, LINE, scattered.format(seed)) for seed in (1, 2))
    assert one.trees != other.trees
    assert all(8.0 <= tree.height_m <= 22.0 for tree in one.trees)


def test_houses_stand_along_their_road_and_leave_gaps(tmp_path: Path) -> None:
    world = world_of(tmp_path, LINE, VILLAGE)
    assert len(world.buildings) > 15
    line, (first, second) = world.line, world.strips
    for house in world.buildings:
        at = np.array([*corners(house), house.centre_ne_m])
        is_of_first = abs(math.cos(house.heading_rad)) < 1e-9  # that road runs east, the other one north
        assert is_of_first or abs(math.sin(house.heading_rad)) < 1e-9
        own, other_road = (first, second) if is_of_first else (second, first)
        assert distances_m(at, np.array(own.points_ne_m)).min() == pytest.approx(2.5 + 6.0, abs=1.01)
        assert distances_m(at, np.array(other_road.points_ne_m)).min() >= 2.5 + 2.0
        assert distances_m(at, np.array(line.axis_ne_m)).min() > half_width_m(line) + 5.0
        assert np.hypot(*at.T).min() >= 10.0
        assert house.ridge_m == house.eaves_m if house.roof == "flat" else house.ridge_m > house.eaves_m
        for other in world.buildings:
            assert other is house or distances_to_building_m(at, other).min() > 1.5
    assert {house.roof for house in world.buildings} == {"tile", "flat"}


def test_what_is_listed_stands_where_it_says(tmp_path: Path) -> None:
    world = world_of(
        tmp_path, LINE,
        "strips: [{kind: river, points_ne_m: [[-40, 0], [-45, 90]]}]\n"
        "buildings: [{centre_ne_m: [-20, 30], heading_deg: 30, length_m: 12, width_m: 8, eaves_m: 3}]\n"
        "trees: [{kind: poplar, place_ne_m: [-15, 9], height_m: 20}]\n",
    )  # fmt: skip
    assert world.strips == (Strip("river", ((-40.0, 0.0), (-45.0, 90.0)), 8.0),)
    (house,), (tree,) = world.buildings, world.trees
    assert house.ridge_m == pytest.approx(3.0 + 4.0 * math.tan(math.radians(35)))
    assert house.heading_rad == pytest.approx(math.radians(30))
    assert (tree.north_m, tree.east_m, tree.height_m) == (-15.0, 9.0, 20.0)
    assert tree.crown_radius_m == pytest.approx(2.2)


@pytest.mark.parametrize(
    ("more", "key"),
    [
        (
            "buildings: [{centre_ne_m: [20, -30], heading_deg: 0, length_m: 9, width_m: 8, eaves_m: 9}]\n",
            "buildings.0",
        ),
        ("trees: [{kind: poplar, place_ne_m: [20, -30], height_m: 14}]\n", "trees.0"),
        ("trees: [{kind: palm, place_ne_m: [20, -30], height_m: 14}]\n", "trees.0.kind"),
        ("house_rows: [{strip: 1}]\n", "the whole file"),
        ("scattered_trees: [{kinds: [bush], density_per_ha: 9, height_m: [3, 2]}]\n", "scattered_trees.0"),
        (
            "scattered_trees: [{kinds: [bush], density_per_ha: 2000}]\nterrain: {kind: flat}\n" + FAR,
            "scattered_trees.0",
        ),
        ("strips: [{kind: road, points_ne_m: [[0, 0]]}]\n", "strips.0.points_ne_m"),
        ("strips: [{kind: road, points_ne_m: [[0, 0], []]}]\n", "strips.0.points_ne_m.1.0"),
        ("terrain: {kind: hills, amplitude_m: 5}\n", "terrain.wavelength_m"),
    ],
)
def test_what_cannot_stand_there_names_its_key(tmp_path: Path, more: str, key: str) -> None:
    with pytest.raises(WorldError) as caught:
        world_of(tmp_path, LINE, more)
    assert f" {key}:" in str(caught.value)


def test_a_house_below_the_conductors_may_stand(tmp_path: Path) -> None:
    low = "buildings: [{centre_ne_m: [20, -30], heading_deg: 0, length_m: 9, width_m: 8, eaves_m: 3}]\n"
    assert len(world_of(tmp_path, LINE, low).buildings) == 1
