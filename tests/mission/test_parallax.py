"""How high over a line, from sights along the way across it."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mission.parallax import Parallax

ASSUMED_M = 6.0


def sights(height_m: float, way_m: float, n_lines: int = 3, step_m: float = 0.08) -> Parallax:
    """The sights of a line 8 m ahead and `height_m` below, on the way across it."""
    parallax = Parallax(ASSUMED_M)
    for k in range(round(way_m / step_m) + 1):
        parallax.add(k * step_m, (8.0 - k * step_m) * ASSUMED_M / height_m, n_lines)
    return parallax


@given(height_m=st.floats(2.0, 40.0), way_m=st.floats(1.5, 12.0))
def test_the_height_is_what_the_way_tells(height_m: float, way_m: float) -> None:
    assert sights(height_m, way_m).height_m == pytest.approx(height_m, rel=1e-6)


def test_a_short_way_tells_nothing() -> None:
    assert sights(6.0, 0.9).height_m is None


def test_a_line_that_stays_as_far_is_endlessly_high() -> None:
    parallax = Parallax(ASSUMED_M)
    for k in range(40):
        parallax.add(0.08 * k, 5.0, 1)
    assert parallax.height_m == math.inf


def test_a_conductor_that_comes_into_view_moves_the_middle_and_not_the_height() -> None:
    parallax = Parallax(ASSUMED_M)
    for k in range(60):
        way_m, n_lines = 0.08 * k, 1 + k // 20
        parallax.add(way_m, 8.0 - way_m + 0.8 * n_lines, n_lines)
    assert parallax.height_m == pytest.approx(ASSUMED_M)


def test_another_line_begins_anew() -> None:
    parallax = sights(16.0, 3.0)
    for k in range(30):
        parallax.add(3.0 + 0.08 * k, 5.0 - 0.08 * k, 3)
    assert parallax.height_m == pytest.approx(ASSUMED_M, rel=0.01)
