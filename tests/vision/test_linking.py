"""Linking: what continues is joined, what does not stays apart, and no order or direction matters."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from vision import linking
from vision.linking import link_segments, segment_lengths_px

TURN_RAD = math.radians(3.0)


def link(*segments: tuple[float, float, float, float]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    return link_segments(np.array(segments, dtype=np.float64).reshape(-1, 4), TURN_RAD, 2.5, 100.0)


def test_collinear_pieces_become_one_line() -> None:
    lines, covered_px = link((0, 0, 40, 0), (150, 0, 200, 0), (60, 0, 100, 0))
    np.testing.assert_allclose(lines, [[0, 0, 200, 0]], atol=1e-9)
    np.testing.assert_allclose(covered_px, [130])


@pytest.mark.parametrize(
    "other",
    [
        (60.0, 4.0, 100.0, 4.0),  # too far aside
        (60.0, 0.0, 99.0, 8.0),  # another direction
        (100.0, 0.0, 60.0, 0.0),  # the other edge: the brighter side is on the other hand
        (200.0, 0.0, 240.0, 0.0),  # too far ahead
    ],
)
def test_what_does_not_continue_stays_apart(other: tuple[float, float, float, float]) -> None:
    lines, _ = link((0, 0, 40, 0), other)
    assert len(lines) == 2


def test_a_short_pair_reaches_less_far_than_a_long_one() -> None:
    assert len(link((0, 0, 20, 0), (70, 0, 90, 0))[0]) == 2
    assert len(link((0, 0, 100, 0), (150, 0, 170, 0))[0]) == 1


def test_the_longest_line_comes_first() -> None:
    lines, covered_px = link((0, 50, 30, 50), (0, 0, 40, 0), (45, 0, 90, 0), (0, 100, 60, 100))
    np.testing.assert_allclose(segment_lengths_px(lines), [90, 60, 30])
    np.testing.assert_allclose(covered_px, [85, 60, 30])


def test_no_segment_gives_no_line() -> None:
    lines, covered_px = link()
    assert lines.shape == (0, 4)
    assert covered_px.shape == (0,)


pieces = st.lists(
    st.tuples(st.floats(0, 600), st.floats(0, 400), st.floats(0, 2 * math.pi), st.floats(15, 150)), max_size=12
).map(lambda rows: np.array([(x, y, x + r * math.cos(a), y + r * math.sin(a)) for x, y, a, r in rows]).reshape(-1, 4))


@given(pieces)
def test_swapped_ends_give_swapped_lines(segments: NDArray[np.float64]) -> None:
    swap = [2, 3, 0, 1]
    lines, covered_px = link_segments(segments, TURN_RAD, 2.5, 100.0)
    swapped, swapped_covered_px = link_segments(segments[:, swap], TURN_RAD, 2.5, 100.0)
    np.testing.assert_allclose(swapped, lines[:, swap], atol=1e-6)
    np.testing.assert_allclose(swapped_covered_px, covered_px, atol=1e-6)


@given(pieces)
def test_linking_invents_and_loses_nothing(segments: NDArray[np.float64]) -> None:
    lines, covered_px = link_segments(segments, TURN_RAD, 2.5, 100.0)
    assert len(lines) <= len(segments)
    assert np.all(covered_px <= segment_lengths_px(lines) + 1e-6)
    assert covered_px.sum() <= segment_lengths_px(segments).sum() + 1e-6
    assert np.all(np.diff(segment_lengths_px(lines)) <= 1e-9)


@settings(max_examples=30)
@given(pieces)
def test_linking_compiled_equals_plain_python(segments: NDArray[np.float64]) -> None:
    order = np.argsort(-segment_lengths_px(segments), kind="stable")
    results = []
    for kernel in (linking.link, linking.link.py_func):
        lines, covered_px = np.zeros((len(segments), 4)), np.zeros(len(segments))
        n_lines = kernel(segments[order], math.cos(TURN_RAD), 2.5, 100.0, lines, covered_px)
        results.append((n_lines, lines, covered_px))
    assert results[0][0] == results[1][0]
    np.testing.assert_allclose(results[0][1], results[1][1], atol=1e-9)
    np.testing.assert_allclose(results[0][2], results[1][2], atol=1e-9)


def test_adding_a_piece_compiled_equals_plain_python() -> None:
    compiled, plain = np.zeros(6), np.zeros(6)
    linking._add_piece(compiled, np.array([1.0, 2.0, 7.0, 10.0]))
    linking._add_piece.py_func(plain, np.array([1.0, 2.0, 7.0, 10.0]))
    np.testing.assert_allclose(compiled, plain)
    assert compiled[0] == pytest.approx(10.0)
