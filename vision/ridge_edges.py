"""Edges of ridges: both edges of whatever is thin, by steerable filters at two scales.

A conductor is a ridge, one thin line with two opposite edges; a kerb or a roof is a step. The fine filter says where
the edges lie, the coarse one, wider than any conductor that matters, whether a ridge lies beside them.
"""

import math

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from vision.edges import GRADIENT_GAIN, N_DIRECTIONS, link_edges
from vision.steerable import dominant, filter_basis

_COARSENESS = 2  # the image is shrunk by this for the coarse filter
_REACH_PX = 3  # of the shrunk image: how far across an edge its ridge is looked for


def find_ridge_edges(
    grey: NDArray[np.uint8],
    sigma_px: float,
    edge_quantile: float,
    low_ratio: float,
    min_contrast: float,
    min_ridge: float,
) -> NDArray[np.uint8]:
    """Edge pixels beside a ridge, coded with their direction ([Ceron] 3.2.2).

    Edges are where H2, with a Gaussian of `sigma_px`, is greatest across its own orientation: it has one maximum at
    each edge of a ridge. Thresholds are those of vision.edges.find_edges, with `min_contrast` [grey levels per px]. An
    edge stays where, at half the resolution, the ridge on its own side is `min_ridge` times the step: a step has 0.64
    of it, a thin line 1.2; with 0 all edges stay.

    `grey` is (h, w) uint8. Returns (h, w) uint8 codes as find_edges does.
    """
    step_x, step_y, _ = _respond(grey, sigma_px)
    codes = link_edges(step_x, step_y, edge_quantile, low_ratio, GRADIENT_GAIN * min_contrast)
    height, width = grey.shape[0] // _COARSENESS, grey.shape[1] // _COARSENESS
    if min_ridge > 0 and min(height, width) > 0:
        cropped = grey[: height * _COARSENESS, : width * _COARSENESS]
        coarse = np.asarray(cv2.resize(cropped, (width, height), interpolation=cv2.INTER_AREA), dtype=np.uint8)
        drop_steps(codes, _respond(coarse, sigma_px), _COARSENESS, _REACH_PX, min_ridge)
    return codes


def _respond(grey: NDArray[np.uint8], sigma_px: float) -> NDArray[np.int16]:
    """Step and ridge of an image (h, w) as vision.steerable.dominant gives them, (3, h, w)."""
    out = np.empty((3, *grey.shape), dtype=np.int16)
    dominant(filter_basis(grey, sigma_px), np.float32(GRADIENT_GAIN), out)
    return out


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def drop_steps(
    codes: NDArray[np.uint8], coarse: NDArray[np.int16], coarseness: int, reach_px: int, min_ridge: float
) -> None:
    """Set those `codes` (h, w) to 0 that no ridge lies beside.

    `coarse` is (3, h // coarseness, w // coarseness), what vision.steerable.dominant gives for the shrunk image. A
    ridge on the brighter side has to be bright, one on the darker side dark.
    """
    height, width = coarse.shape[1:]
    for y in range(codes.shape[0]):
        for x in range(codes.shape[1]):
            if codes[y, x] == 0:
                continue
            turn = 2.0 * math.pi * (codes[y, x] - 1) / N_DIRECTIONS
            across_x, across_y = math.cos(turn), math.sin(turn)
            middle_x, middle_y = x // coarseness, y // coarseness
            step, ridge = 0.0, 0.0
            for i in range(-reach_px, reach_px + 1):
                xx = min(max(math.floor(middle_x + i * across_x + 0.5), 0), width - 1)
                yy = min(max(math.floor(middle_y + i * across_y + 0.5), 0), height - 1)
                step = max(step, math.hypot(coarse[0, yy, xx], coarse[1, yy, xx]))
                if i >= 0:
                    ridge = max(ridge, float(coarse[2, yy, xx]))
                if i <= 0:
                    ridge = max(ridge, -float(coarse[2, yy, xx]))
            if ridge < min_ridge * step:
                codes[y, x] = 0
