"""Edges: thresholds follow the image, codes follow the gradient, bad images are refused in words."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.vision.nadir_frames import draw_line, expose, ground
from vision.edges import N_DIRECTIONS, encode_directions, find_edges, to_grey


def edges_of(image: np.ndarray) -> np.ndarray:
    return find_edges(image, 1.0, 0.96, 0.4, 2.0)


def test_a_plain_image_has_no_edges() -> None:
    assert not edges_of(np.full((60, 80), 77, dtype=np.uint8)).any()


def test_contrast_below_the_floor_is_no_edge() -> None:
    image = np.full((60, 80), 100, dtype=np.uint8)
    image[:, 40:] = 103
    assert not edges_of(image).any()
    image[:, 40:] = 130
    assert edges_of(image).any()


def test_the_thresholds_rise_with_the_texture() -> None:
    shares = [np.mean(edges_of(expose(ground(1, contrast), 2)) > 0) for contrast in (10.0, 30.0)]
    # Three times the contrast gives three times the gradient, but not many more edges.
    assert shares[1] < 1.5 * shares[0]


@given(st.floats(-math.pi, math.pi))
def test_a_code_is_the_direction_towards_the_brighter_side(direction_rad: float) -> None:
    y, x = np.mgrid[:64, :64] - 31.5
    aside = x * math.cos(direction_rad) + y * math.sin(direction_rad)
    codes = edges_of(np.clip(128 + 40 * aside, 60, 200).astype(np.uint8))[8:-8, 8:-8]
    found = codes[codes > 0]
    assert found.size > 20
    turns = (found - 1.0) / N_DIRECTIONS - direction_rad / (2 * math.pi)
    assert np.max(np.abs(turns - np.rint(turns))) < 1.5 / N_DIRECTIONS


def test_encoding_compiled_equals_plain_python() -> None:
    rng = np.random.default_rng(4)
    edges = (rng.random((20, 31)) < 0.5).astype(np.uint8) * 255
    gradient_x = rng.integers(-900, 900, edges.shape).astype(np.int16)
    gradient_y = rng.integers(1, 900, edges.shape).astype(np.int16)
    compiled, plain = np.zeros_like(edges), np.zeros_like(edges)
    encode_directions(edges, gradient_x, gradient_y, compiled)
    encode_directions.py_func(edges, gradient_x, gradient_y, plain)
    np.testing.assert_array_equal(compiled, plain)
    exact = np.rint(np.arctan2(gradient_y, gradient_x) / (2 * math.pi) * N_DIRECTIONS) % N_DIRECTIONS
    assert np.mean(compiled[edges > 0] == exact[edges > 0] + 1) > 0.9
    assert not compiled[edges == 0].any()


def test_both_edges_of_a_thin_line_are_kept_apart() -> None:
    codes = edges_of(expose(draw_line(ground(5, 4.0), 0.0, 0.5, 1.0, 220.0), 6))
    column_codes = codes[:, 310:330]
    turns = np.where(column_codes > 0, (column_codes - 1.0) / N_DIRECTIONS, np.nan)
    right, left = np.minimum(turns, 1.0 - turns) < 0.05, np.abs(turns - 0.5) < 0.05  # where the gradient points to
    assert right.any(axis=1).mean() > 0.95
    assert left.any(axis=1).mean() > 0.95


def test_colour_becomes_grey_and_grey_stays() -> None:
    grey = np.arange(12, dtype=np.uint8).reshape(3, 4)
    np.testing.assert_array_equal(to_grey(grey), grey)
    np.testing.assert_array_equal(to_grey(np.repeat(grey[:, :, None], 3, axis=2)), grey)


@pytest.mark.parametrize(
    ("image", "words"),
    [
        (np.zeros((4, 4), dtype=np.float32), "float32"),
        (np.zeros((0, 4), dtype=np.uint8), r"\(0, 4\)"),
        (np.zeros((4, 4, 4), dtype=np.uint8), r"\(4, 4, 4\)"),
        (np.zeros(4, dtype=np.uint8), r"\(4,\)"),
    ],
)
def test_what_is_no_image_is_refused(image: np.ndarray, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        to_grey(image)
