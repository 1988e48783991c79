"""Textures keep their brightness over all levels and go on without a step; kernels equal plain Python."""

import cv2
import numpy as np
import pytest

from sitl.pose import Pose
from sitl.render.lens import CameraMount, camera_pose, pinhole, ray_table
from sitl.render.texture import Texture, build_texture, dither, layout, map_texture


def random_texture(*, repeats: bool) -> Texture:
    picture = np.random.default_rng(1).integers(0, 256, (64, 96, 4), dtype=np.uint8)
    return build_texture(picture, (-3.2, -4.8), (6.4, 9.6), repeats=repeats)


def look(texture: Texture, north_m: float, east_m: float, height_m: float) -> np.ndarray:
    """What a camera of 40 x 30 pixels sees straight below, (30, 40, 4)."""
    camera = pinhole(40, 30, 1.0)
    centre, ned_from_camera = camera_pose(Pose(0, north_m, east_m, -height_m, (1.0, 0.0, 0.0, 0.0)), CameraMount())
    columns, rows = np.empty((2, 30, 40), dtype=np.float32)
    frame = np.array([*texture.corner_m, *texture.size_m, texture.texel_m, float(texture.repeats), 99.0])
    map_texture(
        columns, rows, np.full((30, 40), 1.0 / height_m, np.float32), ray_table(camera), dither(40, 30), centre,
        ned_from_camera, camera.fx_px, texture.levels, frame, 0.0,
    )  # fmt: skip
    return np.asarray(cv2.remap(texture.atlas, columns, rows, cv2.INTER_LINEAR)).astype(float)


@pytest.mark.parametrize("repeats", [False, True])
def test_a_texture_keeps_its_brightness_over_all_levels(repeats: bool) -> None:
    texture = random_texture(repeats=repeats)
    assert texture.levels[:, 2:].astype(int).tolist() == [[64 >> k, 96 >> k] for k in range(5)]
    first = None
    for row, column, n_rows, n_columns in texture.levels.astype(int):
        level = texture.atlas[row : row + n_rows, column : column + n_columns]
        first = level.mean() if first is None else first
        assert level.mean() == pytest.approx(first, abs=0.6)
        beyond = level[0] if repeats else level[-1]
        np.testing.assert_array_equal(texture.atlas[row + n_rows, column : column + n_columns], beyond)
        beyond = level[:, -1] if repeats else level[:, 0]
        np.testing.assert_array_equal(texture.atlas[row : row + n_rows, column - 1], beyond)


def test_brightness_is_the_same_from_every_height() -> None:
    means = [look(random_texture(repeats=True), 0.0, 0.0, height_m).mean() for height_m in (8.0, 30.0, 200.0)]
    assert means == pytest.approx([means[-1]] * 3, rel=0.02)


def test_beyond_its_bounds_a_texture_is_mirrored() -> None:
    """From over the northern edge, the picture's upper half is its lower half, upside down."""
    seen = look(random_texture(repeats=False), 3.2, 1.0, 3.0)
    assert np.abs(seen[:15] - seen[:14:-1]).max() <= 1.0
    assert seen.std() > 10.0


def test_a_repeating_texture_comes_again_after_its_size() -> None:
    texture = random_texture(repeats=True)
    assert np.abs(look(texture, 0.3, 0.7, 3.0) - look(texture, 0.3 + 6.4, 0.7 - 9.6, 3.0)).max() <= 8.0


def test_a_size_that_cannot_be_halved_is_refused() -> None:
    with pytest.raises(ValueError, match="multiples"):
        layout(100, 64)
    with pytest.raises(ValueError, match="four channels"):
        build_texture(np.zeros((64, 64, 3), dtype=np.uint8), (0.0, 0.0), (1.0, 1.0), repeats=True)


@pytest.mark.parametrize("repeats", [False, True])
def test_compiled_mapping_equals_plain_python(repeats: bool) -> None:
    camera = pinhole(40, 30, 1.3)
    texture = random_texture(repeats=repeats)
    centre, ned_from_camera = camera_pose(Pose(0, 3.0, -5.0, -9.0, (0.9, 0.3, -0.2, 0.25)), CameraMount())
    inverse = np.random.default_rng(2).uniform(-0.05, 0.3, (30, 40)).astype(np.float32)
    frame = np.array([*texture.corner_m, *texture.size_m, texture.texel_m, float(repeats), 3.5])
    maps = []
    for kernel in (map_texture, map_texture.py_func):
        columns, rows = np.empty((2, 30, 40), dtype=np.float32)
        first, last = kernel(
            columns, rows, inverse, ray_table(camera), dither(40, 30), centre, ned_from_camera, camera.fx_px,
            texture.levels, frame, 0.7,
        )  # fmt: skip
        maps.append(np.stack([columns, rows]))
        assert 0 <= first <= last < 30
    assert maps[0].min() == -10.0  # some of it is sky
    np.testing.assert_allclose(maps[0], maps[1], atol=2e-2)
