"""Sun, sky and haze: shadows of the right length on the right side, slopes, Koschmieder's law."""

import dataclasses
import math

import numpy as np
import pytest

from sitl.render.daylight import daylight_of, light_map, shade_nodes, sky_mix, sunlit
from sitl.render.ground import light_at, light_grid, light_ground, widen
from sitl.render.lens import CameraMount, camera_pose, ray_table
from sitl.render.renderer import Renderer
from sitl.world.height_grid import HeightGrid
from sitl.world.light import LIGHTS
from sitl.world.records import Building, Light
from sitl.world.surface import surface_of
from tests.sitl.render.scenes import CAMERA, NOON, ahead, looking_down, scene

HOUSE = Building((0.0, 0.0), 0.0, 12.0, 8.0, 4.0, 4.0, "flat")


@pytest.mark.parametrize("elevation_deg", [25.0, 45.0])
@pytest.mark.parametrize(
    ("azimuth_deg", "towards"), [(90.0, (0, -1)), (270.0, (0, 1)), (0.0, (-1, 0)), (180.0, (1, 0))]
)
def test_a_house_throws_its_shadow_away_from_the_sun(
    elevation_deg: float, azimuth_deg: float, towards: tuple[int, int]
) -> None:
    light = dataclasses.replace(NOON, azimuth_rad=math.radians(azimuth_deg), elevation_rad=math.radians(elevation_deg))
    surface = surface_of(scene(buildings=(HOUSE,)))
    sun = light_map(surface, light)[..., 0].astype(float) / 255.0
    half = (6.0, 4.0)[0 if towards[0] else 1]
    away_m = np.arange(half + 0.75, 20.0, surface.cell_m)
    rows = np.round((towards[0] * away_m - surface.south_m) / surface.cell_m).astype(int)
    columns = np.round((towards[1] * away_m - surface.west_m) / surface.cell_m).astype(int)
    line = sun[rows, columns]
    level = math.sin(math.radians(elevation_deg))
    assert line[0] < 0.1
    assert line[-1] == pytest.approx(level, abs=0.01)
    length_m = away_m[np.argmax(line > level / 2.0)] - half
    assert length_m == pytest.approx(4.0 / math.tan(math.radians(elevation_deg)), abs=0.5)
    opposite = sun[
        np.round((-towards[0] * away_m - surface.south_m) / surface.cell_m).astype(int),
        np.round((-towards[1] * away_m - surface.west_m) / surface.cell_m).astype(int),
    ]
    assert np.all(opposite[2:] > 0.95 * level)


def test_the_shadow_is_seen_in_the_picture() -> None:
    pose = looking_down(0.0, 0.0, 25.0)
    with_house, without = (Renderer(scene(buildings=houses), CAMERA).light(pose).copy() for houses in ((HOUSE,), ()))
    west = round(CAMERA.cx_px - CAMERA.fx_px * 6.0 / 25.0)
    shade = with_house[110:130, west - 3 : west + 3].mean() / without[110:130, west - 3 : west + 3].mean()
    assert 0.15 < shade < 0.75


def test_a_slope_towards_the_sun_is_brighter() -> None:
    norths = np.arange(-10.0, 11.0)
    grid = HeightGrid(-10.0, -10.0, 1.0, np.tile(0.3 * np.abs(norths), (21, 1)))  # a valley that runs north
    sun = light_map(grid, NOON)[10, :, 0] / 255.0
    norm = math.hypot(1.0, 0.3)
    assert sun[4] == pytest.approx((1.0 + 0.3) / math.sqrt(2.0) / norm, abs=0.02)
    assert sun[16] == pytest.approx((1.0 - 0.3) / math.sqrt(2.0) / norm, abs=0.02)


@pytest.mark.parametrize("depth_m", [100.0, 3000.0, 10_000.0])
def test_haze_takes_contrast_as_koschmieder_says(depth_m: float) -> None:
    light = Light(0.0, math.radians(50.0), 0.58, 0.42, visibility_m=10_000.0)
    table = daylight_of(light).table
    shares = np.full((2, 2, 2), 255, dtype=np.uint8)
    arguments = (
        1.0 / depth_m, 0.0, 0.0, np.array([0.0, 0.0, -depth_m]),
        np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), shares, np.array([0.0, 0.0, 1.0]), table,
    )  # fmt: skip
    here = np.array(light_at(*arguments))
    left = 0.05 ** (depth_m / 10_000.0)
    assert here[:3] == pytest.approx(left * (table[0] + table[1]), rel=2e-3)
    assert here[3:] == pytest.approx((1.0 - left) * table[2], rel=0.02)
    assert light_at.py_func(*arguments) == pytest.approx(here, rel=1e-5)


def test_a_white_sheet_in_full_light_shows_white() -> None:
    for name, light in LIGHTS.items():
        table = daylight_of(light).table.astype(float)
        luminance = np.array([0.0722, 0.7152, 0.2126])
        assert table[0] @ luminance == pytest.approx(light.direct, abs=1e-6), name
        assert table[1] @ luminance == pytest.approx(light.sky, abs=1e-6), name
    low, noon = (daylight_of(LIGHTS[name]).table[0] for name in ("low_sun", "noon"))
    assert low[2] / low[0] > 1.5 * noon[2] / noon[0]  # redder near the horizon


def test_the_sky_is_brighter_towards_the_sun_and_at_the_horizon() -> None:
    light = dataclasses.replace(LIGHTS["low_sun"], azimuth_rad=0.0)
    mount = ahead(math.radians(-10.0))
    north, south = (
        Renderer(scene(light=light), CAMERA, mount).light(
            dataclasses.replace(looking_down(0.0, 0.0, 10.0), quaternion=q)
        )[:100].mean(axis=(1, 2)).copy()
        for q in ((1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
    )  # fmt: skip
    assert north.mean() > 1.2 * south.mean()
    assert south[90] > south[5]


def test_compiled_light_equals_plain_python() -> None:
    rng = np.random.default_rng(6)
    up_m = rng.uniform(0.0, 1.5, (9, 12)).astype(np.float32)
    for ahead_part, side in ((0.6, 0.2), (-0.6, 0.3), (0.5, -0.5)):
        arguments = (up_m, 0.5, ahead_part, side, 0.4)
        np.testing.assert_allclose(sunlit(*arguments), sunlit.py_func(*arguments), atol=1e-6)
    shares = np.zeros((2, 9, 12, 2), dtype=np.uint8)
    rest = (up_m, up_m + 0.1, up_m - 0.1, np.ones_like(up_m), 0.5, np.array([0.5, 0.3, 0.8]))
    shade_nodes(shares[0], *rest)
    shade_nodes.py_func(shares[1], *rest)
    assert np.abs(shares[0].astype(int) - shares[1]).max() <= 1
    table = daylight_of(NOON).table
    assert sky_mix(table, 0.6, 0.0, 0.8) == pytest.approx(sky_mix.py_func(table, 0.6, 0.0, 0.8), rel=1e-5)

    rays = widen(ray_table(dataclasses.replace(CAMERA, width_px=24, height_px=16, cx_px=12.0, cy_px=8.0)))
    centre, ned_from_camera = camera_pose(looking_down(1.0, 2.0, 9.0), CameraMount())
    inverse = rng.uniform(-0.02, 0.2, rays.shape[1:]).astype(np.float32)
    surface, detail = rng.integers(0, 256, (2, 16, 24, 4), dtype=np.uint8).view(np.int32)[..., 0]
    is_edge = rng.integers(0, 2, (4, 6), dtype=np.uint8)
    results = []
    for on_grid, on_ground in ((light_grid, light_ground), (light_grid.py_func, light_ground.py_func)):
        grid, light = np.empty((6, 5, 7), np.float32), np.empty((16, 24, 3), np.float32)
        on_grid(grid, inverse, rays, centre, ned_from_camera, shares[0], np.array([0.0, 0.0, 0.5]), table)
        on_ground(light, surface, detail, (3, 12), grid, is_edge, inverse)
        results.append((grid, light))
    np.testing.assert_allclose(results[0][0], results[1][0], rtol=1e-4, atol=1e-6)
    np.testing.assert_allclose(results[0][1], results[1][1], rtol=1e-4, atol=1e-6)
