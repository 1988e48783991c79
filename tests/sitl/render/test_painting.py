"""The ground is painted as its records say, kept on disk, and the painters' kernels equal plain Python."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sitl.render.noise import periodic_noise
from sitl.render.pasture import paint_fields, track_at
from sitl.render.projection import clip_to_view, project_point
from sitl.render.vegetation import Plant, paint_plants
from sitl.world.records import Light

SUN = Light(math.radians(90.0), math.radians(45.0), direct=0.58, sky=0.42, visibility_m=1e4)
VIEW = np.array([-0.7, 0.7, -0.5, 0.5])
coordinates = st.lists(st.floats(-20.0, 20.0), min_size=3, max_size=3)


def test_noise_tiles_and_has_unit_spread() -> None:
    noise = periodic_noise(128, 4, 4, np.random.default_rng(1))
    assert noise.mean() == pytest.approx(0.0, abs=1e-4)
    assert noise.std() == pytest.approx(1.0, abs=1e-4)
    seam = np.abs(noise[0] - noise[-1]).mean()
    assert seam == pytest.approx(np.abs(np.diff(noise, axis=0)).mean(), rel=0.5)
    with pytest.raises(ValueError, match="evenly"):
        periodic_noise(100, 8, 2, np.random.default_rng(1))


def test_compiled_painting_equals_plain_python() -> None:
    rng = np.random.default_rng(2)
    coarse, fine = rng.normal(size=(8, 8, 5)).astype(np.float32), rng.normal(size=(4, 4)).astype(np.float32)
    coarse[..., 3:] = np.abs(coarse[..., 3:]) * 2
    compiled, plain = np.zeros((2, 32, 32, 4), dtype=np.uint8)
    palette = rng.uniform(0.2, 0.8, (6, 3))
    paint_fields(compiled, coarse, fine, palette, 1.5)
    paint_fields.py_func(plain, coarse, fine, palette, 1.5)
    assert compiled[..., 3].max() <= 128
    assert np.abs(compiled.astype(int) - plain).max() <= 1
    assert compiled.std() > 5.0


@given(north_m=st.floats(-500, 500))
@settings(deadline=None)
def test_the_track_repeats(north_m: float) -> None:
    here, there = track_at(north_m, 200.0), track_at(north_m + 200.0, 200.0)
    assert here == pytest.approx(there, abs=1e-6)
    assert track_at.py_func(north_m, 200.0) == pytest.approx(here)


def test_a_tree_hides_the_ground_and_shades_it_away_from_the_sun() -> None:
    """At the picture's corner, so that it wraps over both edges; the sun in the east throws the shadow west."""
    picture = np.full((256, 256, 4), 160, dtype=np.uint8)
    paint_plants(picture, [Plant(0.0, 0.0, 2.0)], 0.05, SUN, np.random.default_rng(3))
    assert picture[0, 0, 3] > 200  # leaves
    assert picture[-10, -10, 3] > 200
    west, east = picture[0, -60, :3].astype(int), picture[0, 60, :3].astype(int)
    assert np.all(east == 160)
    assert np.all(west < 130)
    assert picture[0, -60, 3] == 160  # the shadow is on the grass
    assert np.all(picture[128, 128] == 160)


@given(start=coordinates, end=coordinates)
@settings(deadline=None)
def test_what_is_clipped_is_in_view(start: list[float], end: list[float]) -> None:
    p, q = np.array(start), np.array(end)
    first, last = clip_to_view(p, q, VIEW)
    assert clip_to_view.py_func(p, q, VIEW) == pytest.approx((first, last))

    def is_seen(fraction: float, slack: float) -> bool:
        x, y, z = p + fraction * (q - p)
        return bool(z >= 0.05 - slack and abs(x) <= 0.7 * z + slack and abs(y) <= 0.5 * z + slack)

    for fraction in np.linspace(0.0, 1.0, 23):
        if first <= fraction <= last:
            assert is_seen(fraction, 1e-6)
        else:
            assert not is_seen(fraction, -1e-6)


def test_projecting_compiled_equals_plain_python() -> None:
    for is_fisheye in (0.0, 1.0):
        lens = np.array([400.0, 410.0, 320.0, 240.0, -0.2, 0.05, 0.001, -0.002, 0.01, is_fisheye])
        for point in ((1.0, -2.0, 5.0), (0.0, 0.0, 5.0)):
            assert project_point(*point, lens) == pytest.approx(project_point.py_func(*point, lens))
