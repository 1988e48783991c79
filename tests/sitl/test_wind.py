"""Gusts have the specification's size and correlation, and the same seed brings the same wind."""

import math
import statistics

import pytest

from sitl.wind import COVER_ROUGHNESS_M, Wind, gust_scales

DT_S = 0.02


def gusts(wind: Wind, height_m: float, airspeed_m_s: float, n_steps: int) -> tuple[list[float], ...]:
    """Gusts along, across and down the mean wind, which blows from the south here."""
    mean = wind.mean_m_s(height_m)
    steps = [wind.step(DT_S, height_m, airspeed_m_s) for _ in range(n_steps)]
    return [n - mean for n, _, _ in steps], [e for _, e, _ in steps], [d for _, _, d in steps]


def test_scales_are_those_of_the_specification() -> None:
    # MIL-F-8785C 3.7.3.4 at 100 ft with W20 = 30 kn: 0.177 + 0.000823 * 100 = 0.2593.
    w20_m_s = 30 * 0.514444
    scales = gust_scales(30.48, w20_m_s)
    assert scales.sigma_w_m_s == pytest.approx(0.1 * w20_m_s)
    assert scales.sigma_u_m_s == pytest.approx(0.1 * w20_m_s / 0.2593**0.4)
    assert scales.sigma_v_m_s == scales.sigma_u_m_s
    assert scales.length_w_m == pytest.approx(30.48)
    assert scales.length_u_m == pytest.approx(30.48 / 0.2593**1.2)


def test_scales_hold_their_value_below_ten_feet() -> None:
    assert gust_scales(0.0, 5.0) == gust_scales(10 * 0.3048, 5.0)


@pytest.mark.parametrize("height_m", [6.0, 20.0])
def test_long_runs_have_the_specified_deviations(height_m: float) -> None:
    wind, airspeed_m_s = Wind(8.0, seed=4, from_rad=math.pi), 30.0
    u, v, w = gusts(wind, height_m, airspeed_m_s, 200_000)
    scales = gust_scales(height_m, 8.0)
    assert statistics.pstdev(u) == pytest.approx(scales.sigma_u_m_s, rel=0.08)
    assert statistics.pstdev(v) == pytest.approx(scales.sigma_v_m_s, rel=0.08)
    assert statistics.pstdev(w) == pytest.approx(scales.sigma_w_m_s, rel=0.08)


def test_gusts_along_the_wind_decay_with_the_length_scale() -> None:
    wind, airspeed_m_s, height_m = Wind(8.0, seed=9, from_rad=math.pi), 30.0, 10.0
    u, _, _ = gusts(wind, height_m, airspeed_m_s, 200_000)
    lag = round(gust_scales(height_m, 8.0).length_u_m / airspeed_m_s / DT_S)
    mean = statistics.fmean(u)
    products = [(a - mean) * (b - mean) for a, b in zip(u, u[lag:], strict=False)]
    correlation = statistics.fmean(products) / statistics.pvariance(u)
    assert correlation == pytest.approx(math.exp(-1), abs=0.06)


def test_a_wind_from_the_west_blows_east() -> None:
    wind = Wind(6.0, seed=1, from_rad=-math.pi / 2)
    steps = [wind.step(DT_S, 6.096, 5.0) for _ in range(50_000)]
    assert statistics.fmean(e for _, e, _ in steps) == pytest.approx(6.0, abs=0.4)
    assert statistics.fmean(n for n, _, _ in steps) == pytest.approx(0.0, abs=0.4)


def test_the_mean_wind_grows_with_height_and_is_the_given_one_at_twenty_feet() -> None:
    wind = Wind(5.0, seed=1)
    assert wind.mean_m_s(20 * 0.3048) == pytest.approx(5.0)
    assert wind.mean_m_s(2.0) < wind.mean_m_s(10.0) < wind.mean_m_s(50.0)


@pytest.mark.parametrize("cover", list(COVER_ROUGHNESS_M))
def test_the_profile_is_the_grounds(cover: str) -> None:
    # u(z) / u(20 ft) = ln(z / z0) / ln(20 ft / z0), MIL-F-8785C; a rougher ground has more shear.
    roughness_m = COVER_ROUGHNESS_M[cover]
    wind = Wind(6.0, seed=1, roughness_m=roughness_m)
    for height_m in (3.0, 10.0, 40.0):
        wanted_m_s = 6.0 * math.log(height_m / roughness_m) / math.log(20 * 0.3048 / roughness_m)
        assert wind.mean_m_s(height_m) == pytest.approx(wanted_m_s)
    assert 0.0 < wind.mean_m_s(0.0) < wind.mean_m_s(3.0)


def test_rougher_ground_has_more_shear() -> None:
    rough_first = sorted(COVER_ROUGHNESS_M.values(), reverse=True)
    shears = [wind.mean_m_s(40.0) / wind.mean_m_s(3.0) for wind in (Wind(6.0, 1, roughness_m=z) for z in rough_first)]
    assert shears == sorted(shears, reverse=True)
    assert shears[0] > 2 * shears[-1]


def test_the_seed_decides() -> None:
    one, same, other = (Wind(5.0, seed=seed) for seed in (7, 7, 8))
    flown = [[wind.step(DT_S, 10.0, 5.0) for _ in range(100)] for wind in (one, same, other)]
    assert flown[0] == flown[1] != flown[2]


def test_still_air_does_not_move() -> None:
    assert Wind(0.0, seed=1).step(DT_S, 10.0, 5.0) == (0.0, 0.0, 0.0)


def test_a_negative_speed_is_refused() -> None:
    with pytest.raises(ValueError, match="direction apart"):
        Wind(-1.0, seed=1)
