"""Edges of ridges: a thin line keeps both of its edges, a step loses its own."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from tests.vision.nadir_frames import draw_line, expose, ground
from vision.edges import N_DIRECTIONS
from vision.ridge_edges import drop_steps, find_ridge_edges, ways_across


def edges_of(grey: NDArray[np.uint8], min_ridge: float = 0.7) -> NDArray[np.uint8]:
    return find_ridge_edges(grey, 1.5, 0.6, 0.4, 2.0, min_ridge)


def share_facing(codes: NDArray[np.uint8], direction_rad: float, is_beside: NDArray[np.bool_]) -> float:
    """The edge pixels that face `direction_rad` within 15 degrees, for each pixel of a line 240 px long."""
    turns = (codes[is_beside & (codes > 0)] - 1.0) / N_DIRECTIONS - direction_rad / (2 * math.pi)
    return float(np.sum(np.abs(turns - np.rint(turns)) < 15 / 360)) / 240


def aside_px(angle_rad: float) -> NDArray[np.float64]:
    y, x = np.mgrid[:240, :240] - 119.5
    aside: NDArray[np.float64] = x * math.cos(angle_rad) + y * math.sin(angle_rad)
    return aside


@settings(max_examples=40)
@given(angle_rad=st.floats(-math.pi / 2, math.pi / 2), width_px=st.floats(1.2, 5.0), is_bright=st.booleans())
def test_a_thin_line_keeps_both_of_its_edges(angle_rad: float, width_px: float, is_bright: bool) -> None:
    levels = draw_line(ground(5, 4.0, 240, 240), angle_rad, 0.0, width_px, 200.0 if is_bright else 20.0)
    codes = edges_of(expose(levels, 6))
    aside = aside_px(angle_rad)
    inwards = 0.0 if is_bright else math.pi
    for side in (-1, 1):
        is_beside = (aside * side > 0) & (aside * side < width_px / 2 + 2)
        direction_rad = angle_rad + inwards + (math.pi if side == 1 else 0.0)
        # A line that slopes has fewer pixels than its length.
        assert share_facing(codes, direction_rad, is_beside) > 0.65


@settings(max_examples=20)
@given(angle_rad=st.floats(-math.pi / 2, math.pi / 2))
def test_a_step_loses_its_edge_and_keeps_it_when_no_ridge_is_asked_for(angle_rad: float) -> None:
    aside = aside_px(angle_rad)
    grey = expose(np.where(aside > 0, 160.0, 90.0), 7, noise=1.0)
    is_beside = (np.abs(aside) < 2) & (np.hypot(*(np.mgrid[:240, :240] - 119.5)) < 110)
    assert share_facing(edges_of(grey, 0.0), angle_rad, is_beside) > 0.6
    assert share_facing(edges_of(grey, 0.75), angle_rad, is_beside) < 0.1


def test_a_ridge_on_the_wrong_side_saves_no_edge() -> None:
    codes = np.zeros((20, 20), dtype=np.uint8)
    codes[10, 10] = 1  # brighter to the right
    steps_2 = np.zeros((16, 16), dtype=np.int32)
    steps_2[8, 8] = 100**2  # 3 pixels more on each side: this is pixel 5, 5
    for column, ridge, is_kept in ((9, 80, True), (7, -80, True), (9, -80, False), (7, 80, False), (9, 60, False)):
        kept, ridges = codes.copy(), np.zeros((16, 16), dtype=np.int16)
        ridges[8, column] = ridge
        drop_steps(kept, steps_2, ridges, ways_across(3), 2, 0.7)
        assert kept.any() == is_kept


def test_ways_across_lead_from_dark_to_bright_through_the_pixel_itself() -> None:
    ways = ways_across(3)
    assert ways.shape == (N_DIRECTIONS, 7, 2)
    assert not ways[:, 3].any()
    turns_rad = 2 * math.pi * np.arange(N_DIRECTIONS) / N_DIRECTIONS
    for i, reach_px in ((0, -3), (6, 3)):
        wanted = reach_px * np.stack([np.cos(turns_rad), np.sin(turns_rad)], axis=1)
        assert np.max(np.abs(ways[:, i] - wanted)) <= 0.5 + 1e-9


def test_dropping_compiled_equals_plain_python() -> None:
    rng = np.random.default_rng(8)
    codes = (rng.integers(0, 65, (23, 31)) * (rng.random((23, 31)) < 0.5)).astype(np.uint8)
    steps_2 = rng.integers(0, 40_000, (17, 21)).astype(np.int32)
    ridges = rng.normal(0, 100, (17, 21)).astype(np.int16)
    compiled, plain = codes.copy(), codes.copy()
    drop_steps(compiled, steps_2, ridges, ways_across(3), 2, 0.8)
    drop_steps.py_func(plain, steps_2, ridges, ways_across(3), 2, 0.8)
    np.testing.assert_array_equal(compiled, plain)
    assert 0 < np.count_nonzero(compiled) < np.count_nonzero(codes)


def test_a_plain_image_and_one_below_the_floor_have_no_edges() -> None:
    image = np.full((60, 80), 100, dtype=np.uint8)
    assert not edges_of(image).any()
    image[:, 40:42] = 103
    assert not edges_of(image).any()
    image[:, 40:42] = 130
    assert edges_of(image).any()


@pytest.mark.parametrize("size", [(1, 1), (1, 40), (40, 1), (2, 3), (3, 3)])
def test_tiny_images_are_answered(size: tuple[int, int]) -> None:
    image = np.random.default_rng(1).integers(0, 256, size, dtype=np.uint8)
    assert edges_of(image).shape == size
