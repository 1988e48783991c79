"""Histogram of oriented segments: the angle convention, the closed period, the refined peak."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from vision.orientation import (
    line_angle_distance_rad,
    main_angle_rad,
    mean_line_angle_rad,
    oriented_histogram,
    segment_angles_rad,
)

angles = st.floats(-math.pi / 2, math.pi / 2)


def segments_at(*angles_rad: float) -> NDArray[np.float64]:
    return np.array([(100, 100, 100 + 50 * math.sin(a), 100 - 50 * math.cos(a)) for a in angles_rad])


@pytest.mark.parametrize(
    ("segment", "angle_deg"),
    [
        ((0, 10, 0, 0), 0),  # up
        ((0, 0, 0, 10), 0),  # down is the same line
        ((0, 10, 10, 0), 45),  # up and right: clockwise from up
        ((10, 10, 0, 0), -45),
        ((0, 0, 10, 0), 90),
        ((10, 0, 0, 0), 90),  # never -90
    ],
)
def test_angles_run_clockwise_from_image_up(segment: tuple[float, ...], angle_deg: float) -> None:
    assert math.degrees(segment_angles_rad(np.array([segment], dtype=float))[0]) == pytest.approx(angle_deg)


@given(angles)
def test_swapped_ends_have_the_same_angle(angle_rad: float) -> None:
    segments = segments_at(angle_rad)
    swapped = segments[:, [2, 3, 0, 1]]
    assert line_angle_distance_rad(segment_angles_rad(swapped), float(segment_angles_rad(segments)[0]))[0] < 1e-9


@given(st.lists(st.tuples(angles, st.floats(0.1, 900)), min_size=1, max_size=20))
def test_the_histogram_keeps_every_length(rows: list[tuple[float, float]]) -> None:
    angles_rad, weights = np.array(rows).T
    histogram = oriented_histogram(angles_rad, weights)
    assert histogram.shape == (180,)
    assert histogram.sum() == pytest.approx(weights.sum())
    assert np.all(histogram >= 0)


def test_the_period_is_closed() -> None:
    histogram = oriented_histogram(np.array([math.pi / 2]), np.array([24.0]))
    np.testing.assert_allclose(histogram[[177, 178, 179, 0, 1, 2, 3]], [1, 3, 5, 6, 5, 3, 1])


@given(angles, st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=9))
def test_the_peak_is_refined_to_the_mean_of_its_segments(angle_rad: float, spread_deg: list[float]) -> None:
    angles_rad = segment_angles_rad(segments_at(*(angle_rad + math.radians(s) for s in spread_deg)))
    main_rad = main_angle_rad(angles_rad, np.full(len(angles_rad), 50.0))
    assert main_rad is not None
    assert -math.pi / 2 < main_rad <= math.pi / 2
    expected_rad = angle_rad + math.radians(float(np.mean(spread_deg)))
    assert line_angle_distance_rad(np.array([main_rad]), expected_rad)[0] < math.radians(0.01)


@given(angles, angles, st.floats(-math.pi, math.pi))
def test_a_turned_scene_has_a_turned_main_angle(first_rad: float, second_rad: float, turn_rad: float) -> None:
    weights = np.array([300.0, 300.0, 100.0])
    before = main_angle_rad(segment_angles_rad(segments_at(first_rad, first_rad + 0.01, second_rad)), weights)
    after = main_angle_rad(
        segment_angles_rad(segments_at(*(a + turn_rad for a in (first_rad, first_rad + 0.01, second_rad)))), weights
    )
    assert before is not None
    assert after is not None
    # A segment at the rim of the peak's neighbourhood may fall in on one side and out on the other.
    assert line_angle_distance_rad(np.array([after]), before + turn_rad)[0] < math.radians(1.0)


def test_length_decides_and_not_number() -> None:
    angles_rad = np.radians([40.0, 40.5, *(-30.0 + np.arange(8) * 0.2)])
    weights = np.array([500.0, 500.0, *np.full(8, 30.0)])
    main_rad = main_angle_rad(angles_rad, weights)
    assert main_rad is not None
    assert math.degrees(main_rad) == pytest.approx(40.25)


def test_no_segments_have_no_main_angle() -> None:
    assert main_angle_rad(np.zeros(0), np.zeros(0)) is None


def test_the_mean_of_angles_on_both_sides_of_horizontal_is_horizontal() -> None:
    mean_rad = mean_line_angle_rad(np.radians([89.0, -89.0]), np.ones(2))
    assert abs(math.degrees(mean_rad)) == pytest.approx(90.0)
