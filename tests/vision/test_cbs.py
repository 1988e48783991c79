"""Circle based search: the raster circle, the search's precision and its equivariance."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from tests.vision.nadir_frames import expose, ground, nadir_frame
from vision import cbs
from vision.cbs import find_segments
from vision.circle import make_circle, raster_circle
from vision.edges import N_DIRECTIONS, agrees, find_edges
from vision.linking import segment_lengths_px
from vision.orientation import line_angle_distance_rad, segment_angles_rad
from vision.records import Segments

CIRCLES = (make_circle(11), make_circle(7))
SIZE_PX = 160


def search(codes: NDArray[np.uint8], seed_grid_px: int = 1) -> Segments:
    return find_segments(codes, CIRCLES, 0.9, 0.6, 11, seed_grid_px)


def draw_edge(x: float, y: float, angle_rad: float, length_px: float) -> NDArray[np.uint8]:
    """A chain of edge pixels from x, y on, one pixel thick, with the codes that Canny would give it."""
    codes = np.zeros((SIZE_PX, SIZE_PX), dtype=np.uint8)
    step_x, step_y = math.sin(angle_rad), -math.cos(angle_rad)
    scale = 1.0 / max(abs(step_x), abs(step_y))
    steps = np.arange(int(length_px / scale) + 1)
    turn = math.atan2(step_x, -step_y) / (2 * math.pi)
    code = 1 + math.floor(turn * N_DIRECTIONS + 0.5) % N_DIRECTIONS
    columns = np.floor(x + steps * step_x * scale + 0.5).astype(int)
    rows = np.floor(y + steps * step_y * scale + 0.5).astype(int)
    codes[rows, columns] = code
    return codes


edge_chains = st.builds(
    draw_edge,
    x=st.floats(70, 90),
    y=st.floats(70, 90),
    angle_rad=st.floats(-math.pi, math.pi),
    length_px=st.floats(30, 60),
)


@pytest.mark.parametrize("radius_px", [1, 2, 7, 11, 20])
def test_a_raster_circle_is_round_closed_and_symmetric(radius_px: int) -> None:
    rim = raster_circle(radius_px)
    points = {tuple(point) for point in rim.tolist()}
    assert len(points) == len(rim)
    assert np.all(np.abs(np.hypot(rim[:, 0], rim[:, 1]) - radius_px) < 0.75)
    assert points == {(y, x) for x, y in points} == {(-x, y) for x, y in points}
    assert np.max(np.abs(np.roll(rim, 1, axis=0) - rim)) == 1


def test_a_circle_without_a_rim_is_refused() -> None:
    with pytest.raises(ValueError, match="radius 0 px"):
        raster_circle(0)


def test_chords_run_through_the_centre_without_holes() -> None:
    circle = make_circle(11)
    np.testing.assert_array_equal(circle.chords[:, 11], 0)
    np.testing.assert_array_equal(circle.chords, -circle.chords[:, ::-1])
    assert np.max(np.abs(np.diff(circle.chords, axis=1))) == 1


@given(x=st.floats(70, 90), y=st.floats(70, 90), angle_rad=st.floats(-math.pi, math.pi), length_px=st.floats(30, 60))
def test_an_edge_is_found_once_with_its_angle_its_ends_and_its_direction(
    x: float, y: float, angle_rad: float, length_px: float
) -> None:
    segments = search(draw_edge(x, y, angle_rad, length_px))
    assert segments.shape == (1, 4)
    end_x, end_y = x + length_px * math.sin(angle_rad), y - length_px * math.cos(angle_rad)
    # The brighter side is on the right, so the search knows which end is the first one.
    np.testing.assert_allclose(segments[0], (x, y, end_x, end_y), atol=2.5)
    wanted = math.atan2(math.sin(2 * angle_rad), math.cos(2 * angle_rad)) / 2
    assert line_angle_distance_rad(segment_angles_rad(segments), wanted)[0] < math.atan(1.0 / length_px)


@given(edge_chains, edge_chains, st.integers(-9, 9), st.integers(-9, 9))
def test_a_shifted_image_gives_shifted_segments(
    first: NDArray[np.uint8], second: NDArray[np.uint8], shift_x: int, shift_y: int
) -> None:
    codes = np.where(first > 0, first, second)
    shifted = np.roll(codes, (shift_y, shift_x), axis=(0, 1))
    np.testing.assert_allclose(
        search(shifted), search(codes) + np.array([shift_x, shift_y, shift_x, shift_y]), atol=1e-6
    )


@given(edge_chains)
def test_a_quarter_turn_turns_the_segment(codes: NDArray[np.uint8]) -> None:
    turned = np.rot90(codes)  # anticlockwise: x, y -> y, size - 1 - x
    turned = np.where(turned > 0, (turned - 1 - N_DIRECTIONS // 4) % N_DIRECTIONS + 1, 0).astype(np.uint8)
    (x1, y1, x2, y2) = search(codes)[0]
    np.testing.assert_allclose(search(turned)[0], (y1, SIZE_PX - 1 - x1, y2, SIZE_PX - 1 - x2), atol=1.5)


def test_a_gradient_along_the_line_makes_no_line() -> None:
    codes = draw_edge(60, 80, math.pi / 2, 60)
    assert len(search(codes)) == 1
    along = np.where(codes > 0, (codes - 1 + N_DIRECTIONS // 4) % N_DIRECTIONS + 1, 0).astype(np.uint8)
    assert len(search(along)) == 0


def test_the_walk_crosses_a_small_hole_and_ends_at_a_large_one() -> None:
    codes = draw_edge(20, 80, math.pi / 2, 120)
    codes[:, 60:63] = 0
    codes[:, 100:120] = 0
    segments = search(codes)
    # What is left behind the large hole is too short for a circle.
    np.testing.assert_allclose(segments[:, 0], [20, 120], atol=1)
    np.testing.assert_allclose(segments[:, 2], [99, 140], atol=1)


def test_a_line_at_the_border_is_found_to_its_ends() -> None:
    codes = np.zeros((50, 90), dtype=np.uint8)
    codes[0, :] = 1 + N_DIRECTIONS // 4
    np.testing.assert_allclose(np.sort(search(codes)[0]), [0, 0, 0, 89], atol=0.5)


def test_the_seed_grid_loses_no_long_line() -> None:
    codes = find_edges(nadir_frame(8, 0.4, 30.0), 1.0, 0.96, 0.4, 2.0)
    everywhere, on_grid = search(codes, 1), search(codes, 6)
    long_px, long_on_grid_px = (
        lengths_px[lengths_px > 40.0].sum() for lengths_px in map(segment_lengths_px, (everywhere, on_grid))
    )
    assert long_on_grid_px > 0.98 * long_px


def test_the_search_stops_when_its_list_is_full(monkeypatch: pytest.MonkeyPatch) -> None:
    codes = find_edges(nadir_frame(8, 0.4, 30.0), 1.0, 0.96, 0.4, 2.0)
    monkeypatch.setattr(cbs, "_MAX_SEGMENTS", 3)
    assert len(search(codes)) == 3


@settings(max_examples=10)
@given(st.integers(0, 1000))
def test_the_search_compiled_equals_plain_python(seed: int) -> None:
    image = expose(ground(seed, 20.0, 90, 70), seed)
    image[30:33, :] = 230
    codes = np.pad(find_edges(image, 1.0, 0.9, 0.4, 2.0), 7)
    circle = CIRCLES[1]
    arguments = (7, circle.chords, circle.wanted, circle.candidates, 11, 0.6, 11)
    results = []
    for kernel in (cbs.search, cbs.search.py_func):
        left, found = codes.copy(), np.zeros((100, 4))
        n_found = kernel(left, *arguments, 2, found, 0)
        results.append((n_found, left, found))
    assert results[0][0] == results[1][0] >= 2
    np.testing.assert_array_equal(results[0][1], results[1][1])
    np.testing.assert_allclose(results[0][2], results[1][2], atol=1e-9)


def test_the_inner_kernels_compiled_equal_plain_python() -> None:
    codes = draw_edge(40, 80, math.radians(75), 90)
    codes[:, 90:94] = 0
    flat, circle = codes.ravel(), CIRCLES[0]
    steps = circle.chords[:, :, 1] * SIZE_PX + circle.chords[:, :, 0]
    beside = np.where(np.abs(circle.chords[:, 0, 1]) >= np.abs(circle.chords[:, 0, 0]), 1, SIZE_PX)
    rows, columns = np.nonzero(codes)
    for y, x in zip(rows.tolist(), columns.tolist(), strict=True):
        chord = (flat, y * SIZE_PX + x, steps, beside, circle.wanted, circle.candidates, 20)
        assert cbs._valid_chord(*chord) == cbs._valid_chord.py_func(*chord)
    beside_steps = (0, 1, SIZE_PX)
    for y, x in zip(rows.tolist(), columns.tolist(), strict=True):
        for step in beside_steps:
            near = (flat, y * SIZE_PX + x + 1, step, int(codes[y, x]) - 1)
            assert cbs._is_set(*near) == cbs._is_set.py_func(*near)
    for code in range(65):
        assert all(agrees(code, wanted) == agrees.py_func(code, wanted) for wanted in range(64))
    walks = []
    for add, fit, walk in (
        (cbs._add, cbs._fit, cbs._walk),
        (cbs._add.py_func, cbs._fit.py_func, cbs._walk.py_func),
    ):
        left, sums = codes.copy(), np.zeros(6)
        for y, x in zip(rows[:20].tolist(), columns[:20].tolist(), strict=True):
            add(sums, float(x), float(y))
        line = fit(sums)
        end = walk(
            left, sums, float(columns[0]), float(rows[0]), -1.0, -line[2], -line[3], 11, 7, np.zeros((11, 2), np.int64)
        )
        walks.append((line, end, left, sums))
    np.testing.assert_allclose(walks[0][0], walks[1][0])
    np.testing.assert_allclose(walks[0][1], walks[1][1])
    np.testing.assert_array_equal(walks[0][2], walks[1][2])
    np.testing.assert_allclose(walks[0][3], walks[1][3])
