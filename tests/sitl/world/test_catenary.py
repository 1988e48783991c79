"""Conductors hang in catenaries."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sitl.world.catenary import catenary_parameter_m, hang

spans = st.floats(5.0, 800.0)
sag_parts = st.floats(1e-4, 0.3)
rises = st.floats(-0.3, 0.3)


@given(span_m=spans, sag_part=sag_parts, rise_part=rises)
def test_a_conductor_hangs_by_its_sag_in_a_catenary(span_m: float, sag_part: float, rise_part: float) -> None:
    sag_m, rise_m = sag_part * span_m, rise_part * span_m
    points = hang((0.0, 0.0, -10.0), (0.0, span_m, -10.0 - rise_m), sag_m, span_m / 200.0)

    assert points[0] == pytest.approx([0.0, 0.0, -10.0])
    assert points[-1] == pytest.approx([0.0, span_m, -10.0 - rise_m])
    middle = len(points) // 2
    assert points[middle, 1] == pytest.approx(span_m / 2)
    assert points[middle, 2] == pytest.approx(-10.0 - rise_m / 2 + sag_m, rel=1e-9, abs=1e-7)
    # What tells a catenary from a parabola: y'' = sqrt(1 + y'^2) / a everywhere.
    step = span_m / (len(points) - 1)
    height = -points[:, 2]
    slope = (height[2:] - height[:-2]) / (2 * step)
    bend = (height[2:] - 2 * height[1:-1] + height[:-2]) / step**2
    a = catenary_parameter_m(span_m, rise_m, sag_m)
    assert bend * a == pytest.approx(np.hypot(1.0, slope), rel=2e-3)


@given(span_m=spans, sag_part=sag_parts, rise_part=rises)
def test_a_conductor_seen_from_the_other_end_is_the_same(span_m: float, sag_part: float, rise_part: float) -> None:
    start, end = (3.0, -2.0, -9.0), (3.0, -2.0 + span_m, -9.0 - rise_part * span_m)
    there = hang(start, end, sag_part * span_m, 1.0)
    back = hang(end, start, sag_part * span_m, 1.0)
    np.testing.assert_allclose(there, back[::-1], atol=1e-6)


@pytest.mark.parametrize(("span_m", "sag_m"), [(0.0, 1.0), (40.0, 0.0), (40.0, -1.0), (40.0, 41.0)])
def test_an_impossible_sag_is_refused(span_m: float, sag_m: float) -> None:
    with pytest.raises(ValueError, match="m"):
        catenary_parameter_m(span_m, 0.0, sag_m)
