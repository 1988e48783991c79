"""Thin strips cover what they should, at every angle and width; compiled kernels agree with plain Python."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from sitl.pose import Pose
from sitl.render.coverage import add_strip, square_below
from sitl.render.lens import CameraMount, camera_pose, lens_vector, pinhole
from sitl.render.projection import draw_discs, draw_members

FLAT = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
CYLINDER = np.array([0.3, 0.4, 0.5, 0.6, 0.2, 0.9])


def line_coverage(
    side_px: int, angle_rad: float, offset_px: float, width_px: float, n_pieces: int
) -> NDArray[np.float32]:
    """A line through the whole of an image, laid end to end of pieces."""
    direction = np.array([math.cos(angle_rad), math.sin(angle_rad)])
    normal = np.array([-direction[1], direction[0]])
    ends = (side_px - 1) / 2 + offset_px * normal + np.linspace(-side_px, side_px, n_pieces + 1)[:, None] * direction
    coverage = np.zeros((side_px, side_px), dtype=np.float32)
    shaded = np.zeros_like(coverage)
    for start, end in itertools.pairwise(ends):
        add_strip(coverage, shaded, np.array([*start, width_px, *end, width_px]), FLAT)
    np.testing.assert_array_equal(coverage, shaded)
    return coverage


@given(
    angle_rad=st.floats(-math.pi, math.pi),
    offset_px=st.floats(-10.0, 10.0),
    width_px=st.floats(0.05, 6.0),
    n_pieces=st.integers(1, 23),
)
def test_a_strip_shows_its_true_coverage_without_ripple(
    angle_rad: float, offset_px: float, width_px: float, n_pieces: int
) -> None:
    coverage = line_coverage(96, angle_rad, offset_px, width_px, n_pieces)
    is_flat = abs(math.cos(angle_rad)) >= abs(math.sin(angle_rad))
    across = coverage.sum(axis=0 if is_flat else 1)[24:72]
    true = width_px / max(abs(math.cos(angle_rad)), abs(math.sin(angle_rad)))
    assert across == pytest.approx(np.full(48, true), rel=1e-4)
    assert coverage.max() <= 1.0 + 1e-5


@given(distance=st.floats(-1.0, 1.0), angle_rad=st.floats(0.0, 2 * math.pi))
def test_a_square_is_cut_into_two_parts(distance: float, angle_rad: float) -> None:
    cosine, sine = math.cos(angle_rad), math.sin(angle_rad)
    steps = (np.arange(200) + 0.5) / 200 - 0.5
    counted = np.mean(steps[:, None] * cosine + steps[None, :] * sine <= distance)
    assert square_below(distance, cosine, sine) == pytest.approx(counted, abs=6e-3)
    assert square_below(distance, cosine, sine) + square_below(-distance, cosine, sine) == pytest.approx(1.0)


@pytest.mark.parametrize("shading", [FLAT, CYLINDER])
@given(strip=st.lists(st.floats(-5.0, 25.0), min_size=6, max_size=6))
def test_the_compiled_strip_equals_plain_python(shading: NDArray[np.float64], strip: list[float]) -> None:
    sizes = np.array(strip)
    sizes[[2, 5]] = np.abs(sizes[[2, 5]]) / 4
    compiled, plain = np.zeros((2, 16, 20), dtype=np.float32), np.zeros((2, 16, 20), dtype=np.float32)
    add_strip(compiled[0], compiled[1], sizes, shading)
    add_strip.py_func(plain[0], plain[1], sizes, shading)
    np.testing.assert_allclose(compiled, plain, atol=1e-6)


@pytest.mark.parametrize(
    "distortion",
    [(0.0, 0.0, 0.0, 0.0, 0.0, 0.0), (-0.2, 0.03, 0.001, -0.002, 0.0, 0.0), (-0.03, 0.006, -0.004, 0.001, 0.0, 1.0)],
    ids=["straight", "bent", "fisheye"],
)
@pytest.mark.parametrize("is_ribbon", [False, True])
def test_the_compiled_members_equal_plain_python(distortion: tuple[float, ...], is_ribbon: bool) -> None:
    camera = pinhole(48, 36, 1.2)
    lens = lens_vector(camera)
    lens[4:] = distortion
    centre, ned_from_camera = camera_pose(Pose(0, 0.2, 0.1, -6.0, (0.97, 0.1, -0.12, 0.18)), CameraMount())
    members = np.array(
        [
            [-4.0, 1.0, -3.0, 4.0, -0.5, -2.5, 0.02, 0.02, 1.0],
            [0.5, 0.5, 0.0, 0.5, 0.5, -5.0, 0.4, 0.2, 0.8],
            [9.0, -8.0, -9.0, -7.0, 9.0, -1.0, 0.1, 0.1, 1.0],
        ]
    )
    discs = np.array([[-0.3, 0.6, -2.0, 0.5, 0.9]])
    view = np.array([-0.8, 0.8, -0.6, 0.6])
    layers, found = [], []
    for draw, draw_tops in ((draw_members, draw_discs), (draw_members.py_func, draw_discs.py_func)):
        layer = np.zeros((2, 36, 48), dtype=np.float32)
        camera_from_ned = np.ascontiguousarray(ned_from_camera.T)
        strips = np.zeros((200, 8))
        n = draw(
            layer[0], layer[1], strips, members, is_ribbon, np.array([0.3, 0.6, 0.5]), np.array([0.5, 0.2, -0.84]),
            centre, camera_from_ned, lens, view,
        )  # fmt: skip
        n += draw_tops(layer[0], layer[1], strips[n:], discs, centre, camera_from_ned, lens)
        assert n >= 3
        layers.append(layer)
        found.append(strips)
    assert layers[0][0].max() > 0.5
    np.testing.assert_allclose(layers[0], layers[1], atol=1e-5)
    np.testing.assert_allclose(found[0], found[1], atol=1e-6)
