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
        coarse = cv2.resize(
            grey[: height * _COARSENESS, : width * _COARSENESS], (width, height), interpolation=cv2.INTER_AREA
        )
        padded = np.pad(np.asarray(coarse, dtype=np.uint8), _REACH_PX, mode="edge")  # so that no way across leaves it
        step_x, step_y, ridges = _respond(padded, sigma_px)
        steps_2 = np.square(step_x, dtype=np.int32) + np.square(step_y, dtype=np.int32)
        drop_steps(codes, steps_2, ridges, ways_across(_REACH_PX), _COARSENESS, min_ridge)
    return codes


def _respond(grey: NDArray[np.uint8], sigma_px: float) -> NDArray[np.int16]:
    """Step and ridge of an image (h, w) as vision.steerable.dominant gives them, (3, h, w)."""
    out = np.empty((3, *grey.shape), dtype=np.int16)
    dominant(filter_basis(grey, sigma_px), np.float32(GRADIENT_GAIN), out)
    return out


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def drop_steps(
    codes: NDArray[np.uint8],
    steps_2: NDArray[np.int32],
    ridges: NDArray[np.int16],
    across: NDArray[np.int64],
    coarseness: int,
    min_ridge: float,
) -> None:
    """Set those `codes` (h, w) to 0 that no ridge lies beside.

    `steps_2`, the squared steps, and `ridges` are what the shrunk image answers, with as many more pixels all around as
    `across`, what `ways_across` gives, reaches: (h // coarseness + 2 reach, w // coarseness + 2 reach). A ridge on the
    brighter side has to be bright, one on the darker side dark.
    """
    n_ways = across.shape[1]
    reach_px = n_ways // 2
    padded_width = ridges.shape[1]
    last_x, last_y = padded_width - 2 * reach_px - 1, ridges.shape[0] - 2 * reach_px - 1
    flat_2, flat_ridges = steps_2.ravel(), ridges.ravel()  # views: both are contiguous
    offsets = across[:, :, 1] * padded_width + across[:, :, 0]
    for y in range(codes.shape[0]):
        row = (min(y // coarseness, last_y) + reach_px) * padded_width + reach_px
        for x in range(codes.shape[1]):
            code = codes[y, x]
            if code == 0:
                continue
            pixel = row + min(x // coarseness, last_x)
            step_2, ridge = np.int32(0), np.int16(0)
            for i in range(n_ways):
                at = pixel + offsets[code - 1, i]
                step_2 = max(step_2, flat_2[at])
                if i >= reach_px:
                    ridge = max(ridge, flat_ridges[at])
                if i <= reach_px:
                    ridge = max(ridge, -flat_ridges[at])
            if float(ridge) * float(ridge) < min_ridge * min_ridge * float(step_2):
                codes[y, x] = 0


def ways_across(reach_px: int) -> NDArray[np.int64]:
    """The pixels across an edge of each direction, from the darker to the brighter side: (64, 2 reach + 1, 2) x, y."""
    turns_rad = 2.0 * math.pi * np.arange(N_DIRECTIONS) / N_DIRECTIONS
    towards_bright = np.stack([np.cos(turns_rad), np.sin(turns_rad)], axis=1)
    steps = np.arange(-reach_px, reach_px + 1)
    across: NDArray[np.int64] = np.floor(towards_bright[:, None, :] * steps[:, None] + 0.5).astype(np.int64)
    return across
