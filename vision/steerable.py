"""Steerable filters: at each pixel the ridge and the step along whichever orientation shows most ([Ceron] 3.2.2).

G2, the second derivative of a Gaussian, answers a ridge; H2, its approximate Hilbert transform, answers a step. Steered
to any angle both are sums of seven separable filters (Freeman and Adelson, The design and use of steerable filters,
IEEE PAMI 13, 1991, tables III to VI), so each filter runs once and every angle follows by arithmetic.

An angle here is that of the direction across a line, from image right (x) towards image down (y), and filters are
correlated with the image: so all signs are positive, where the paper's y points up.
"""

import math

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

N_EVEN, N_ODD = 3, 4
"""How many basis filters G2 and H2 have; they stand in this order."""

_REACH = 2.6  # the filters end where their Gaussian exp(-u^2) is 0.001


def basis_taps(sigma_px: float) -> NDArray[np.float64]:
    """The taps of the seven separable filters for a Gaussian of standard deviation `sigma_px`.

    Returns (7, 2, n) float64, n odd: along x and along y of G2a, G2b, G2c, H2a, H2b, H2c, H2d. Scaled so that H2,
    steered along a ramp of 1 grey level per pixel, answers -1; G2 and H2 keep the paper's ratio. The paper's nine taps
    are those of sigma 1.055. Raises ValueError for a `sigma_px` below 0.7, where the pixels are too coarse for them.
    """
    if not sigma_px >= 0.7:
        raise ValueError(f"sigma_px is {sigma_px}, but the filters need pixels finer than that: choose 0.7 or more.")
    unit_px = math.sqrt(2.0) * sigma_px
    reach_px = math.ceil(_REACH * unit_px)
    u = np.arange(-reach_px, reach_px + 1) / unit_px
    gauss = np.exp(-u * u)
    first, second = u * gauss, (2.0 * u * u - 1.0) * gauss
    second -= gauss * second.sum() / gauss.sum()  # cut off and sampled, it would answer an even ground
    third, mixed = (u**3 - 2.254 * u) * gauss, (u * u - 0.7515) * gauss
    ramp = -0.9780 * (third * u).sum() * unit_px * gauss.sum()
    even, mean, odd = 0.9213 / ramp, 1.843 / ramp, 0.9780 / ramp
    return np.array(
        [
            (even * second, gauss),
            (mean * first, first),
            (even * gauss, second),
            (odd * third, gauss),
            (odd * mixed, first),
            (odd * first, mixed),
            (odd * gauss, third),
        ]
    )


def filter_basis(grey: NDArray[np.uint8], sigma_px: float) -> NDArray[np.float32]:
    """What the seven filters of `basis_taps` answer to `grey`, (h, w) uint8: (7, h, w) float32 [grey levels per px]."""
    basis = np.empty((N_EVEN + N_ODD, *grey.shape), dtype=np.float32)
    for answer, (along_x, along_y) in zip(basis, basis_taps(sigma_px).astype(np.float32), strict=True):
        cv2.sepFilter2D(grey, cv2.CV_32F, along_x, along_y, dst=answer, borderType=cv2.BORDER_REPLICATE)
    return basis


def steer(
    basis: NDArray[np.float32], angle_rad: float | NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """G2 and H2 at one angle, or at one for each pixel: two (h, w) float64 from `basis`, (7, h, w) float32."""
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    g2a, g2b, g2c, h2a, h2b, h2c, h2d = basis.astype(np.float64)
    even = c * c * g2a + 2.0 * c * s * g2b + s * s * g2c
    odd = c**3 * h2a + 3.0 * c * c * s * h2b + 3.0 * c * s * s * h2c + s**3 * h2d
    return even, odd


def oriented_energy(basis: NDArray[np.float32], angle_rad: float | NDArray[np.float64]) -> NDArray[np.float64]:
    """E = G2^2 + H2^2, (h, w) float64: how much line or edge runs across the angle, whether ridge or step."""
    even, odd = steer(basis, angle_rad)
    return even * even + odd * odd


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")  # type: ignore[untyped-decorator]
def dominant(basis: NDArray[np.float32], gain: np.float32, out: NDArray[np.int16]) -> None:
    """Write each pixel's step and ridge, at the angle where the energy is greatest, into `out`, (3, h, w) int16.

    `basis` is (7, h, w) float32. `out` is x and y of the step, -H2 towards the brighter side, and the ridge, -G2,
    positive for a bright one; all times `gain`. The angle is that of the energy's second harmonic (the paper's
    C2 and C3): no search, and on a clear line the energy there is within a tenth of the greatest.
    """
    height, width = basis.shape[1:]
    half, tiny = np.float32(0.5), np.float32(1e-12)
    c2_h, c2_m, c2_x = np.float32(0.46875), np.float32(0.28125), np.float32(0.1875)
    c3_h, c3_m = np.float32(0.9375), np.float32(1.6875)
    two, three, one = np.float32(2.0), np.float32(3.0), np.float32(1.0)
    for y in range(height):
        for x in range(width):
            g2a, g2b, g2c = basis[0, y, x], basis[1, y, x], basis[2, y, x]
            h2a, h2b, h2c, h2d = basis[3, y, x], basis[4, y, x], basis[5, y, x], basis[6, y, x]
            c2 = (
                half * (g2a * g2a - g2c * g2c)
                + c2_h * (h2a * h2a - h2d * h2d)
                + c2_m * (h2b * h2b - h2c * h2c)
                + c2_x * (h2a * h2c - h2b * h2d)
            )
            c3 = g2b * (g2a + g2c) + c3_h * (h2c * h2d + h2a * h2b) + c3_m * h2b * h2c + c2_x * h2a * h2d
            # Half the angle of (c2, c3) without a trigonometric function.
            cos_2 = c2 / (np.sqrt(c2 * c2 + c3 * c3) + tiny)
            c = np.sqrt(max(np.float32(0.0), half * (one + cos_2)))
            s = np.sqrt(max(np.float32(0.0), half * (one - cos_2)))
            s = -s if c3 < np.float32(0.0) else s
            even = c * c * g2a + two * c * s * g2b + s * s * g2c
            odd = c * c * (c * h2a + three * s * h2b) + s * s * (three * c * h2c + s * h2d)
            out[0, y, x] = np.int16(np.rint(-gain * odd * c))
            out[1, y, x] = np.int16(np.rint(-gain * odd * s))
            out[2, y, x] = np.int16(np.rint(-gain * even))
