"""Which lines count as the one that is followed."""

import math

import pytest

from mission.guidance import WorldLine
from mission.known_line import KnownLine
from vision.records import LineEstimate

NORTHWARD = WorldLine(0.0, 0.0, 0.0)


def known(half_width_m: float = 0.0) -> KnownLine:
    line = KnownLine(half_width_m=half_width_m)
    line.begin(NORTHWARD, 0)
    return line


def beside(aside_m: float, turn_deg: float = 0.0) -> WorldLine:
    return WorldLine(math.radians(turn_deg), 0.0, aside_m)


def test_before_a_line_is_known_any_may_be_it() -> None:
    assert KnownLine().is_it(beside(30.0, 80.0), 0.0, 0.0, 0.0, is_whole=True)


@pytest.mark.parametrize(
    ("aside_m", "after_s", "is_it"), [(0.8, 0.0, True), (2.5, 0.0, False), (2.5, 10.0, True), (6.0, 1000.0, False)]
)
def test_a_line_does_not_jump_sideways_but_the_position_drifts(aside_m: float, after_s: float, is_it: bool) -> None:
    for sign in (-1, 1):
        assert known().is_it(beside(sign * aside_m), 0.0, 0.0, after_s, is_whole=True) is is_it


def test_the_middle_of_a_part_may_lie_beside_the_line() -> None:
    wide = known(half_width_m=4.0)
    assert wide.is_it(beside(4.5), 0.0, 0.0, 0.0, is_whole=False)
    assert not wide.is_it(beside(4.5), 0.0, 0.0, 0.0, is_whole=True)


@pytest.mark.parametrize("turn_deg", [-60.0, -30.0, 30.0, 60.0])
def test_a_span_begins_where_the_last_one_ends(turn_deg: float) -> None:
    bend_ahead = WorldLine(math.radians(turn_deg), 3.0, 0.0)
    assert known().is_it(bend_ahead, 0.0, 0.0, 0.0, is_whole=True)
    far_away = WorldLine(math.radians(turn_deg), 30.0, 0.0)
    assert not known().is_it(far_away, 0.0, 0.0, 0.0, is_whole=True)


def test_a_line_across_is_another_one() -> None:
    assert not known().is_it(beside(0.0, 80.0), 0.0, 0.0, 0.0, is_whole=True)


def test_it_may_be_forgotten() -> None:
    line = known(2.0)
    line.forget()
    assert line.line is None
    assert line.half_width_m == 0.0
    assert line.is_it(beside(9.0), 0.0, 0.0, 0.0, is_whole=True)


def test_a_whole_sight_tells_how_wide_the_line_is() -> None:
    line = known()
    line.measure(LineEstimate(0.0, 0.0, 3, 51.0, 1.0, 0), 6.0 / 381.0)
    assert line.half_width_m == pytest.approx(0.8, abs=0.01)
