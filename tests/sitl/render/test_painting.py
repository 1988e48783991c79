"""The ground is painted as its records say, kept on disk, and the painters' kernels equal plain Python."""

from typing import Any, get_args

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sitl.render.fields import divide, paint_fields
from sitl.render.noise import periodic_noise, plane_noise
from sitl.render.paint import ground_of, picture_size
from sitl.render.projection import clip_to_view, project_point
from sitl.render.roofs import ROOF_PALETTE, house_rows, paint_houses
from sitl.render.strips import STRIP_PALETTE, paint_strips, strip_rows
from sitl.render.texture import finest
from sitl.render.vegetation import CROWN_PALETTE, paint_crowns, paint_litter
from sitl.world.records import Building, Roof, Strip, StripKind, Tree, TreeKind
from sitl.world.surface import tree_rows
from tests.sitl.render.scenes import scene

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


def test_plane_noise_has_unit_spread_and_no_period() -> None:
    noise = plane_noise((60, 90), 12.0, 3, np.random.default_rng(1))
    assert noise.shape == (60, 90)
    assert (noise.mean(), noise.std()) == pytest.approx((0.0, 1.0), abs=1e-4)
    assert np.abs(noise[:, 0] - noise[:, -1]).mean() > 3.0 * np.abs(np.diff(noise, axis=1)).mean()


def test_compiled_painting_equals_plain_python() -> None:
    rng = np.random.default_rng(2)
    coarse, fine = rng.normal(size=(8, 9, 4)).astype(np.float32), rng.normal(size=(4, 4)).astype(np.float32)
    coarse[..., 3] = np.abs(coarse[..., 3]) * 2
    owner = rng.integers(0, 3, (8, 9)).astype(np.int32)
    kinds = np.array([[0, 1, 0, 1.1, 0.4], [0, 0, 1, 0.9, 0.2], [0, 0, 0, 1, 1]], dtype=np.float32)
    compiled, plain = np.zeros((2, 32, 36, 4), dtype=np.uint8)
    palette = rng.uniform(0.2, 0.8, (5, 3))
    for paint, picture in ((paint_fields, compiled), (paint_fields.py_func, plain)):
        paint(picture, 4, 32, coarse, owner, kinds, fine, palette, np.array([1.5, 1.4]))
    assert not compiled[:4].any()
    assert np.abs(compiled.astype(int) - plain).max() <= 1
    assert compiled.std() > 5.0
    seeds, bend = rng.uniform(0, 20, (4, 2)), rng.normal(size=(2, 8, 9)).astype(np.float32)
    for got, expected in zip(divide(seeds, bend, 2.0, 2.2), divide.py_func(seeds, bend, 2.0, 2.2), strict=True):
        np.testing.assert_allclose(got, expected, rtol=1e-5)


POINTS = ((-6.0, -8.0), (0.0, 0.0), (6.0, 2.0))
STRIPS = tuple(
    Strip(kind, tuple((n, e + 0.3 * k) for n, e in POINTS), 2.0) for k, kind in enumerate(get_args(StripKind))
)
HOUSES = tuple(
    Building((4.0 * k - 4.0, 3.0), 0.4 + k, 3.0, 2.0, 2.5, 3.0, roof) for k, roof in enumerate(get_args(Roof))
)
TREES = tuple(Tree(kind, 3.0 * k - 4.0, -3.0, 3.0, 1.2) for k, kind in enumerate(get_args(TreeKind)))
CORNER, TEXEL = np.array([-8.0, -8.0]), np.array([0.25, 0.25])
FINE = np.random.default_rng(3).normal(size=(8, 8)).astype(np.float32)


@pytest.mark.parametrize(
    ("paint", "arguments"),
    [
        (paint_strips, (strip_rows(STRIPS), FINE, STRIP_PALETTE, CORNER, TEXEL)),
        (paint_houses, (house_rows(HOUSES), ROOF_PALETTE, CORNER, TEXEL, True)),
        (paint_houses, (house_rows(HOUSES), ROOF_PALETTE, CORNER, TEXEL, False)),
        (paint_litter, (tree_rows(TREES), CROWN_PALETTE, CORNER, TEXEL)),
        (paint_crowns, (tree_rows(TREES), CROWN_PALETTE, CORNER, TEXEL)),
    ],
    ids=["strips", "yards", "houses", "litter", "crowns"],
)
def test_compiled_painters_equal_plain_python(paint: Any, arguments: tuple[Any, ...]) -> None:
    compiled, plain = np.full((2, 64, 64, 4), 170, dtype=np.uint8)
    paint(compiled, *arguments)
    paint.py_func(plain, *arguments)
    assert np.mean(compiled != 170) > 0.03
    assert np.abs(compiled.astype(int) - plain).max() <= 1


def test_bands_make_the_same_picture() -> None:
    """A band that starts elsewhere paints its part of the whole, but for the finest grain."""
    whole, band = np.full((64, 64, 4), 170, dtype=np.uint8), np.full((32, 64, 4), 170, dtype=np.uint8)
    rest = (house_rows(HOUSES), ROOF_PALETTE)
    paint_houses(whole, *rest, CORNER, TEXEL, False)
    paint_houses(band, *rest, CORNER + np.array([8.0, 0.0]), TEXEL, False)
    np.testing.assert_array_equal(whole[32:], band)


def test_what_stands_somewhere_is_painted_there() -> None:
    ground = ground_of(
        scene(
            trees=(Tree("broadleaf", 20.0, 20.0, 9.0, 4.0),),
            buildings=(Building((-20.0, 20.0), 0.0, 12.0, 8.0, 4.0, 5.5, "metal"),),
            strips=(
                Strip("road", ((-40.0, -20.0), (40.0, -20.0)), 6.0),
                Strip("river", ((-40.0, 0.0), (40.0, 0.0)), 5.0),
            ),
        )
    ).surface
    picture = finest(ground.atlas, ground.levels)
    assert picture.shape == (1920, 1920, 4)

    def at(north_m: float, east_m: float) -> np.ndarray:
        i, j = round((north_m + 48.0) * 20), round((east_m + 48.0) * 20)
        return picture[i - 4 : i + 5, j - 4 : j + 5].reshape(-1, 4).mean(axis=0)

    assert at(20.0, 20.0)[3] == 255  # leaves
    blue, green, red, cover = at(-20.0, 21.5)
    assert min(blue, green, red) > 120  # sheet metal
    assert cover < 30
    blue, green, red, _ = at(10.0, -20.0)
    assert abs(red - blue) < 15  # asphalt
    assert at(0.0, 0.0)[3] < 12  # water
    assert at(40.0, 40.0)[3] > 80


def test_a_large_ground_gets_coarser_texels() -> None:
    assert picture_size((96.0, 96.0)) == (1920, 1920)
    rows, columns = picture_size((500.0, 1300.0))
    assert rows * columns <= 50_000_000
    assert rows % 128 == columns % 128 == 0
    assert max(picture_size((20.0, 3000.0))) <= 20_000


@given(start=coordinates, end=coordinates)
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
