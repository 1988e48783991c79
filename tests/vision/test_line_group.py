"""The line group: which conductors belong to it, and where its middle passes the image centre."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vision.conductors import Conductor
from vision.line_group import abreast, choose_group, middle_offset_px, offset_px, spacing_px

SHAPE = (480, 640)
Axis = tuple[float, float, float, float]


def conductor(axis: Axis, coherence: float = 0.9, reach: float = 1.0, contrast: float = 80.0) -> Conductor:
    length_px = math.hypot(axis[2] - axis[0], axis[3] - axis[1])
    return Conductor(axis, (axis, axis), 2.0, reach, length_px, coherence, contrast, False, (0, 1))


def upright(x: float, lean: float = 0.0) -> Axis:
    return (x - lean, 479.0, x + lean, 0.0)


def test_the_group_is_what_looks_like_the_best_near_the_main_angle() -> None:
    line = [conductor(upright(x)) for x in (300.0, 340.0, 380.0)]
    others = [
        conductor((0.0, 240.0, 639.0, 240.0)),  # across
        conductor(upright(100.0), coherence=0.6),  # less sure
        conductor(upright(150.0), contrast=20.0),  # hardly stands out: a joint of the pavement
        conductor(upright(500.0), reach=0.4),  # short
    ]
    group, angle_rad = choose_group([*others, *line], math.radians(15), 0.7, 0.35)
    assert group == line
    assert angle_rad == pytest.approx(0.0, abs=1e-6)


def test_conductors_that_meet_far_away_are_one_group() -> None:
    fan = [conductor(upright(x, lean)) for x, lean in ((250.0, 25.0), (320.0, 0.0), (390.0, -25.0))]
    group, angle_rad = choose_group(fan, math.radians(15), 0.7, 0.35)
    assert group == fan
    assert angle_rad is not None


def test_no_conductors_no_group() -> None:
    assert choose_group([], 0.1, 0.7, 0.35) == ([], None)


@given(st.floats(-math.pi / 2, math.pi / 2), st.floats(-200, 200))
def test_the_offset_is_the_distance_along_the_right_hand_normal(angle_rad: float, wanted_px: float) -> None:
    along = np.array([math.sin(angle_rad), -math.cos(angle_rad)])
    normal = np.array([math.cos(angle_rad), math.sin(angle_rad)])
    foot = np.array([319.5, 239.5]) + wanted_px * normal
    for sign in (1, -1):
        start, end = foot + sign * 30 * along, foot - sign * 100 * along
        line = conductor((start[0], start[1], end[0], end[1]))
        assert offset_px(line, angle_rad, SHAPE) == pytest.approx(wanted_px, abs=1e-6)


def test_the_middle_lies_halfway_between_the_outermost() -> None:
    group = [conductor(upright(x)) for x in (340.0, 360.0, 440.0)]
    assert middle_offset_px(group, 0.0, SHAPE) == pytest.approx(390.0 - 319.5)


def test_a_bent_conductor_is_one() -> None:
    upper, lower = conductor((200.0, 0.0, 204.0, 200.0)), conductor((204.0, 195.0, 190.0, 479.0))
    beside = conductor(upright(270.0))
    row = abreast([upper, lower, beside], 0.0, SHAPE)
    assert len(row) == 2
    assert beside in row


def test_the_spacing_is_that_of_neighbours() -> None:
    row = [conductor(upright(x)) for x in (440.0, 300.0, 340.0, 380.0)]
    assert spacing_px(row, 0.0, SHAPE) == pytest.approx(40.0)
    assert spacing_px(row[:1], 0.0, SHAPE) is None
    assert abreast([], 0.0, SHAPE) == []
