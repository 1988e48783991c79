"""Single gusts have the 1-cosine shape, come at the seed's times, and stay within what they promise."""

import itertools
import math

import pytest

from sitl.gust_front import GustFronts, one_minus_cosine
from sitl.wind import Wind

DT_S = 0.02


def test_the_shape_is_the_specifications() -> None:
    assert [one_minus_cosine(x_m, 40.0) for x_m in (-5.0, 0.0, 20.0, 40.0, 90.0)] == pytest.approx([0, 0, 0.5, 1, 1])
    assert one_minus_cosine(10.0, 40.0) == pytest.approx((1 - math.cos(math.pi / 4)) / 2)


def strengths(seed: int, flight_s: float, airspeed_m_s: float = 8.0) -> list[float]:
    fronts = GustFronts(seed)
    return [math.hypot(*fronts.step(DT_S, airspeed_m_s * DT_S)) for _ in range(round(flight_s / DT_S))]


def test_they_come_once_or_twice_a_minute_and_leave_quiet_between() -> None:
    minutes = 120
    flown = strengths(3, 60.0 * minutes)
    n_fronts = sum(before == 0.0 < after for before, after in itertools.pairwise(flown))
    assert 1.0 < n_fronts / minutes < 2.0
    assert 0.3 < sum(strength == 0.0 for strength in flown) / len(flown) < 0.9


def test_none_is_stronger_than_half_the_mean_wind_nor_rises_at_once() -> None:
    flown = strengths(4, 3600.0)
    assert 0.4 < max(flown) <= 0.5
    # The steepest rise: half of 0.5 times pi over 25 m, at 0.16 m a step.
    steepest = max(abs(after - before) for before, after in itertools.pairwise(flown))
    assert 0.0 < steepest < 0.25 * math.pi / 25.0 * 0.16 * 1.05


def test_they_blow_within_fifteen_degrees_of_the_mean_wind() -> None:
    fronts = GustFronts(6)
    gusts = [fronts.step(DT_S, 0.16) for _ in range(100_000)]
    veers_rad = [math.atan2(across, along) for along, across in gusts if math.hypot(along, across) > 1e-6]
    assert max(map(abs, veers_rad)) <= math.radians(15.0)
    assert min(veers_rad) < -math.radians(5.0) < math.radians(5.0) < max(veers_rad)


def test_the_seed_decides() -> None:
    assert strengths(1, 200.0) == strengths(1, 200.0) != strengths(2, 200.0)


def test_fronts_come_on_top_of_the_same_turbulence() -> None:
    plain = Wind(8.0, seed=2, from_rad=math.pi)
    gusty = Wind(8.0, seed=2, from_rad=math.pi, fronts=GustFronts(2))
    fronts = GustFronts(2)
    height_m, airspeed_m_s = 10.0, 9.5
    mean_m_s = plain.mean_m_s(height_m)
    for _ in range(10_000):
        (n, e, d), (gusty_n, gusty_e, gusty_d) = (w.step(DT_S, height_m, airspeed_m_s) for w in (plain, gusty))
        along, across = fronts.step(DT_S, airspeed_m_s * DT_S)
        assert (gusty_n - n, gusty_e - e, gusty_d - d) == pytest.approx((along * mean_m_s, across * mean_m_s, 0.0))


def test_without_wind_there_are_none() -> None:
    wind = Wind(0.0, seed=1, fronts=GustFronts(1))
    assert {wind.step(DT_S, 10.0, 5.0) for _ in range(5_000)} == {(0.0, 0.0, 0.0)}
