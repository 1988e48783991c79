"""The world file is checked, and the world it describes is where it says."""

import math
from pathlib import Path

import numpy as np
import pytest

from sitl.world.file import DEFAULT_WORLD, WorldError, load_world
from sitl.world.light import LIGHT_NAMES, LIGHTS, LightName
from sitl.world.records import Light

WORLD = """\
version: 2
origin: {latitude_deg: 4.9, longitude_deg: -73.9, altitude_m: 2580}
start_yaw_deg: 90
lines:
  - route:
      first_ne_m: [10, -30]
      heading_deg: 90
      spans_m: [40, 40]
    support: {kind: concrete_pole, height_m: 10, base_diameter_m: 0.3}
    conductors: {n: 2, wire: {diameter_m: 0.014}, sag_m: 0.5}
"""


def write(folder: Path, text: str) -> str:
    path = folder / "mine.yaml"
    path.write_text(text, encoding="utf-8")
    return str(path)


def test_a_world_file_is_read_in_ned_and_radians(tmp_path: Path) -> None:
    world = load_world(write(tmp_path, WORLD))
    assert world.name == "mine"
    assert world.origin.latitude_rad == pytest.approx(math.radians(4.9))
    assert world.start_yaw_rad == pytest.approx(math.pi / 2)
    assert np.array(world.line.axis_ne_m) == pytest.approx(np.array([[10, -30], [10, 10], [10, 50]]))
    left, right = world.conductors
    # The line runs east, so its right is south.
    assert right.points_ned_m[[0, 80, 160]] == pytest.approx(
        np.array([[9.2, -30, -9.9], [9.2, 10, -9.9], [9.2, 50, -9.9]])
    )
    assert right.points_ned_m[:, 2].max() == pytest.approx(-9.4)
    assert left.points_ned_m[:, 0] == pytest.approx(10.8)
    body, arm, _, insulator = world.supports[1].members
    assert body.end_ned_m == world.supports[1].top_ned_m
    assert arm.start_ned_m == pytest.approx((10.95, 10.0, -9.65))
    assert insulator.end_ned_m == pytest.approx((9.2, 10.0, -9.9))


def test_the_sun_stands_where_it_says() -> None:
    light = Light(math.radians(90), math.radians(30), direct=0.5, sky=0.5, visibility_m=1e4)
    assert light.direction_ned == pytest.approx((0.0, math.cos(math.radians(30)), -0.5))


@pytest.mark.parametrize("light", LIGHT_NAMES)
def test_a_world_can_be_had_in_every_light(light: LightName) -> None:
    assert load_world(light=light).light == LIGHTS[light]


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        ("version: 2", "version: 3", "version"),
        ("start_yaw_deg: 90", "start_jaw_deg: 90", "start_jaw_deg"),
        ("spans_m: [40, 40]", "spans_m: []", "lines.0.route.spans_m"),
        ("spans_m: [40, 40]", "spans_m: [40, far]", "lines.0.route.spans_m.1"),
        ("spans_m: [40, 40]", "spans_m: [40, 40]\n      turns_deg: [1, 2]", "lines.0.route"),
        ("sag_m: 0.5", "sag_m: 9.95", "lines.0.conductors"),
        ("sag_m: 0.5", "sag_m: 41", "lines.0.conductors"),
        ("sag_m: 0.5", "sag_m: 0.5, tension_n: 3000", "lines.0.conductors"),
        (", sag_m: 0.5", "", "lines.0.conductors"),
        ("{diameter_m: 0.014}", "dodo", "lines.0.conductors"),
        ("latitude_deg: 4.9", "latitude_deg: .nan", "origin.latitude_deg"),
        ("      heading_deg: 90\n", "", "lines.0.route"),
        ("height_m: 10,", "height_m: 4, arm_below_top_m: 4,", "lines.0.support"),
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
    path = write(tmp_path, "version: 2\norigin: {latitude_deg: 4\n")
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
