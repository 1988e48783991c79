"""Which span is followed, and at which height."""

import math
from dataclasses import replace

import pytest

from mission.autopilot import Setpoint
from mission.build import guidance_settings
from mission.guidance import WorldLine
from mission.plan import GuidancePlan
from mission.tasks.height_hold import HeightHold
from mission.tasks.span_choice import SpanChoice
from mission.tasks.task import Observation, Sight
from tests.mission.test_tasks import UP, sight, state_at

HERE = WorldLine(0.0, 0.0, 0.0)


def on_its_way() -> SpanChoice:
    spans = SpanChoice()
    spans.see(UP, sight(HERE), 0.0, 0.0)
    return spans


def bent(turn_deg: float, at_m: float, north_m: float) -> Sight:
    """A sight from `north_m` on the line of a bend `at_m` along it."""
    beyond = WorldLine(math.radians(turn_deg), at_m, 0.0)
    return sight(HERE, at=replace(UP, north_m=north_m), next_line=beyond)


@pytest.mark.parametrize("turn_deg", [-60.0, -30.0, -10.0, 10.0, 30.0, 60.0])
def test_a_bend_is_turned_at_when_two_sights_agree(turn_deg: float) -> None:
    spans = on_its_way()
    ahead = replace(UP, north_m=2.5)
    for n in range(1, 5):
        assert spans.see(ahead, bent(turn_deg, 2.0, 1.0), 10.0, 0.0)
        assert spans.target_rad == pytest.approx(math.radians(turn_deg if n >= 2 else 0.0))


def test_one_false_bend_turns_nobody() -> None:
    spans = on_its_way()
    for n in range(60):
        seen = bent(40.0, 2.0, 1.0) if n % 4 == 0 else bent(-30.0, 1.5, 1.0) if n % 4 == 2 else sight(HERE)
        spans.see(replace(UP, north_m=2.5), seen, 10.0, 0.0)
        assert spans.target_rad == 0.0


def test_a_bend_behind_is_not_turned_back_at() -> None:
    spans = on_its_way()
    for _ in range(20):
        spans.see(replace(UP, north_m=6.0), bent(30.0, 0.0, 3.0), 10.0, 0.0)
    assert spans.target_rad == 0.0


def test_the_span_before_a_bend_does_not_count_until_there_was_none() -> None:
    spans = on_its_way()
    ahead = replace(UP, north_m=2.5)
    for _ in range(3):
        spans.see(ahead, bent(30.0, 2.0, 1.0), 10.0, 0.0)
    assert spans.is_turning(10.5)
    assert not spans.see(ahead, sight(HERE), 10.5, 0.4)
    assert spans.target_rad == pytest.approx(math.radians(30.0))
    assert spans.see(ahead, sight(HERE), 10.5, 1.6)
    assert spans.target_rad == 0.0
    assert not spans.is_turning(10.5)


def test_a_span_that_alone_is_in_view_is_turned_to_when_two_sights_agree_and_the_one_before_it_is_left() -> None:
    """The bend passed below unseen: so a sight of both is no bend back."""
    spans = on_its_way()
    ahead, beyond = replace(UP, north_m=2.5), WorldLine(math.radians(30.0), 1.0, 0.0)
    assert not spans.see(ahead, sight(beyond, at=ahead), 10.0, 0.0)
    assert spans.target_rad == 0.0
    assert spans.see(ahead, sight(beyond, at=ahead), 10.0, 0.0)
    for _ in range(6):
        assert spans.target_rad == pytest.approx(math.radians(30.0))
        assert spans.see(ahead, sight(beyond, at=ahead, next_line=HERE), 10.2, 0.0)


def hold(n_ticks: int, heights_m: dict[int, float], hold_of: HeightHold, start: Setpoint = UP) -> Setpoint:
    """A vehicle at its setpoint that sees the line so far below at those ticks."""
    setpoint = start
    for tick in range(n_ticks):
        seen = sight(HERE, at=setpoint, height_m=heights_m.get(tick))
        setpoint = hold_of.step(setpoint, Observation(0.05, state_at(setpoint), seen))
    return setpoint


def test_heights_that_are_not_seen_any_more_move_nobody() -> None:
    guidance = guidance_settings(GuidancePlan(conductor_spacing_m=0.8, height_over_line_m=6.0))
    too_low = dict.fromkeys(range(16), 5.0)
    end = hold(2000, too_low, HeightHold(guidance))
    assert -end.down_m == pytest.approx(17.0, abs=0.05)
