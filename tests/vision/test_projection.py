"""Projection: every line's sum at once, and the edge lines that its peaks become."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from tests.vision.nadir_frames import draw_line, expose, ground
from vision import edge_lines, gradient, projection
from vision.edge_lines import ProjectionFinder, ProjectionSettings
from vision.gradient import UNIT, unit_gradient
from vision.orientation import line_angle_distance_rad, segment_angles_rad
from vision.peaks import find_peaks, least_sums, line_lengths
from vision.projection import project
from vision.refinement import keep_distinct, refine, sum_columns


def projected(field: np.ndarray) -> np.ndarray:
    height, width = field.shape
    buffers = tuple(np.full((height, height + width), 77, dtype=np.int16) for _ in range(2))
    return buffers[project(field, *buffers)]


@settings(max_examples=60)
@given(
    arrays(np.int16, st.tuples(st.integers(1, 40), st.integers(1, 30)), elements=st.integers(-63, 63)),
    st.data(),
)
def test_every_pixel_counts_once_for_each_lean(field: np.ndarray, data: st.DataObject) -> None:
    height = field.shape[0]
    sums = projected(field)
    lean = data.draw(st.integers(0, height - 1))
    assert int(sums[lean, height - lean :].astype(int).sum()) == int(field.astype(int).sum())


@settings(max_examples=80)
@given(st.integers(2, 320), st.data())
def test_a_sum_runs_along_its_line(height: int, data: st.DataObject) -> None:
    # Where a row's pixels hold their own column, a sum tells in which column it crossed that row.
    lean = data.draw(st.integers(0, height - 1))
    row = data.draw(st.integers(0, height - 1))
    field = np.zeros((height, height + 10), dtype=np.int16)
    field[row] = np.arange(height + 10)
    crossed = int(projected(field)[lean, height + 3])
    assert crossed == pytest.approx(3 + lean * row / (height - 1), abs=2.0)


def test_buffers_may_hold_anything() -> None:
    rng = np.random.default_rng(3)
    field = rng.integers(-63, 64, (37, 52)).astype(np.int16)
    fresh = projected(field)
    first, second = (rng.integers(-999, 999, (37, 89)).astype(np.int16) for _ in range(2))
    again = (first, second)[project(field, first, second)]
    for lean in range(37):
        np.testing.assert_array_equal(again[lean, 37 - lean :], fresh[lean, 37 - lean :])


def test_the_unit_gradient_knows_the_way_and_not_the_strength() -> None:
    ramp = np.tile(np.arange(0, 240, 4, dtype=np.uint8), (30, 1))
    for image, sign in ((ramp, 1), (ramp[:, ::-1], -1)):
        unit_x, unit_y = unit_gradient(image, 1, 0.1)
        assert (np.abs(unit_x[1:-1, 1:-1] - sign * UNIT) <= 1).all()
        assert (unit_y == 0).all()
    weak, _ = unit_gradient(np.tile(np.arange(60, dtype=np.uint8), (30, 1)), 1, 20.0)
    assert 0 <= int(weak.max()) <= 4  # below the contrast that counts


@pytest.mark.parametrize("shape", [(1, 1), (1, 500), (500, 1), (2, 2), (3, 300), (31, 31), (261, 33)])
def test_small_images_have_no_lines_or_honest_ones(shape: tuple[int, int]) -> None:
    found = ProjectionFinder(ProjectionSettings()).find(np.zeros(shape, dtype=np.uint8))
    assert found.segments.shape == (0, 4)


@settings(max_examples=25)
@given(angle_deg=st.floats(-90, 90), offset_px=st.floats(-150, 150), level=st.sampled_from([30.0, 210.0]))
def test_both_edges_of_a_drawn_line_are_found(angle_deg: float, offset_px: float, level: float) -> None:
    angle_rad = math.radians(angle_deg)
    image = expose(draw_line(ground(1, 12.0), angle_rad, offset_px, 6.0, level), 2)
    found = ProjectionFinder(ProjectionSettings()).find(image)
    segments = found.segments[:2]
    assert np.degrees(line_angle_distance_rad(segment_angles_rad(segments), angle_rad)).max() < 0.5
    middle_x, middle_y = segments[:, [0, 2]].mean(axis=1) - 319.5, segments[:, [1, 3]].mean(axis=1) - 239.5
    asides_px = middle_x * math.cos(angle_rad) + middle_y * math.sin(angle_rad) - offset_px
    assert sorted(asides_px) == pytest.approx([-3.0, 3.0], abs=1.0)
    assert (found.step[:2] > 0).all()  # the brighter side is on the right
    assert (found.coherence[:2] > 0.7).all()


def test_compiled_and_plain_python_agree() -> None:
    image = expose(draw_line(ground(5, 4.0, 90, 200), -0.3, 5.0, 6.0, 215.0), 6)
    unit = np.zeros((2, *image.shape), dtype=np.int8), np.zeros((2, *image.shape), dtype=np.int8)
    gradient.normalise(image, np.float32(2.5), unit[0][0], unit[0][1])
    gradient.normalise.py_func(image, np.float32(2.5), unit[1][0], unit[1][1])
    assert (np.abs(unit[0][0].astype(int) - unit[1][0]) <= 1).all()
    unit_x, unit_y = unit[0]
    field = np.zeros(image.shape, dtype=np.int16), np.zeros(image.shape, dtype=np.int16)
    edge_lines.across(unit_x, unit_y, 1, 1.0, field[0])
    edge_lines.across.py_func(unit_x, unit_y, 1, 1.0, field[1])
    np.testing.assert_array_equal(*field)
    height, width = image.shape
    sums = projected(field[0])
    end = height + width
    block = np.zeros(7 * end, dtype=np.int16), np.zeros(7 * end, dtype=np.int16)
    projection.merge_blocks(sums.reshape(-1), block[0], 0, 4, 7, height, end)
    projection.merge_blocks.py_func(sums.reshape(-1), block[1], 0, 4, 7, height, end)
    np.testing.assert_array_equal(*block)
    lengths = line_lengths(height, width, 30)
    np.testing.assert_array_equal(lengths, line_lengths.py_func(height, width, 30))
    peaks = np.zeros((99, 4)), np.zeros((99, 4))
    least = least_sums(lengths, 0.3, float(UNIT))
    np.testing.assert_array_equal(least, least_sums.py_func(lengths, 0.3, float(UNIT)))
    n_found = find_peaks(sums, least, lengths, peaks[0])
    assert n_found == find_peaks.py_func(sums, least, lengths, peaks[1])
    np.testing.assert_allclose(*peaks)
    columns = np.zeros((2, 2, 7), dtype=np.int64)
    for at_top, slope in ((8.0, 0.3), (-3.0, 0.9), (width - 2.0, 0.0)):
        arguments = (unit_x.reshape(-1), unit_y.reshape(-1), width, 2, height - 3, at_top, slope)
        assert sum_columns(*arguments, columns[0]) == pytest.approx(sum_columns.py_func(*arguments, columns[1]))
        np.testing.assert_array_equal(columns[0], columns[1])
    lines = [refine(unit_x, unit_y, slope, middle, sign) for slope, middle, sign, _ in peaks[0][:n_found]]
    assert n_found > 0
    for line, (slope, middle, sign, _) in zip(lines, peaks[0], strict=False):
        np.testing.assert_allclose(line, refine.py_func(unit_x, unit_y, slope, middle, sign), atol=1e-6)
    table = np.array([line for line in lines if line[5] > 0])
    np.testing.assert_array_equal(keep_distinct(table, 1.5), keep_distinct.py_func(table, 1.5))
    steps = edge_lines.measure_steps(image, table[:, :4], 1.0)
    np.testing.assert_allclose(steps, edge_lines.measure_steps.py_func(image, table[:, :4], 1.0))
