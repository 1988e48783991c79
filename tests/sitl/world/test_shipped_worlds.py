"""Every shipped world is one that a mission can be flown in."""

import itertools
import math

import numpy as np
import pytest
from numpy.typing import NDArray

from sitl.world.clearance import ground_clearance_m, least_clearance_m
from sitl.world.extent import distances_m, distances_to_building_m
from sitl.world.file import DEFAULT_WORLD, load_world, read_world_file, shipped_worlds
from sitl.world.records import PowerLine, World

WORLDS = {name: load_world(name) for name in shipped_worlds()}
every_world = pytest.mark.parametrize("world", WORLDS.values(), ids=WORLDS)


def nose_of(world: World) -> NDArray[np.float64]:
    return np.array([math.cos(world.start_yaw_rad), math.sin(world.start_yaw_rad)])


def meeting(world: World) -> tuple[int, NDArray[np.float64]]:
    """The span, and the place, at which the first line runs across the nose."""
    nose = nose_of(world)
    axis = np.array(world.line.axis_ne_m)
    for k, (here, there) in enumerate(itertools.pairwise(axis)):
        share, ahead_m = np.linalg.solve(np.column_stack([here - there, nose]), here)
        if 0.0 <= share <= 1.0 and ahead_m > 0.0:
            return k, ahead_m * nose
    raise AssertionError(f"the nose of {world.name} points past its line")


def wires_of(line: PowerLine) -> NDArray[np.float64]:
    return np.concatenate([conductor.points_ned_m for conductor in line.conductors])


def test_all_worlds_are_there() -> None:
    assert set(WORLDS) >= {
        "medium_voltage", "high_voltage", "forest", "village", "hills", "corner", "crossing", DEFAULT_WORLD,
    }  # fmt: skip


@every_world
def test_the_vehicle_starts_beside_the_line_and_faces_it(world: World) -> None:
    k, place = meeting(world)
    assert 12.0 - 1e-3 <= np.linalg.norm(place) <= 25.0
    axis = np.array(world.line.axis_ne_m)
    along = (axis[k + 1] - axis[k]) / np.linalg.norm(axis[k + 1] - axis[k])
    assert abs(np.dot(along, nose_of(world))) < 0.02
    assert min(np.linalg.norm(axis - place, axis=1)) >= 8.0
    # On to the right of the nose there is line to follow, without a missing span.
    assert np.dot(along, [-nose_of(world)[1], nose_of(world)[0]]) > 0.99
    points = world.line.conductors[0].points_ned_m[:, :2]
    near = int(np.linalg.norm(points - place, axis=1).argmin())
    assert np.linalg.norm(np.diff(points[near:], axis=0), axis=1).sum() >= 60.0
    assert world.terrain.at(0.0, 0.0) == pytest.approx(0.0, abs=1e-5)


@every_world
def test_there_is_free_sky_above_the_start(world: World) -> None:
    for line in world.lines:
        assert np.hypot(*wires_of(line)[:, :2].T).min() > 6.0
    assert all(math.hypot(t.north_m, t.east_m) > t.crown_radius_m + 8.0 for t in world.trees)
    start = np.zeros((1, 2))
    assert all(distances_to_building_m(start, building)[0] > 8.0 for building in world.buildings)


@every_world
def test_conductors_keep_off_the_ground(world: World) -> None:
    for line in world.lines:
        assert least_clearance_m(line, world.terrain) > 4.0
    for line in world.lines:
        for conductor in line.conductors:
            assert np.all(np.isfinite(conductor.points_ned_m))
            assert not conductor.points_ned_m.flags.writeable


@every_world
def test_no_tree_or_building_is_within_5_m_of_a_conductor(world: World) -> None:
    for line in world.lines:
        wires = wires_of(line)
        over_m = ground_clearance_m(wires, world.terrain)
        for building in world.buildings:
            near = distances_to_building_m(wires[:, :2], building) < 5.0
            assert not near.any() or over_m[near].min() > building.ridge_m + 5.0
        for tree in world.trees:
            beside_m = np.hypot(wires[:, 0] - tree.north_m, wires[:, 1] - tree.east_m) - tree.crown_radius_m
            near = beside_m < 5.0
            if near.any():
                gaps_m = np.hypot(np.maximum(beside_m[near], 0.0), over_m[near] - tree.height_m)
                assert gaps_m.min() > 5.0


@every_world
def test_everything_stands_within_the_bounds(world: World) -> None:
    south, west, north, east = world.terrain.bounds_ne_m
    bases = np.array([support.base_ned_m for support in world.supports])
    assert bases[:, 0].min() - south >= 100.0 - 1e-6
    assert north - bases[:, 0].max() >= 100.0 - 1e-6
    assert bases[:, 1].min() - west >= 100.0 - 1e-6
    assert east - bases[:, 1].max() >= 100.0 - 1e-6
    for tree in world.trees:
        assert south <= tree.north_m <= north
        assert west <= tree.east_m <= east
    assert [world.terrain.at(n, e) for n, e, _ in bases] == pytest.approx([-down for _, _, down in bases], abs=1e-6)


@every_world
def test_a_world_is_the_same_each_time(world: World) -> None:
    again = load_world(world.name)
    assert again.trees == world.trees
    assert again.buildings == world.buildings
    assert again.supports == world.supports
    np.testing.assert_array_equal(again.terrain.up_m, world.terrain.up_m)


@every_world
def test_a_world_says_what_it_is(world: World) -> None:
    assert read_world_file(world.name).description.endswith(".")


def test_the_default_line_is_where_it_always_was() -> None:
    world = WORLDS["medium_voltage"]
    assert [len(c.points_ned_m) for c in world.conductors] == [721, 721, 721]
    place = meeting(world)[1]
    assert np.linalg.norm(place) == pytest.approx(12.0, abs=0.01)
    turn = math.radians(20.0)
    fifth = (78.312 - 180.0 * math.sin(turn), -180.075 + 180.0 * math.cos(turn), 0.0)
    assert world.supports[4].base_ned_m == pytest.approx(fifth)
    highest = min(float(c.points_ned_m[:, 2].min()) for c in world.conductors)
    assert highest == pytest.approx(-10.2)


def test_high_voltage_has_tall_towers_and_twin_bundles() -> None:
    line = WORLDS["high_voltage"].line
    assert all(support.kind == "lattice_tower" and len(support.members) >= 100 for support in line.supports)
    middles = [conductor.points_ned_m[len(conductor.points_ned_m) // 2] for conductor in line.conductors]
    nearest_m = [min(float(np.linalg.norm(a - b)) for b in middles if b is not a) for a in middles]
    assert nearest_m == pytest.approx([0.4] * 6, abs=0.02)


def test_the_forest_leaves_a_corridor() -> None:
    world = WORLDS["forest"]
    tall = np.array([[t.north_m, t.east_m] for t in world.trees if t.height_m > 5.0])
    gaps_m = distances_m(tall, np.array(world.line.axis_ne_m))
    assert len(tall) > 2000
    assert 24.0 < gaps_m.min() < 32.0


def test_the_village_has_tile_roofs_parallel_to_the_line() -> None:
    world = WORLDS["village"]
    axis = np.array(world.line.axis_ne_m)
    near = [
        building for building in world.buildings
        if building.roof == "tile" and 8.0 <= distances_m(np.array([building.centre_ne_m]), axis)[0] <= 25.0
        and abs(math.sin(building.heading_rad - world.supports[0].heading_rad)) < 0.02
    ]  # fmt: skip
    assert len(near) >= 8
    assert {"road", "fence"} <= {strip.kind for strip in world.strips}


def test_the_line_over_the_hills_rises_and_falls() -> None:
    world = WORLDS["hills"]
    start, place = meeting(world)
    right = np.array([-nose_of(world)[1], nose_of(world)[0]])
    followed = [world.terrain.at(*(place + along_m * right)) for along_m in range(0, 80, 5)]
    assert 5.0 <= max(followed) - min(followed) <= 10.0
    feet = [-support.base_ned_m[2] for support in world.line.supports]
    assert 8.0 < max(feet) - min(feet) < 16.0
    assert start > 0


def test_the_corner_turns_30_and_then_60_degrees() -> None:
    world = WORLDS["corner"]
    k, place = meeting(world)
    axis = np.array(world.line.axis_ne_m)
    assert 35.0 <= np.linalg.norm(axis[k + 1] - place) <= 45.0
    headings = np.arctan2(*np.diff(axis, axis=0).T[::-1])
    turns_deg = np.degrees(np.abs(np.remainder(np.diff(headings) + math.pi, 2 * math.pi) - math.pi))
    assert turns_deg[k] == pytest.approx(30.0)
    assert sorted(turns_deg[k + 1 :])[-1] == pytest.approx(60.0)


def test_the_crossing_line_crosses_25_m_on() -> None:
    world = WORLDS["crossing"]
    k, place = meeting(world)
    main, other = world.lines
    axis, across = np.array(main.axis_ne_m), np.array(other.axis_ne_m)
    along = (axis[k + 1] - axis[k]) / np.linalg.norm(axis[k + 1] - axis[k])
    crossed = place + 25.0 * along
    assert distances_m(crossed[None], across)[0] < 0.2
    direction = (across[-1] - across[0]) / np.linalg.norm(across[-1] - across[0])
    assert math.degrees(math.acos(abs(np.dot(along, direction)))) == pytest.approx(70.0, abs=1.0)
    mains, others = wires_of(main), wires_of(other)
    over = mains[np.hypot(*(mains[:, :2] - crossed).T) < 5.0]
    under = others[np.hypot(*(others[:, :2] - crossed).T) < 5.0]
    assert -over[:, 2].max() > -under[:, 2].min() + 2.0
    # The interrupted span is far from there.
    ends = np.array([conductor.points_ned_m[i, :2] for conductor in main.conductors for i in (0, -1)])
    gap = [end for end in ends if min(np.linalg.norm(end - axis[0]), np.linalg.norm(end - axis[-1])) > 5.0]
    assert gap
    assert min(np.linalg.norm(end - place) for end in gap) > 80.0
