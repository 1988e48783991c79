"""Conductors: two opposite edges are one, and where its middle passes the image centre."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vision.conductors import Conductor, find_conductors, frame_chord_px, middle_offset_px, n_abreast, offset_px

SHAPE = (480, 640)
UP, DOWN = (479.0, 0.0), (0.0, 479.0)


def edge(x: float, way: tuple[float, float] = UP) -> tuple[float, float, float, float]:
    return (x, way[0], x, way[1])


def conductors_of(*edges: tuple[float, float, float, float]) -> list[Conductor]:
    lines = np.array(edges, dtype=np.float64).reshape(-1, 4)
    covered_px = np.hypot(lines[:, 2] - lines[:, 0], lines[:, 3] - lines[:, 1])
    return find_conductors(lines, covered_px, SHAPE, 24.0, math.radians(2.5))


def test_two_opposite_edges_are_one_conductor() -> None:
    (conductor,) = conductors_of(edge(100.0, UP), edge(103.0, DOWN))
    assert conductor.width_px == pytest.approx(3.0)
    assert conductor.axis[0] == pytest.approx(101.5)
    assert conductor.reach == pytest.approx(479 / 480)
    assert set(conductor.members) == {0, 1}


@pytest.mark.parametrize(
    "other",
    [
        edge(103.0, UP),  # a stair: the same polarity
        edge(130.0, DOWN),  # a road
        (103.0, 0.0, 143.0, 479.0),  # not parallel
    ],
)
def test_what_is_no_pair_stays_two_edges(other: tuple[float, float, float, float]) -> None:
    conductors = conductors_of(edge(100.0, UP), other)
    assert [conductor.width_px for conductor in conductors] == [None, None]


def test_the_nearest_edge_is_the_partner() -> None:
    conductors = conductors_of(edge(100.0, UP), edge(112.0, DOWN), edge(103.0, DOWN), edge(109.0, UP))
    assert sorted(c.width_px or 0.0 for c in conductors) == pytest.approx([3.0, 3.0])


def test_edges_of_different_places_are_no_pair() -> None:
    conductors = conductors_of((100.0, 479.0, 100.0, 300.0), (103.0, 0.0, 103.0, 180.0))
    assert len(conductors) == 2


def test_no_edges_no_conductors() -> None:
    assert conductors_of() == []


@given(st.floats(-math.pi / 2, math.pi / 2), st.floats(-200, 200))
def test_the_offset_is_the_distance_along_the_right_hand_normal(angle_rad: float, wanted_px: float) -> None:
    along = np.array([math.sin(angle_rad), -math.cos(angle_rad)])
    normal = np.array([math.cos(angle_rad), math.sin(angle_rad)])
    foot = np.array([319.5, 239.5]) + wanted_px * normal
    for sign in (1, -1):
        start, end = foot + sign * 30 * along, foot - sign * 100 * along
        conductor = Conductor((start[0], start[1], end[0], end[1]), 2.0, 1.0, 130.0, (0, 1))
        assert offset_px(conductor, angle_rad, SHAPE) == pytest.approx(wanted_px, abs=1e-6)


def test_the_middle_lies_halfway_between_the_outermost() -> None:
    conductors = [Conductor((x, 0.0, x, 479.0), 2.0, 1.0, 479.0, (0,)) for x in (340.0, 360.0, 440.0)]
    assert middle_offset_px(conductors, 0.0, SHAPE) == pytest.approx(390.0 - 319.5)


def test_a_bright_middle_is_no_second_conductor() -> None:
    outer = Conductor((200.0, 0.0, 200.0, 479.0), 12.0, 1.0, 479.0, (0, 1))
    inner = Conductor((201.0, 0.0, 201.0, 479.0), 4.0, 1.0, 479.0, (2, 3))
    other = Conductor((210.0, 0.0, 210.0, 479.0), 4.0, 1.0, 479.0, (4, 5))
    assert n_abreast([inner, outer, other], 0.0, SHAPE) == 2


def test_a_bent_conductor_is_one() -> None:
    upper = Conductor((200.0, 0.0, 204.0, 200.0), 2.0, 0.4, 200.0, (0, 1))
    lower = Conductor((204.0, 195.0, 190.0, 479.0), 2.0, 0.6, 285.0, (2, 3))
    beside = Conductor((270.0, 0.0, 270.0, 479.0), 2.0, 1.0, 479.0, (4, 5))
    assert n_abreast([upper, lower, beside], 0.0, SHAPE) == 2


def test_a_long_edge_beside_a_little_texture_is_no_conductor() -> None:
    (conductor,) = conductors_of(edge(100.0, UP), (103.0, 200.0, 103.0, 260.0))
    assert conductor.width_px is None


def test_a_conductor_before_changing_ground_reaches_across() -> None:
    # Dark over bright ground above, bright over dark ground below: the left edge turns its polarity over.
    conductors = conductors_of((100.0, 479.0, 100.0, 240.0), (103.0, 240.0, 103.0, 479.0), (100.0, 0.0, 100.0, 239.0))
    assert [c.width_px for c in conductors] == [pytest.approx(3.0)]
    assert conductors[0].reach == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize(
    ("axis", "chord_px"),
    [
        ((100.0, 100.0, 100.0, 110.0), 480.0),
        ((100.0, 100.0, 90.0, 100.0), 640.0),
        ((10.0, 0.0, 0.0, 10.0), 11 * math.sqrt(2)),  # the corner: from x = 10.5 to y = 10.5
    ],
)
def test_the_chord_ends_at_the_frame(axis: tuple[float, float, float, float], chord_px: float) -> None:
    assert frame_chord_px(axis, SHAPE) == pytest.approx(chord_px)
