"""Steerable filters: what the paper promises of G2 and H2, and what a ridge and a step answer."""

import math

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from tests.vision.nadir_frames import draw_line, expose, ground
from vision.steerable import N_EVEN, basis_taps, dominant, filter_basis, oriented_energy, steer

SIGMA_PX = 1.8
PAPER_SIGMA_PX = 1 / (0.67 * math.sqrt(2))  # its taps are 0.67 apart


def kernels(sigma_px: float) -> NDArray[np.float64]:
    """The seven filters in two dimensions, rows along y."""
    return np.array([np.outer(along_y, along_x) for along_x, along_y in basis_taps(sigma_px)])


def bar(angle_rad: float, width_px: float, aside_px: float = 0.0, level: float = 200.0) -> NDArray[np.uint8]:
    """A smooth bar through the middle of 81 x 81 pixels; `angle_rad` is the direction across it."""
    levels = draw_line(np.full((81, 81), 100.0), angle_rad, aside_px, width_px, level)
    return np.clip(np.rint(levels), 0, 255).astype(np.uint8)


def steps_and_ridges(grey: NDArray[np.uint8], gain: float = 8.0) -> NDArray[np.int16]:
    out = np.empty((3, *grey.shape), dtype=np.int16)
    dominant(filter_basis(grey, SIGMA_PX), np.float32(gain), out)
    return out


def test_the_paper_s_coefficients_are_normal() -> None:
    # Tables III and V: over the plane the squares of G2 and of H2 sum up to 1, as well as the fitted H2 does.
    step = 0.02
    y, x = np.mgrid[-5:5:step, -5:5:step]
    gauss = np.exp(-x * x - y * y)
    assert np.sum((0.9213 * (2 * x * x - 1) * gauss) ** 2) * step**2 == pytest.approx(1.0, abs=2e-3)
    assert np.sum((0.9780 * (x**3 - 2.254 * x) * gauss) ** 2) * step**2 == pytest.approx(1.0, abs=1e-2)


@pytest.mark.parametrize("sigma_px", [0.7, PAPER_SIGMA_PX, 1.8, 3.0])
def test_no_filter_answers_an_even_ground(sigma_px: float) -> None:
    basis = kernels(sigma_px)
    sums = np.abs(basis.sum(axis=(1, 2))) / np.abs(basis).sum(axis=(1, 2))
    assert sums.max() < 1e-12


def test_the_taps_are_the_paper_s() -> None:
    # Table IV and VI at their nine positions, up to our scale and the mean that we take away.
    u = 0.67 * np.arange(-4, 5)
    taps = basis_taps(PAPER_SIGMA_PX)
    gauss = np.exp(-u * u)
    wanted = [
        np.outer(gauss, 0.9213 * (2 * u * u - 1) * gauss),
        np.outer(u * gauss, 1.843 * u * gauss),
        np.outer(0.9213 * (2 * u * u - 1) * gauss, gauss),
        np.outer(gauss, 0.9780 * (u**3 - 2.254 * u) * gauss),
        np.outer(u * gauss, 0.9780 * (u * u - 0.7515) * gauss),
        np.outer(0.9780 * (u * u - 0.7515) * gauss, u * gauss),
        np.outer(0.9780 * (u**3 - 2.254 * u) * gauss, gauss),
    ]
    assert taps.shape == (7, 2, 9)
    found = kernels(PAPER_SIGMA_PX)
    scale = np.sum(found[3] * wanted[3]) / np.sum(wanted[3] ** 2)
    np.testing.assert_allclose(found / scale, wanted, atol=4e-3)


def test_g2_and_h2_are_in_quadrature() -> None:
    # A wave along x: G2 answers its cosine, H2 its sine, and within the pass band both as strongly.
    even, _, _, odd, *_ = kernels(4.0)
    along = np.arange(even.shape[1]) - even.shape[1] // 2
    for frequency in (1.2, 1.5, 1.8):  # of the Gaussian's unit, sqrt(2) sigma
        phase = frequency * 2**0.5 * along / 4.0 / 2**0.5
        of_cosine = [np.sum(kernel * np.cos(phase)) for kernel in (even, odd)]
        of_sine = [np.sum(kernel * np.sin(phase)) for kernel in (even, odd)]
        assert abs(of_cosine[1]) < 1e-9 * abs(of_cosine[0])
        assert abs(of_sine[0]) < 1e-9 * abs(of_sine[1])
        assert abs(of_sine[1] / of_cosine[0]) == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("period_px", [8.0, 11.0])
def test_the_energy_of_a_wave_does_not_know_its_phase(period_px: float) -> None:
    phases = 2 * math.pi * np.arange(96) / period_px
    wave = np.tile(np.rint(128 + 100 * np.cos(phases)), (48, 1)).astype(np.uint8)
    energy = oriented_energy(filter_basis(wave, SIGMA_PX), 0.0)[24, 16:80]
    even, _ = steer(filter_basis(wave, SIGMA_PX), 0.0)
    assert energy.std() < 0.06 * energy.mean()
    assert (even[24, 16:80] ** 2).std() > 0.3 * energy.mean()  # G2 alone does


@settings(max_examples=30)
@given(angle_rad=st.floats(-math.pi, math.pi), sigma_px=st.floats(0.8, 3.0))
def test_steering_is_filtering_with_the_turned_filter(angle_rad: float, sigma_px: float) -> None:
    image = np.random.default_rng(1).integers(0, 256, (40, 40), dtype=np.uint8)
    taps = basis_taps(sigma_px)
    reach_px = taps.shape[2] // 2
    unit_px = math.sqrt(2) * sigma_px
    y, x = np.mgrid[-reach_px : reach_px + 1, -reach_px : reach_px + 1] / unit_px
    u = x * math.cos(angle_rad) + y * math.sin(angle_rad)
    gauss = np.exp(-x * x - y * y)
    scale = taps[3, 0, -1] * taps[3, 1, reach_px] / (0.9780 * ((x**3 - 2.254 * x) * gauss)[reach_px, -1])
    found = steer(filter_basis(image, sigma_px), angle_rad)
    for answer, turned in zip(
        found, (0.9213 * (2 * u * u - 1) * gauss, 0.9780 * (u**3 - 2.254 * u) * gauss), strict=True
    ):
        wanted = cv2.filter2D(image, cv2.CV_64F, scale * turned, borderType=cv2.BORDER_REPLICATE)
        # The mean that is taken away from G2's taps makes the difference.
        assert np.max(np.abs(answer - wanted)) < 0.02 * np.abs(wanted).max() + 0.3


def test_a_ramp_answers_its_slope() -> None:
    ramp = np.tile(np.arange(0, 240, 4, dtype=np.uint8), (60, 1))
    step_x, step_y, ridge = steps_and_ridges(ramp)[:, 20:40, 20:40]
    np.testing.assert_allclose(step_x, 4 * 8, atol=1)
    np.testing.assert_array_equal(step_y, 0)
    np.testing.assert_array_equal(ridge, 0)


@settings(max_examples=40)
@given(angle_rad=st.floats(-math.pi / 2, math.pi / 2), width_px=st.floats(1.5, 4.0))
def test_a_bar_is_a_ridge_with_two_opposite_steps(angle_rad: float, width_px: float) -> None:
    across = np.array([math.cos(angle_rad), math.sin(angle_rad)])
    for level, sign in ((200.0, 1), (20.0, -1)):
        step_x, step_y, ridge = steps_and_ridges(bar(angle_rad, width_px, level=level)).astype(float)
        assert sign * ridge[40, 40] > 0.9 * np.max(np.abs(ridge))  # bright is positive, dark negative
        aside = across * (width_px / 2 + 0.8)
        for side in (-1, 1):
            x, y = np.rint(40 + side * aside).astype(int)
            towards_bright = step_x[y, x] * across[0] + step_y[y, x] * across[1]
            assert sign * side * towards_bright < -0.35 * abs(ridge[40, 40])


@settings(max_examples=40)
@given(angle_rad=st.floats(-math.pi / 2, math.pi / 2))
def test_a_step_has_its_greatest_h2_where_g2_is_zero(angle_rad: float) -> None:
    y, x = np.mgrid[:81, :81] - 40.0
    aside = x * math.cos(angle_rad) + y * math.sin(angle_rad)
    grey = np.rint(60 + 120 * np.clip(aside + 0.5, 0, 1)).astype(np.uint8)
    step_x, step_y, ridge = steps_and_ridges(grey).astype(float)
    strength = np.hypot(step_x, step_y)
    middle = np.s_[30:51, 30:51]
    assert strength[40, 40] == pytest.approx(strength[middle].max(), rel=0.03)
    assert abs(ridge[40, 40]) < 0.03 * strength[40, 40]
    assert np.abs(ridge[middle]).max() / strength[middle].max() == pytest.approx(0.645, abs=0.03)
    found_rad = math.atan2(step_y[40, 40], step_x[40, 40])
    assert math.degrees(abs(math.remainder(found_rad - angle_rad, 2 * math.pi))) < 1.5


def test_the_dominant_angle_has_the_greatest_energy_of_all() -> None:
    for seed, angle_rad in ((1, 0.3), (2, -1.1), (3, 1.5)):
        grey = expose(draw_line(ground(seed, 4.0), angle_rad, 0.0, 2.0, 220.0), seed)
        basis = filter_basis(grey, SIGMA_PX)[:, 220:260, 300:340]
        step_x, step_y, ridge = dominant_of(basis)
        energies = np.array([oriented_energy(basis, turn) for turn in np.arange(36) * math.pi / 36])
        found = (step_x**2 + step_y**2 + ridge**2) / 64
        is_clear = energies.max(axis=0) > 0.25 * energies.max()
        assert is_clear.sum() > 40
        assert np.all(found[is_clear] > 0.9 * energies.max(axis=0)[is_clear])


def dominant_of(basis: NDArray[np.float32]) -> NDArray[np.float64]:
    out = np.empty((3, *basis.shape[1:]), dtype=np.int16)
    dominant(np.ascontiguousarray(basis), np.float32(8), out)
    return out.astype(np.float64)


def test_the_dominant_angle_is_that_of_the_energy_s_second_harmonic() -> None:
    basis = np.random.default_rng(6).normal(0, 20, (7, 9, 11)).astype(np.float32)
    turns_rad = np.arange(64) * math.pi / 64
    energies = np.array([oriented_energy(basis, turn_rad) for turn_rad in turns_rad])
    harmonic = np.tensordot(np.exp(2j * turns_rad), energies, axes=1)
    angles_rad = np.angle(harmonic) / 2
    even, odd = steer(basis, angles_rad)
    found = dominant_of(basis)
    for answer, wanted in zip(found, (-odd * np.cos(angles_rad), -odd * np.sin(angles_rad), -even), strict=True):
        np.testing.assert_allclose(answer, 8 * wanted, atol=1)


def test_a_turned_image_has_a_turned_answer() -> None:
    grey = expose(draw_line(ground(7, 10.0, 120, 120), 0.4, 3.0, 2.0, 220.0), 8)
    step_x, step_y, ridge = steps_and_ridges(grey)
    turned_x, turned_y, turned_ridge = steps_and_ridges(np.ascontiguousarray(np.rot90(grey)))
    # Turned to the left, what pointed right points up. Of pixels that have no orientation none is asked.
    is_clear = np.maximum(np.hypot(step_x.astype(float), step_y), np.abs(ridge)) > 40
    assert is_clear.mean() > 0.02
    for found, wanted in ((turned_x, step_y), (turned_y, -step_x), (turned_ridge, ridge)):
        difference = np.abs(np.rot90(found, -1).astype(int) - wanted)[is_clear]
        assert np.mean(difference <= 2) > 0.99


def test_dominant_compiled_equals_plain_python() -> None:
    basis = np.random.default_rng(5).normal(0, 20, (7, 9, 11)).astype(np.float32)
    compiled, plain = np.empty((2, 3, 9, 11), dtype=np.int16)
    dominant(basis, np.float32(8), compiled)
    dominant.py_func(basis, np.float32(8), plain)
    np.testing.assert_allclose(compiled, plain, atol=1)
    assert np.abs(plain).max() > 100


def test_no_filter_is_made_for_coarse_pixels() -> None:
    with pytest.raises(ValueError, match=r"sigma_px is 0\.3"):
        basis_taps(0.3)
    assert len(basis_taps(0.7)) > N_EVEN
