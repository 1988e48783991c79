"""Conductors: which edges bound one, seen in drawn images with edges laid by hand."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.vision.nadir_frames import ground
from vision.conductors import Conductor, end_asides_px, find_conductors, frame_chord_px
from vision.edge_lines import edge_lines

SHAPE = (480, 640)
UP, DOWN = (479.0, 0.0), (0.0, 479.0)
Edge = tuple[float, float, float, float]


def edge(x: float, way: tuple[float, float] = UP) -> Edge:
    """An upright edge at `x`; its brighter side is on the right of its way."""
    return (x, way[0], x, way[1])


def stripes(*bodies: tuple[int, int, float]) -> NDArray[np.uint8]:
    """Even ground with upright bodies: first column, width, level."""
    image = np.full(SHAPE, 100, dtype=np.uint8)
    for first, width, level in bodies:
        image[:, first : first + width] = level
    return image


def conductors_of(image: NDArray[np.uint8], *edges: Edge, max_width_px: float = 24.0) -> list[Conductor]:
    segments = np.array(edges, dtype=np.float64).reshape(-1, 4)
    lengths_px = np.hypot(segments[:, 2] - segments[:, 0], segments[:, 3] - segments[:, 1])
    return find_conductors(edge_lines(image, segments, lengths_px), image, max_width_px, math.radians(2.5), 0.6)


def test_two_opposite_edges_are_one_conductor() -> None:
    (conductor,) = conductors_of(stripes((100, 4, 200)), edge(99.5, UP), edge(103.5, DOWN))
    assert conductor.width_px == pytest.approx(4.0)
    assert conductor.axis[0] == pytest.approx(101.5)
    assert conductor.reach == pytest.approx(479 / 480)
    assert conductor.contrast == pytest.approx(100.0, abs=5.0)
    assert sorted(x for x, *_ in conductor.edges) == pytest.approx([99.5, 103.5])


@pytest.mark.parametrize(
    "other",
    [
        edge(103.5, UP),  # a stair: the same polarity
        edge(130.0, DOWN),  # a road
        (103.0, 0.0, 143.0, 479.0),  # not parallel
        (103.5, 0.0, 103.5, 40.0),  # beside a short piece of the edge's upper end only
    ],
)
def test_what_is_no_pair_is_no_conductor(other: Edge) -> None:
    lower = (99.5, 479.0, 99.5, 60.0)
    assert conductors_of(stripes((100, 4, 200)), lower, other) == []


def test_two_conductors_side_by_side_are_two() -> None:
    image = stripes((100, 4, 30), (112, 4, 30))
    found = conductors_of(image, edge(99.5, DOWN), edge(103.5, UP), edge(111.5, DOWN), edge(115.5, UP))
    assert sorted(c.axis[0] for c in found) == pytest.approx([101.5, 113.5])


def test_a_thick_conductor_with_a_bright_middle_is_one() -> None:
    image = stripes((100, 5, 30), (105, 6, 200), (111, 5, 30))
    found = conductors_of(image, edge(99.5, DOWN), edge(104.5, UP), edge(110.5, DOWN), edge(115.5, UP))
    assert [c.width_px for c in found] == [pytest.approx(16.0)]


def test_what_sharpening_draws_beside_a_conductor_is_no_part_of_it() -> None:
    image = stripes((96, 4, 112), (100, 6, 30), (106, 4, 112))
    found = conductors_of(image, edge(95.5, UP), edge(99.5, DOWN), edge(105.5, UP), edge(109.5, DOWN))
    assert found[0].width_px == pytest.approx(6.0)


def test_a_body_before_texture_is_as_wide_as_it_is_even() -> None:
    image = np.clip(ground(4, 30.0), 0, 255).astype(np.uint8)
    image[:, 300:314] = 90
    image[:, 304:308] = 220
    (conductor,) = conductors_of(image, edge(303.5, UP), edge(307.5, DOWN))
    assert conductor.width_px == pytest.approx(14.0, abs=2.5)
    assert conductor.axis[0] == pytest.approx(306.5, abs=1.5)


def test_a_step_between_two_grounds_has_no_contrast() -> None:
    image = stripes((100, 8, 150), (108, 532, 200))
    (conductor,) = conductors_of(image, edge(99.5, UP), edge(107.5, DOWN))
    assert conductor.contrast == 0.0


def test_no_edges_no_conductors() -> None:
    assert conductors_of(stripes()) == []


@pytest.mark.parametrize(
    ("axis", "chord_px"),
    [
        ((100.0, 100.0, 100.0, 110.0), 480.0),
        ((100.0, 100.0, 90.0, 100.0), 640.0),
        ((10.0, 0.0, 0.0, 10.0), 11 * math.sqrt(2)),  # the corner: from x = 10.5 to y = 10.5
    ],
)
def test_the_chord_ends_at_the_frame(axis: Edge, chord_px: float) -> None:
    assert frame_chord_px(axis, SHAPE) == pytest.approx(chord_px)


def test_compiled_asides_equal_plain_python_and_are_right_hand_distances() -> None:
    segments = np.random.default_rng(3).uniform(0, 400, (20, 4))
    axis = (10.0, 300.0, 200.0, 20.0)
    found = end_asides_px(segments, axis)
    np.testing.assert_allclose(found, end_asides_px.py_func(segments, axis))
    up = (100.0, 400.0, 100.0, 0.0)
    np.testing.assert_allclose(end_asides_px(np.array([[130.0, 50.0, 80.0, 300.0]]), up), [[30.0, -20.0]])
