"""Gusts have Dryden's spectra and the specification's deviations: long runs against the closed forms.

MIL-F-8785C gives the spectra over the spatial frequency; gusts that drift past at V have, one-sided over f [Hz],

    S_u = sigma^2 4 T / (1 + (w T)^2)                         T = L / V, w = 2 pi f
    S_v = S_w = sigma^2 2 T (1 + 3 (w T)^2) / (1 + (w T)^2)^2
"""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from sitl.wind import Wind, gust_scales

AIRSPEED_M_S = 15.0
N_PER_SEGMENT = 4096


def run(wind: Wind, dt_s: float, height_m: float, n_steps: int) -> NDArray[np.float64]:
    """Gusts (3, n) [m/s] along, across and down a wind from the south."""
    steps = [wind.step(dt_s, height_m, AIRSPEED_M_S) for _ in range(n_steps)]
    gusts: NDArray[np.float64] = np.array(steps).T
    gusts[0] -= wind.mean_m_s(height_m)
    return gusts


def welch(signal: NDArray[np.float64], dt_s: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Frequencies [Hz] and the one-sided spectral density, averaged over half overlapping Hann windows."""
    window = np.hanning(N_PER_SEGMENT)
    starts = range(0, len(signal) - N_PER_SEGMENT + 1, N_PER_SEGMENT // 2)
    density = np.mean(
        [np.abs(np.fft.rfft(window * signal[start : start + N_PER_SEGMENT])) ** 2 for start in starts], axis=0
    )
    return np.fft.rfftfreq(N_PER_SEGMENT, dt_s), 2 * dt_s * density / np.sum(window**2)


def dryden_u(f_hz: NDArray[np.float64], sigma_m_s: float, time_s: float) -> NDArray[np.float64]:
    return sigma_m_s**2 * 4 * time_s / (1 + (2 * math.pi * f_hz * time_s) ** 2)


def dryden_vw(f_hz: NDArray[np.float64], sigma_m_s: float, time_s: float) -> NDArray[np.float64]:
    square = (2 * math.pi * f_hz * time_s) ** 2
    return sigma_m_s**2 * 2 * time_s * (1 + 3 * square) / (1 + square) ** 2


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_spectra_are_drydens_within_fifteen_percent_in_every_octave(axis: int) -> None:
    dt_s, height_m, speed_m_s = 0.02, 30.0, 8.0
    gusts = run(Wind(speed_m_s, seed=12, from_rad=math.pi), dt_s, height_m, 400_000)
    scales = gust_scales(height_m, speed_m_s)
    sigma_m_s = (scales.sigma_u_m_s, scales.sigma_v_m_s, scales.sigma_w_m_s)[axis]
    time_s = (scales.length_u_m, scales.length_v_m, scales.length_w_m)[axis] / AIRSPEED_M_S
    f_hz, density = welch(gusts[axis], dt_s)
    wanted = (dryden_u if axis == 0 else dryden_vw)(f_hz, sigma_m_s, time_s)
    ratios = {}
    for low_hz in 0.05 * 2.0 ** np.arange(6):  # to 3.2 Hz: the samples' own frequency is 50 Hz
        band = (f_hz >= low_hz) & (f_hz < 2 * low_hz)
        ratios[float(low_hz)] = float(density[band].sum() / wanted[band].sum())
    assert ratios == pytest.approx(dict.fromkeys(ratios, 1.0), abs=0.15)


@pytest.mark.parametrize("speed_m_s", [4.0, 8.0, 12.0])
@pytest.mark.parametrize("height_m", [10.0, 30.0, 100.0])
def test_deviations_are_the_specifications(speed_m_s: float, height_m: float) -> None:
    # A step is a twentieth of the shortest time scale, and a run 4000 of the longest: 3 % of chance in a deviation.
    length_m = gust_scales(height_m, speed_m_s).length_u_m
    dt_s = 0.1 * length_m / AIRSPEED_M_S
    gusts = run(Wind(speed_m_s, seed=21, from_rad=math.pi), dt_s, height_m, 40_000)
    # MIL-F-8785C: sigma_w = 0.1 W20, sigma_u = sigma_v = sigma_w / (0.177 + 0.000823 h)^0.4, h in feet.
    sigma_w_m_s = 0.1 * speed_m_s
    sigma_u_m_s = sigma_w_m_s / (0.177 + 0.000823 * height_m / 0.3048) ** 0.4
    assert gusts.std(axis=1) == pytest.approx([sigma_u_m_s, sigma_u_m_s, sigma_w_m_s], rel=0.06)


def test_a_faster_flight_meets_the_same_gusts_at_higher_frequencies() -> None:
    # The filters' time is L / V: at twice the speed half the steps lie between the same gusts.
    slow, fast = (Wind(8.0, seed=5, from_rad=math.pi) for _ in range(2))
    slowly = [slow.step(0.02, 30.0, 12.0) for _ in range(200)]
    quickly = [fast.step(0.01, 30.0, 24.0) for _ in range(200)]
    assert np.allclose(slowly, quickly)
