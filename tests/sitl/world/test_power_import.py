"""A map of power lines becomes a world file that loads."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sitl.place import EARTH_RADIUS_M, Origin
from sitl.world.file import load_world, read_world_file
from sitl.world.light import LIGHTS
from sitl.world.power_import import world_text
from sitl.world.power_map import PowerMapError, number, read_power_map
from sitl.world.records import World

LATITUDE, LONGITUDE = 4.9, -73.9


def place(north_m: float, east_m: float) -> tuple[float, float]:
    """Longitude, latitude [degrees], as GeoJSON has them."""
    origin = Origin(math.radians(LATITUDE), math.radians(LONGITUDE), 0.0)
    latitude_rad, longitude_rad, _ = origin.global_of((north_m, east_m, 0.0))
    return round(math.degrees(longitude_rad), 9), round(math.degrees(latitude_rad), 9)


def way(points: list[tuple[float, float]], **tags: str) -> dict[str, object]:
    geometry = {"type": "LineString", "coordinates": [place(*point) for point in points]}
    return {"type": "Feature", "properties": tags, "geometry": geometry}


def support(point: tuple[float, float], **tags: str) -> dict[str, object]:
    geometry = {"type": "Point", "coordinates": place(*point)}
    return {"type": "Feature", "properties": tags, "geometry": geometry}


def write(folder: Path, data: object) -> Path:
    path = folder / "map.geojson"
    path.write_text(json.dumps(data), encoding="utf-8")
    return path


def geojson(*features: dict[str, object]) -> dict[str, object]:
    return {"type": "FeatureCollection", "features": list(features)}


def imported(path: Path, start_support: int | None = None, radius_m: float = 1000.0) -> World:
    out = path.parent / "world.yaml"
    out.write_text(world_text(read_power_map(path), path, start_support, radius_m), encoding="utf-8")
    return load_world(str(out))


TOWERS = [(0.0, 0.0), (0.0, 280.0), (40.0, 560.0), (80.0, 840.0)]
HIGH = way(TOWERS, power="line", voltage="230000", circuits="2", wires="double", name='Torca: "north" - #2')
POLES = [(-100.0, 300.0), (-140.0, 300.0), (-180.0, 300.0)]
LOW = way(POLES, power="minor_line", voltage="400")


def test_a_high_voltage_line_keeps_its_places_and_tags(tmp_path: Path) -> None:
    told = [
        support(point, power="tower", height=height)
        for point, height in zip(TOWERS, ["38", "40", "44", "46"], strict=True)
    ]
    world = imported(write(tmp_path, geojson(HIGH, LOW, *told)))
    main, other = world.lines
    model = read_world_file(str(tmp_path / "world.yaml"))
    assert model.lines[0].name == 'Torca: "north" - #2'
    assert {support.kind for support in main.supports} == {"lattice_tower"}
    assert -main.supports[0].top_ned_m[2] == pytest.approx(42.0)
    assert sum(not conductor.is_shield for conductor in main.conductors) == 12
    bases = np.array([s.base_ned_m[:2] for s in main.supports])
    np.testing.assert_allclose(bases - bases[0], np.array(TOWERS), atol=0.02)
    assert {support.kind for support in other.supports} == {"wood_pole"}
    assert len(other.conductors) == 4
    # The origin is the start: the first tower's place on Earth is what the map said.
    latitude_rad, longitude_rad, _ = world.origin.global_of((*bases[0], 0.0))
    assert math.degrees(latitude_rad) == pytest.approx(LATITUDE, abs=1e-6)
    assert math.degrees(longitude_rad) == pytest.approx(LONGITUDE, abs=1e-6)


@pytest.mark.parametrize("start_support", [None, 1, 3])
def test_the_start_is_15_m_beside_mid_span(tmp_path: Path, start_support: int | None) -> None:
    world = imported(write(tmp_path, geojson(HIGH)), start_support)
    k = (start_support or 2) - 1
    here, there = (np.array(world.supports[i].base_ned_m[:2]) for i in (k, k + 1))
    middle = (here + there) / 2
    nose = np.array([math.cos(world.start_yaw_rad), math.sin(world.start_yaw_rad)])
    assert middle == pytest.approx(15.0 * nose, abs=0.02)
    assert (there - here) / np.linalg.norm(there - here) == pytest.approx([-nose[1], nose[0]], abs=1e-3)


def overpass(*, geometry: bool) -> dict[str, object]:
    nodes = []
    for i, (north_m, east_m) in enumerate(POLES):
        longitude, latitude = place(north_m, east_m)
        tags = {"power": "pole", "material": "concrete", "height": "12 m"}
        nodes.append({"type": "node", "id": 10 + i, "lat": latitude, "lon": longitude, "tags": tags})
    line: dict[str, object] = {
        "type": "way",
        "id": 7,
        "tags": {"power": "minor_line", "voltage": "13200", "cables": "3"},
    }
    if geometry:
        line["geometry"] = [{"lat": node["lat"], "lon": node["lon"]} for node in nodes]
    else:
        line["nodes"] = [node["id"] for node in nodes]
    return {"version": 0.6, "elements": [line, *nodes]}


@pytest.mark.parametrize("geometry", [False, True])
def test_overpass_data_is_read_with_nodes_or_geometry(tmp_path: Path, geometry: bool) -> None:
    world = imported(write(tmp_path, overpass(geometry=geometry)))
    assert [s.kind for s in world.supports] == ["concrete_pole"] * 3
    assert len(world.conductors) == 3
    assert -world.supports[0].top_ned_m[2] == pytest.approx(12.0)
    assert np.linalg.norm(np.diff(world.line.axis_ne_m, axis=0), axis=1) == pytest.approx([40.0, 40.0], abs=0.02)


def test_nodes_that_are_no_supports_do_not_hold_the_line(tmp_path: Path) -> None:
    line = way([(0, 0), (3, 30), (0, 60), (0, 120)], power="minor_line")
    told = [support(point, power="pole") for point in ((0.0, 0.0), (0.0, 60.0), (0.0, 120.0))]
    assert len(imported(write(tmp_path, geojson(line, *told))).supports) == 3
    assert len(imported(write(tmp_path, geojson(line))).supports) == 4
    assert len(imported(write(tmp_path, geojson(line, *told[:1]))).supports) == 4


def test_ways_of_one_kind_are_joined_where_two_meet(tmp_path: Path) -> None:
    tags = {"power": "minor_line", "voltage": "13200"}
    parts = [way([(0, 120), (0, 60)], **tags), way([(0, 0), (0, 60)], **tags), way([(0, 120), (0, 180)], **tags)]
    (line,) = imported(write(tmp_path, geojson(*parts))).lines
    assert len(line.supports) == 4
    other = way([(0, 60), (60, 60)], **tags)
    assert len(imported(write(tmp_path, geojson(*parts, other))).lines) == 3


def test_a_line_that_turns_back_is_cut_there(tmp_path: Path) -> None:
    line = way([(0, 0), (0, 60), (0, 120), (10, 60), (10, 0)], power="minor_line")
    assert [len(part.supports) for part in imported(write(tmp_path, geojson(line))).lines] == [3, 3]


def test_what_is_far_or_under_ground_is_left_out(tmp_path: Path) -> None:
    far = way([(9000, 0), (9000, 60)], power="minor_line")
    cable = way([(20, 0), (20, 60)], power="cable")
    path = write(tmp_path, geojson(HIGH, far, cable))
    world = imported(path, radius_m=300.0)
    assert len(world.lines) == 1
    assert len(world.supports) == 2
    assert "1 cables under ground were left out" in world_text(read_power_map(path), path, None, 300.0)


def test_no_tag_writes_keys_of_its_own(tmp_path: Path) -> None:
    name = 'Línea 🗼 "A"\x7f\nlight: dusk\x85\ud800'
    line = way(TOWERS, power="line", voltage="115 kV", name=name)
    told = support(TOWERS[0], power="tower", **{"line:management": "split\nlight: dusk\n"})
    path = tmp_path / "map.geojson"
    path.write_text(json.dumps(geojson(line, told)), encoding="utf-8")
    assert imported(path).light == LIGHTS["noon"]
    (read,) = read_world_file(str(tmp_path / "world.yaml")).lines
    assert read.name == 'Línea 🗼 "A" light: dusk'
    assert read.support.kind == "lattice_tower"


def test_a_long_span_is_pulled_tight_and_one_too_long_is_left_out(tmp_path: Path) -> None:
    places = [(0.0, 0.0), (0.0, 200.0), (0.0, 750.0), (0.0, 900.0), (0.0, 2700.0), (0.0, 2900.0)]
    world = imported(write(tmp_path, geojson(way(places, power="line", voltage="110000"))), 1, 4000.0)
    for conductor in world.conductors:
        east_m = conductor.points_ned_m[:, 1] - world.supports[0].base_ned_m[1]
        assert east_m.max() < 901.0 or east_m.min() > 2699.0
        if not conductor.is_shield:
            assert float(conductor.points_ned_m[:, 2].max()) < -4.0
    with pytest.raises(PowerMapError, match=r"after support 4 .* too long"):
        imported(tmp_path / "map.geojson", 4, 4000.0)


points = st.tuples(st.floats(-900, 900), st.floats(-900, 900))
tags = st.fixed_dictionaries(
    {"power": st.sampled_from(["line", "minor_line"])},
    optional={
        "voltage": st.sampled_from(["400", "13200", "110000;20000", "400000", "?"]),
        "cables": st.sampled_from(["1", "2", "4", "5", "12", "many"]),
        "wires": st.sampled_from(["single", "double", "quad", "fourfold"]),
        "circuits": st.sampled_from(["1", "2", "4"]),
    },
)


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(ways=st.lists(st.tuples(st.lists(points, min_size=2, max_size=7), tags), min_size=1, max_size=4))
def test_whatever_the_map_says_the_world_loads_or_a_sentence_tells_why(
    tmp_path: Path, ways: list[tuple[list[tuple[float, float]], dict[str, str]]]
) -> None:
    path = write(tmp_path, geojson(*(way(line, **told) for line, told in ways)))
    try:
        world = imported(path, radius_m=3000.0)
    except PowerMapError:
        return
    nose = np.array([math.cos(world.start_yaw_rad), math.sin(world.start_yaw_rad)])
    bases = np.array([support.base_ned_m[:2] for support in world.line.supports])
    middles = (bases[1:] + bases[:-1]) / 2
    assert np.linalg.norm(middles - 15.0 * nose, axis=1).min() < 0.05


def test_the_file_says_what_was_told_and_what_was_assumed(tmp_path: Path) -> None:
    told = [support(TOWERS[1], power="tower", **{"line:management": "split"})]
    path = write(tmp_path, geojson(HIGH, LOW, *told))
    text = world_text(read_power_map(path), path, None, 1000.0)
    assert "# 230 kV: tag voltage" in text
    assert "# 6 conductors: three for each of tag circuits" in text
    assert "# double wires: tag wires" in text
    assert "line:management of its supports: 1 x split" in text
    assert "# 42 m high: assumed by the voltage" in text
    assert "# 4 conductors: assumed for low voltage" in text


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "is not JSON"),
        ("[1, 2]", "neither a GeoJSON"),
        ('{"type": "FeatureCollection"}', "is broken"),
        ('{"type": "FeatureCollection", "features": []}', "has no way with power=line"),
        ('{"elements": [{"type": "way", "id": 5, "tags": {"power": "line"}, "nodes": [1, 2]}]}', "way 5, whose nodes"),
        (json.dumps(geojson(way([(0, 0), (0, 60)], power="cable"))), "1 cables lie under ground"),
        (json.dumps(geojson(way([(0, 0), (0, 3)], power="line"))), "no span of 8 m"),
        ('{"type": "FeatureCollection", "features": [{"properties": {"power": "line"}, "geometry": '
         '{"type": "LineString", "coordinates": [["a", 2], [3, 4]]}}]}', "is broken"),
        ('{"type": "FeatureCollection", "features": [{"properties": {"power": "line"}, "geometry": '
         '{"type": "LineString", "coordinates": [[500, 2], [3, 4]]}}]}', "is broken"),
    ],
)  # fmt: skip
def test_a_wrong_map_ends_in_one_sentence(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "map.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(PowerMapError, match=words) as caught:
        world_text(read_power_map(path), path, None, 1000.0)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "value"),
    [("110000", 110000.0), ("110000;20000", 110000.0), ("25 m", 25.0), ("25m", 25.0), ("12,5", 12.5), ("?", None),
     (None, None), ("", None), ("nan", None), ("low;400", 400.0)],
)  # fmt: skip
def test_tags_are_read_as_numbers_where_they_are_some(text: str | None, value: float | None) -> None:
    assert number(text) == value


def test_the_earth_is_the_autopilots() -> None:
    assert EARTH_RADIUS_M == 6371000.0
    origin = Origin(math.radians(47.0), math.radians(8.0), 400.0)
    assert origin.place_ne_m(*origin.global_of((120.0, -45.0, -3.0))[:2]) == pytest.approx((120.0, -45.0), abs=1e-6)
