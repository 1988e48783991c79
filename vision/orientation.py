"""Histogram of oriented segments (HOS): the image's main angle ([Ceron] 6.1)."""

import math

import numpy as np
from numpy.typing import NDArray

from vision.records import Segments, wrap_line_angle_rad

N_BINS = 180
_SMOOTHING = np.array([1.0, 3.0, 5.0, 6.0, 5.0, 3.0, 1.0]) / 24.0  # about the spread of one line's pieces, 1.6 degrees
_PEAK_HALF_WIDTH_RAD = math.radians(4.0)


def segment_angles_rad(segments: Segments) -> NDArray[np.float64]:
    """Angles of (n, 4) segments, (n,) float64 [rad] in (-pi/2, pi/2]: from image up, clockwise positive."""
    dx, dy = segments[:, 2] - segments[:, 0], segments[:, 3] - segments[:, 1]
    angles_rad = np.arctan2(dx, -dy)
    angles_rad = np.where(angles_rad <= -math.pi / 2, angles_rad + math.pi, angles_rad)
    return np.where(angles_rad > math.pi / 2, angles_rad - math.pi, angles_rad)


def line_angle_distance_rad(angles_rad: NDArray[np.float64], angle_rad: float) -> NDArray[np.float64]:
    """Distance of line angles, whose period is pi, from `angle_rad`: (n,) float64 [rad] in [0, pi/2]."""
    turn_rad = np.abs(angles_rad - angle_rad) % math.pi
    return np.minimum(turn_rad, math.pi - turn_rad)


def oriented_histogram(angles_rad: NDArray[np.float64], weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """HOS, (180,) float64 [unit of `weights`]: bin i holds the angles within half a degree of i - 90 degrees.

    `angles_rad` (n,) [rad] are line angles, `weights` (n,) usually their segments' lengths [px]. The period is closed:
    -90 and +90 degrees are one bin. Smoothed over the period, so that a line that falls between two bins counts once.
    """
    bins = np.floor(np.degrees(angles_rad) + 90.5).astype(np.int64) % N_BINS
    histogram = np.bincount(bins, weights=weights, minlength=N_BINS)
    reach = len(_SMOOTHING) // 2
    return np.convolve(np.concatenate((histogram[-reach:], histogram, histogram[:reach])), _SMOOTHING, mode="valid")


def mean_line_angle_rad(angles_rad: NDArray[np.float64], weights: NDArray[np.float64]) -> float:
    """Weighted mean of line angles [rad], over the period pi: in (-pi/2, pi/2]."""
    mean_rad = 0.5 * math.atan2(
        float(np.sum(weights * np.sin(2.0 * angles_rad))), float(np.sum(weights * np.cos(2.0 * angles_rad)))
    )
    return wrap_line_angle_rad(mean_rad)


def main_angle_rad(angles_rad: NDArray[np.float64], weights: NDArray[np.float64]) -> float | None:
    """The main angle of [Ceron] (6.2), refined below the bins' degree: the mean of the angles around the peak.

    Returns it in (-pi/2, pi/2], None where there is no segment with any weight.
    """
    if weights.size == 0 or not float(np.sum(weights)) > 0.0:
        return None
    peak_rad = math.radians(int(np.argmax(oriented_histogram(angles_rad, weights))) - 90)
    is_near = line_angle_distance_rad(angles_rad, peak_rad) <= _PEAK_HALF_WIDTH_RAD
    return mean_line_angle_rad(angles_rad[is_near], weights[is_near])
