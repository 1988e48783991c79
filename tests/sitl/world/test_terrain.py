"""Terrain comes from waves or from a map, lies at 0 at the start, and is refused where it does not fit."""

import struct
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from sitl.place import EARTH_RADIUS_M
from sitl.world.errors import WorldError
from sitl.world.geotiff import read_place
from sitl.world.height_grid import HeightGrid
from sitl.world.records import World
from tests.sitl.world.worlds import world_of

LINE = """\
  - points_ne_m: [[20, -60], [20, 0], [20, 60]]
    support: {kind: wood_pole, height_m: 12}
    conductors: {wire: penguin}
"""


def slope(rows: int, columns: int, cell_m: float, rise_north: float, rise_east: float) -> NDArray[np.float64]:
    """A tilted plane as a picture has it: the first row is the northernmost. 0 in the middle."""
    north_m = (0.5 * (rows - 1) - np.arange(rows)) * cell_m
    east_m = (np.arange(columns) - 0.5 * (columns - 1)) * cell_m
    return rise_north * north_m[:, None] + rise_east * east_m[None, :]


def with_map(folder: Path, terrain: str) -> World:
    return world_of(folder, LINE, f"terrain: {{kind: height_map, {terrain}}}\n")


def assert_slope(world: World, rise_north: float, rise_east: float, abs_m: float = 0.01) -> None:
    for north_m, east_m in ((0, 0), (50, 0), (0, 70), (-60, -40), (80, 120)):
        wanted_m = rise_north * north_m + rise_east * east_m
        assert world.terrain.at(north_m, east_m) == pytest.approx(wanted_m, abs=abs_m)
    for support in world.supports:
        assert -support.base_ned_m[2] == pytest.approx(world.terrain.at(*support.base_ned_m[:2]))


@given(st.lists(st.tuples(st.floats(-900, 900), st.floats(-900, 900)), min_size=1, max_size=20), st.integers(0, 9))
def test_all_places_at_once_are_as_each_alone(places: list[tuple[float, float]], seed: int) -> None:
    grid = HeightGrid(-30.0, 10.0, 7.0, np.random.default_rng(seed).normal(size=(9, 14)).astype(np.float32))
    at = np.array(places)
    together = grid.at_all(at[:, 0], at[:, 1])
    assert together == pytest.approx([grid.at(north_m, east_m) for north_m, east_m in places], abs=1e-6)


def test_hills_are_as_high_and_as_wide_as_asked(tmp_path: Path) -> None:
    long_line = LINE.replace("60", "2000").replace("penguin", "penguin, sag_m: 0.5")
    world = world_of(tmp_path, long_line, "terrain: {kind: hills, amplitude_m: 0.4, wavelength_m: 150, seed: 2}\n")
    up_m = world.terrain.up_m
    assert 0.25 < float(np.std(up_m)) / 0.4 < 0.75
    assert np.abs(np.diff(up_m, axis=1)).max() < 0.4 * 2 * np.pi / 100 * world.terrain.cell_m * 3
    along = up_m[up_m.shape[0] // 2] - up_m.mean()
    crossings = int(np.sum(np.diff(np.sign(along)) != 0))
    length_m = world.terrain.cell_m * len(along)
    assert 75.0 < length_m / crossings < 300.0
    assert world.terrain.at(0.0, 0.0) == pytest.approx(0.0, abs=1e-6)


def test_hills_do_not_move_when_the_world_grows(tmp_path: Path) -> None:
    hills = "terrain: {kind: hills, amplitude_m: 5, wavelength_m: 300, seed: 4}\n"
    small = world_of(tmp_path, LINE, hills)
    large = world_of(tmp_path, LINE, hills + "trees: [{kind: bush, place_ne_m: [-333, 401], height_m: 1}]\n")
    for place in ((0.0, 0.0), (40.0, -33.0), (-71.0, 90.0)):
        assert small.terrain.at(*place) == pytest.approx(large.terrain.at(*place), abs=0.02)


@pytest.mark.parametrize("name", ["map.png", "map.tiff", "map.npy"])
def test_a_height_map_is_north_up_with_the_start_in_its_middle(tmp_path: Path, name: str) -> None:
    up = slope(81, 101, 5.0, 0.08, -0.05)
    if name.endswith("npy"):
        np.save(tmp_path / name, up)
        scale = ""
    elif name.endswith("tiff"):
        cv2.imwrite(str(tmp_path / name), up.astype(np.float32))
        scale = ""
    else:
        cv2.imwrite(str(tmp_path / name), np.round(100 * (up + 50)).astype(np.uint16))
        scale = ", scale_m: 0.01"
    assert_slope(with_map(tmp_path, f"file: {name}, cell_m: 5{scale}"), 0.08, -0.05, abs_m=0.02)


def test_a_height_map_can_be_laid_anywhere(tmp_path: Path) -> None:
    np.save(tmp_path / "map.npy", slope(81, 101, 5.0, 0.08, -0.05))
    world = with_map(tmp_path, "file: map.npy, cell_m: 5, south_west_ne_m: [-190, -230]")
    assert_slope(world, 0.08, -0.05)


def write_geotiff(
    path: Path, up: NDArray[np.float32], step_deg: float, west_deg: float, north_deg: float, *,
    is_point: bool = False, model: int = 2, no_data: str | None = None, order: str = "<",
) -> None:  # fmt: skip
    """A GeoTIFF of one strip of float32, by its specification: https://docs.ogc.org/is/19-008r4/19-008r4.html."""
    rows, columns = up.shape
    keys = [1, 1, 0, 2, 1024, 0, 1, model, 1025, 0, 1, 2 if is_point else 1]
    tags: list[tuple[int, int, str, tuple[float, ...]]] = [
        (256, 4, "I", (columns,)), (257, 4, "I", (rows,)), (258, 3, "H", (32,)), (259, 3, "H", (1,)),
        (262, 3, "H", (1,)), (273, 4, "I", (8,)), (277, 3, "H", (1,)), (278, 4, "I", (rows,)),
        (279, 4, "I", (up.nbytes,)), (339, 3, "H", (3,)), (33550, 12, "d", (step_deg, step_deg, 0.0)),
        (33922, 12, "d", (0.0, 0.0, 0.0, west_deg, north_deg, 0.0)), (34735, 3, "H", tuple(keys)),
    ]  # fmt: skip
    if no_data is not None:
        tags.append((42113, 2, "B", (*no_data.encode(), 0)))
    data = up.astype(f"{order}f4").tobytes()
    directory_at = 8 + len(data)
    more_at = directory_at + 2 + 12 * len(tags) + 4
    entries, more = b"", b""
    for tag, kind, code, values in tags:
        packed = struct.pack(f"{order}{len(values)}{code}", *values)
        place = packed.ljust(4, b"\0") if len(packed) <= 4 else struct.pack(f"{order}I", more_at + len(more))
        more += packed if len(packed) > 4 else b""
        entries += struct.pack(f"{order}HHI", tag, kind, len(values)) + place
    mark = b"II" if order == "<" else b"MM"
    path.write_bytes(
        mark + struct.pack(f"{order}HI", 42, directory_at) + data
        + struct.pack(f"{order}H", len(tags)) + entries + b"\0\0\0\0" + more
    )  # fmt: skip


@pytest.mark.parametrize(("is_point", "order"), [(False, "<"), (True, "<"), (False, ">")])
def test_a_geotiff_lies_where_it_says(tmp_path: Path, is_point: bool, order: str) -> None:
    step_deg = 1e-4
    cell_north_m = np.radians(step_deg) * EARTH_RADIUS_M
    cell_east_m = cell_north_m * np.cos(np.radians(4.9))
    # The start of the test worlds, 4.9 N 73.9 W, lies in the middle of the pixel in row 30, column 40.
    up = slope(61, 81, 1.0, 0.08 * cell_north_m, -0.05 * cell_east_m).astype(np.float32) + 2600.0
    half = 0.0 if is_point else 0.5
    write_geotiff(
        tmp_path / "map.tif", up, step_deg, -73.9 - (40 + half) * step_deg, 4.9 + (30 + half) * step_deg,
        is_point=is_point, order=order,
    )  # fmt: skip
    place = read_place(tmp_path / "map.tif")
    assert place is not None
    assert place.latitude_deg == pytest.approx(4.9 + 30 * step_deg, abs=1e-9)
    assert place.longitude_deg == pytest.approx(-73.9 - 40 * step_deg, abs=1e-9)
    assert_slope(with_map(tmp_path, "file: map.tif"), 0.08, -0.05, abs_m=0.03)


def test_what_a_geotiff_does_not_know_is_refused(tmp_path: Path) -> None:
    up = np.zeros((61, 81), np.float32)
    up[28, 40] = -9999.0
    corner = (1e-4, -73.9 - 40.5e-4, 4.9 + 30.5e-4)
    write_geotiff(tmp_path / "map.tif", up, *corner, no_data="-9999")
    with pytest.raises(WorldError, match="without a height"):
        with_map(tmp_path, "file: map.tif")
    write_geotiff(tmp_path / "map.tif", np.zeros((61, 81), np.float32), *corner, model=1)
    with pytest.raises(WorldError, match="projected system"):
        with_map(tmp_path, "file: map.tif")


@pytest.mark.parametrize(
    ("terrain", "key"),
    [
        ("file: nowhere.png, cell_m: 5", "terrain.file"),
        ("file: small.npy, cell_m: 5", "terrain.file"),
        ("file: plain.npy", "terrain.cell_m"),
        ("file: words.png, cell_m: 5", "terrain.file"),
        ("file: words.npy, cell_m: 5", "terrain.file"),
        ("file: colour.png, cell_m: 5", "terrain.file"),
        ("file: hole.npy, cell_m: 5", "terrain.file"),
        ("file: plain.npy, cell_m: 0", "terrain.cell_m"),
    ],
)
def test_a_wrong_height_map_names_its_key(tmp_path: Path, terrain: str, key: str) -> None:
    np.save(tmp_path / "small.npy", np.zeros((9, 9)))
    plain = np.zeros((101, 101))
    np.save(tmp_path / "plain.npy", plain)
    plain[50, 50] = np.nan
    np.save(tmp_path / "hole.npy", plain)
    (tmp_path / "words.png").write_text("no picture", encoding="utf-8")
    (tmp_path / "words.npy").write_text("no array", encoding="utf-8")
    cv2.imwrite(str(tmp_path / "colour.png"), np.zeros((99, 99, 3), np.uint8))
    with pytest.raises(WorldError) as caught:
        with_map(tmp_path, terrain)
    assert f" {key}:" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_conductor_that_touches_a_hill_is_refused(tmp_path: Path) -> None:
    up = slope(101, 101, 5.0, 0.0, 0.0)
    up[:, 55:58] = 14.0  # a dam 30 m east of the start, in the middle of a span
    np.save(tmp_path / "dam.npy", up)
    with pytest.raises(WorldError, match=r"lines\.0\.conductors: .* touches the ground 2\d m north and (2|3)\d m east"):
        with_map(tmp_path, "file: dam.npy, cell_m: 5")


def test_a_world_too_wide_is_refused(tmp_path: Path) -> None:
    with pytest.raises(WorldError, match="km wide"):
        world_of(tmp_path, LINE, "trees: [{kind: bush, place_ne_m: [0, 20000], height_m: 1}]\n")
