"""Distances are those of geometry, whatever the place, and a touch breaks the vehicle."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sitl import clearance_kernel
from sitl.contact import THINGS, Obstacles
from sitl.outfit import open_field
from sitl.place import Origin
from sitl.world.file import load_world
from sitl.world.height_grid import HeightGrid
from sitl.world.records import Building, Conductor, Member, PowerLine, Support, Tree, World

FIELD = open_field(Origin(), 0.0)
WIRE = Conductor(0.02, np.array([[20.0, -30.0, -10.0], [20.0, 0.0, -9.0], [20.0, 30.0, -10.0]]))
MAST = Support(
    "wood_pole",
    (20.0, -30.0, 0.0),
    (20.0, -30.0, -10.0),
    math.pi / 2,
    (Member((20.0, -30.0, 0.0), (20.0, -30.0, -10.0), 0.4, 0.2, "wood"),),
)
LINE = PowerLine(((20.0, -30.0), (20.0, 30.0)), (MAST,), (WIRE,))
HOUSE = Building((-40.0, 0.0), math.pi / 2, 12.0, 8.0, 4.0, 7.0, "tile")
CONIFER = Tree("conifer", 0.0, 40.0, 10.0, 3.0)
WOODS = (Tree("broadleaf", -20.0, 40.0, 12.0, 4.0), CONIFER, Tree("bush", 10.0, -40.0, 2.0, 1.5))
WORLD = dataclasses.replace(FIELD, lines=(LINE,), buildings=(HOUSE,), trees=WOODS)


def above(north_m: float, east_m: float, up_m: float, world: World = WORLD, reach_m: float = 40.0):  # type: ignore[no-untyped-def]
    return Obstacles(world).clearance((north_m, east_m, -up_m), reach_m)


def test_over_the_wire_it_is_the_height_above_it() -> None:
    assert above(20.0, 0.0, 12.0).conductor_m == pytest.approx(3.0 - 0.01, abs=0.01)
    assert above(20.0, 15.0, 9.5).conductor_m == 0.0
    assert above(15.0, 0.0, 9.0).conductor_m == pytest.approx(5.0 - 0.01)


def test_a_pole_tapers() -> None:
    assert above(25.0, -30.0, 0.0).support_m == pytest.approx(5.0 - 0.2)
    assert above(25.0, -30.0, 10.0).support_m == pytest.approx(5.0 - 0.1)
    assert above(20.0, -30.0, 13.0).support_m == pytest.approx(3.0 - 0.1)


def test_a_house_has_walls_and_a_roof() -> None:
    # Its ridge runs from west to east, 12 m long; the walls stand 4 m to the north and the south.
    assert above(-30.0, 0.0, 2.0).building_m == pytest.approx(6.0)
    assert above(-40.0, 10.0, 2.0).building_m == pytest.approx(4.0)
    assert above(-33.0, 10.0, 2.0).building_m == pytest.approx(5.0)
    assert above(-40.0, 0.0, 9.0).building_m == pytest.approx(2.0 * 4 / 5, abs=0.5)
    assert above(-40.0, 0.0, 5.0).building_m == 0.0
    # Straight away from the middle of the roof's slope, which falls 3 m over 4 m.
    assert above(-38.0 + 3 * 0.6, 0.0, 5.5 + 3 * 0.8).building_m == pytest.approx(3.0)


def test_a_conifer_is_a_cone_on_a_trunk() -> None:
    assert above(0.0, 40.0, 12.0).tree_m == pytest.approx(2.0)
    # Right away from the middle of the cone's side, which goes from 3 m at 1.2 m height to 0 at 10 m.
    side = math.hypot(8.8, 3.0)
    assert above(1.5 + 4 * 8.8 / side, 40.0, 5.6 + 4 * 3 / side).tree_m == pytest.approx(4.0)
    assert above(5.0, 40.0, 0.0).tree_m == pytest.approx(math.hypot(2.0, 1.2))
    assert above(1.0, 40.0, 0.0).tree_m == pytest.approx(0.85)


def test_a_broadleaf_crown_is_a_dome_and_a_bush_stands_on_the_ground() -> None:
    assert above(-20.0, 40.0, 15.0).tree_m == pytest.approx(3.0)
    assert above(-30.0, 40.0, 0.42 * 12.0).tree_m == pytest.approx(6.0, abs=0.01)
    # Straight over the crown at 0.6 of its radius, where the dome is 0.8 of its height.
    dome_m = 12.0 * (0.42 + 0.58 * 0.8)
    assert above(-20.0, 42.4, dome_m - 0.05).tree_m == 0.0
    assert 0.0 < above(-20.0, 42.4, dome_m + 0.1).tree_m < 0.12
    assert above(10.0, -43.0, 0.0).tree_m == pytest.approx(1.5)
    assert above(10.0, -40.0, 3.0).tree_m == pytest.approx(1.0)


def test_what_stands_on_a_hill_stands_higher() -> None:
    terrain = FIELD.terrain
    hill = HeightGrid(terrain.south_m, terrain.west_m, terrain.cell_m, terrain.up_m + 30.0)
    world = dataclasses.replace(WORLD, terrain=hill)
    assert above(0.0, 40.0, 42.0, world).tree_m == pytest.approx(2.0)
    assert above(-30.0, 0.0, 32.0, world).building_m == pytest.approx(6.0)


def test_what_is_out_of_reach_is_not_seen() -> None:
    near = above(20.0, 0.0, 12.0, reach_m=2.0)
    assert near.conductor_m == near.support_m == near.other_m == math.inf
    assert above(500.0, 500.0, 10.0).nearest[1] == math.inf
    assert above(1.0, 2.0, 3.0, FIELD).nearest[1] == math.inf


def test_the_nearest_is_named() -> None:
    assert above(20.0, 0.0, 12.0).nearest == ("conductor", above(20.0, 0.0, 12.0).conductor_m)
    assert above(-40.0, 0.0, 9.0).nearest[0] == "building"
    assert above(0.0, 40.0, 12.0).other_m == above(0.0, 40.0, 12.0).tree_m


def by_hand(point: tuple[float, float, float]) -> dict[str, float]:
    """The distances to the surfaces, sampled densely and without the map's cells."""
    bars = {"conductor": [], "support": []}
    for start, end in zip(WIRE.points_ned_m[:-1], WIRE.points_ned_m[1:], strict=True):
        bars["conductor"].append((start, end, 0.01, 0.01))
    bars["support"].append((np.array(MAST.base_ned_m), np.array(MAST.top_ned_m), 0.2, 0.1))
    found = {}
    for kind, those in bars.items():
        best_m = math.inf
        for start, end, first_m, last_m in those:
            t = np.linspace(0.0, 1.0, 4001)
            away_m = np.linalg.norm(start + t[:, None] * (end - start) - np.array(point), axis=1)
            best_m = min(best_m, float((away_m - first_m - t * (last_m - first_m)).min()))
        found[kind] = max(best_m, 0.0)
    return found


OBSTACLES = Obstacles(WORLD)


@given(st.tuples(st.floats(-20, 60), st.floats(-60, 60), st.floats(-30, 0)))
def test_the_map_of_cells_misses_nothing(point: tuple[float, float, float]) -> None:
    clearance = OBSTACLES.clearance(point, 30.0)
    for kind, wanted_m in by_hand(point).items():
        got_m = getattr(clearance, f"{kind}_m")
        assert got_m == pytest.approx(wanted_m, abs=0.01) if wanted_m < 29.9 else got_m > 29.8


def test_the_kernels_do_compiled_what_they_do_in_python(monkeypatch: pytest.MonkeyPatch) -> None:
    points = np.random.default_rng(4).uniform((-60.0, -60.0, -15.0), (60.0, 60.0, 0.0), (40, 3)).tolist()
    compiled = [OBSTACLES.clearance(tuple(point)) for point in points]
    for name in ("capsule_distance_m", "profile_distance_m", "solid_distance_m"):
        monkeypatch.setattr(clearance_kernel, name, getattr(clearance_kernel, name).py_func)
    monkeypatch.setattr("sitl.contact.nearest_m", clearance_kernel.nearest_m.py_func)
    in_python = [OBSTACLES.clearance(tuple(point)) for point in points]
    for one, other in zip(compiled, in_python, strict=True):
        assert dataclasses.astuple(one) == pytest.approx(dataclasses.astuple(other))
    assert all(min(getattr(one, f"{thing}_m") for one in compiled) < math.inf for thing in THINGS)


def test_the_shipped_worlds_start_is_clear() -> None:
    assert Obstacles(load_world()).clearance((0.0, 0.0, 0.0)).nearest[1] > 5.0
