"""The world file is checked, and the world it describes is where it says."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sitl.world.catenary import catenary_parameter_m, hang
from sitl.world.file import DEFAULT_WORLD, WorldError, load_world, shipped_worlds
from sitl.world.light import LIGHT_NAMES, LIGHTS, LightName
from sitl.world.records import Light

WORLD = """\
version: 1
origin: {latitude_deg: 4.9, longitude_deg: -73.9, altitude_m: 2580}
start_yaw_deg: 90
line:
  first_pole: {north_m: 10, east_m: -30}
  heading_deg: 90
  n_poles: 3
  span_m: 40
  pole: {height_m: 10, base_diameter_m: 0.3, top_diameter_m: 0.2}
  cross_arm: {height_m: 9.5, length_m: 2, thickness_m: 0.1}
  conductors:
    - {lateral_m: 0.8, height_m: 9.7, diameter_m: 0.014, sag_m: 0.5}
"""

spans = st.floats(5.0, 800.0)
sag_parts = st.floats(1e-4, 0.3)
rises = st.floats(-0.3, 0.3)


def write(folder: Path, text: str) -> str:
    path = folder / "mine.yaml"
    path.write_text(text, encoding="utf-8")
    return str(path)


@given(span_m=spans, sag_part=sag_parts, rise_part=rises)
def test_a_conductor_hangs_by_its_sag_in_a_catenary(span_m: float, sag_part: float, rise_part: float) -> None:
    sag_m, rise_m = sag_part * span_m, rise_part * span_m
    points = hang((0.0, 0.0, -10.0), (0.0, span_m, -10.0 - rise_m), sag_m, span_m / 200.0)

    assert points[0] == pytest.approx([0.0, 0.0, -10.0])
    assert points[-1] == pytest.approx([0.0, span_m, -10.0 - rise_m])
    middle = len(points) // 2
    assert points[middle, 1] == pytest.approx(span_m / 2)
    assert points[middle, 2] == pytest.approx(-10.0 - rise_m / 2 + sag_m, rel=1e-9, abs=1e-7)
    # What tells a catenary from a parabola: y'' = sqrt(1 + y'^2) / a everywhere.
    step = span_m / (len(points) - 1)
    height = -points[:, 2]
    slope = (height[2:] - height[:-2]) / (2 * step)
    bend = (height[2:] - 2 * height[1:-1] + height[:-2]) / step**2
    a = catenary_parameter_m(span_m, rise_m, sag_m)
    assert bend * a == pytest.approx(np.hypot(1.0, slope), rel=2e-3)


@given(span_m=spans, sag_part=sag_parts, rise_part=rises)
def test_a_conductor_seen_from_the_other_end_is_the_same(span_m: float, sag_part: float, rise_part: float) -> None:
    start, end = (3.0, -2.0, -9.0), (3.0, -2.0 + span_m, -9.0 - rise_part * span_m)
    there = hang(start, end, sag_part * span_m, 1.0)
    back = hang(end, start, sag_part * span_m, 1.0)
    np.testing.assert_allclose(there, back[::-1], atol=1e-6)


@pytest.mark.parametrize(("span_m", "sag_m"), [(0.0, 1.0), (40.0, 0.0), (40.0, -1.0), (40.0, 41.0)])
def test_an_impossible_sag_is_refused(span_m: float, sag_m: float) -> None:
    with pytest.raises(ValueError, match="m"):
        catenary_parameter_m(span_m, 0.0, sag_m)


@pytest.mark.parametrize("name", shipped_worlds())
def test_shipped_worlds_load(name: str) -> None:
    world = load_world(name)
    assert world.name == name
    assert world.conductors
    assert len(world.line.axis_ne_m) == len(world.supports) >= 2
    for conductor in world.conductors:
        assert np.all(conductor.points_ned_m[:, 2] < 0.0)
        assert not conductor.points_ned_m.flags.writeable


def test_the_default_world_starts_beside_the_line_and_faces_it() -> None:
    world = load_world()
    assert world.name == DEFAULT_WORLD
    start, end = np.array(world.line.axis_ne_m[0]), np.array(world.line.axis_ne_m[-1])
    along = (end - start) / np.linalg.norm(end - start)
    foot = start + np.dot(-start, along) * along
    assert np.linalg.norm(foot) == pytest.approx(12.0, abs=0.01)
    nose = np.array([math.cos(world.start_yaw_rad), math.sin(world.start_yaw_rad)])
    assert nose == pytest.approx(foot / np.linalg.norm(foot), abs=0.01)
    assert min(np.linalg.norm(foot - np.array(pole)) for pole in world.line.axis_ne_m) > 10.0
    assert np.dot(end - foot, along) > 100.0
    assert np.dot(foot - start, along) > 100.0


def test_a_world_file_is_read_in_ned_and_radians(tmp_path: Path) -> None:
    world = load_world(write(tmp_path, WORLD))
    assert world.name == "mine"
    assert world.origin.latitude_rad == pytest.approx(math.radians(4.9))
    assert world.start_yaw_rad == pytest.approx(math.pi / 2)
    assert np.array(world.line.axis_ne_m) == pytest.approx(np.array([[10, -30], [10, 10], [10, 50]]))
    (conductor,) = world.conductors
    # The line runs east, so its right is south.
    assert conductor.points_ned_m[[0, 80, 160]] == pytest.approx(
        np.array([[9.2, -30, -9.7], [9.2, 10, -9.7], [9.2, 50, -9.7]])
    )
    assert conductor.points_ned_m[:, 2].max() == pytest.approx(-9.2)
    body, arm, insulator = world.supports[1].members
    assert body.end_ned_m == world.supports[1].top_ned_m
    assert arm.start_ned_m == pytest.approx((11.0, 10.0, -9.5))
    assert insulator.end_ned_m == pytest.approx((9.2, 10.0, -9.7))


def test_the_sun_stands_where_it_says() -> None:
    light = Light(math.radians(90), math.radians(30), direct=0.5, sky=0.5, visibility_m=1e4)
    assert light.direction_ned == pytest.approx((0.0, math.cos(math.radians(30)), -0.5))


@pytest.mark.parametrize("light", LIGHT_NAMES)
def test_a_world_can_be_had_in_every_light(light: LightName) -> None:
    assert load_world(light=light).light == LIGHTS[light]


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        ("version: 1", "version: 2", "version"),
        ("start_yaw_deg: 90", "start_jaw_deg: 90", "start_jaw_deg"),
        ("n_poles: 3", "n_poles: 1", "line.n_poles"),
        ("span_m: 40", "span_m: far", "line.span_m"),
        ("sag_m: 0.5", "sag_m: 9.8", "line.conductors.0"),
        ("height_m: 9.5", "height_m: 10.5", "line"),
        ("latitude_deg: 4.9", "latitude_deg: .nan", "origin.latitude_deg"),
        ("  span_m: 40\n", "", "line.span_m"),
    ],
)
def test_a_wrong_world_names_file_and_key(tmp_path: Path, old: str, new: str, key: str) -> None:
    path = write(tmp_path, WORLD.replace(old, new))
    with pytest.raises(WorldError) as caught:
        load_world(path)
    assert path in str(caught.value)
    assert f" {key}:" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_broken_file_names_the_line(tmp_path: Path) -> None:
    path = write(tmp_path, "version: 1\norigin: {latitude_deg: 4\n")
    with pytest.raises(WorldError, match=r"line \d+"):
        load_world(path)


@pytest.mark.parametrize("text", ["", "just words"])
def test_a_file_that_is_no_mapping_is_refused(tmp_path: Path, text: str) -> None:
    with pytest.raises(WorldError, match=r"mine\.yaml"):
        load_world(write(tmp_path, text))


def test_an_unknown_world_lists_the_known_ones(tmp_path: Path) -> None:
    with pytest.raises(WorldError, match=DEFAULT_WORLD):
        load_world("atlantis")
    with pytest.raises(WorldError, match="cannot be read"):
        load_world(str(tmp_path))
