"""The edge line finders behind one interface: projection, the circle based search, and OpenCV's detectors to compare.

The circle based search takes its edges from Canny or from steerable filters. All but the projection find segments
first, of any length, and link them; which side of a segment is brighter is then read from the image.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from vision.cbs import find_segments
from vision.checks import check_shares
from vision.circle import make_circle
from vision.edge_lines import EdgeLines, edge_lines, measure_steps
from vision.edges import find_edges
from vision.linking import link_segments, segment_lengths_px
from vision.records import Segments
from vision.ridge_edges import find_ridge_edges
from vision.steerable import basis_taps

Baseline = Literal["hough", "lsd", "edlines"]


class EdgeLineFinder(Protocol):
    """Finds straight edges in one image after the other; remembers nothing that it saw."""

    def find(self, grey: NDArray[np.uint8]) -> EdgeLines:
        """Find the edge lines of `grey`, (h, w) uint8 of any size."""
        ...


@dataclass(frozen=True, slots=True)
class EdgeSettings:
    """Adaptive Canny (vision.edges.find_edges). Raises ValueError for what cannot work."""

    blur_sigma_px: float = 1.0
    quantile: float = 0.96
    low_ratio: float = 0.4
    min_contrast: float = 2.0  # grey levels per pixel

    def __post_init__(self) -> None:
        check_shares(self, "quantile", "low_ratio")

    def find(self, grey: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """The edge codes of `grey`, both (h, w) uint8."""
        return find_edges(grey, self.blur_sigma_px, self.quantile, self.low_ratio, self.min_contrast)


@dataclass(frozen=True, slots=True)
class SteerableSettings:
    """Edges by steerable filters (vision.ridge_edges.find_ridge_edges). Raises ValueError for what cannot work."""

    sigma_px: float = 1.5
    quantile: float = 0.6
    low_ratio: float = 0.4
    min_contrast: float = 2.0  # grey levels per pixel
    min_ridge: float = 0.7  # of the step; 0 keeps all edges

    def __post_init__(self) -> None:
        check_shares(self, "quantile", "low_ratio")
        basis_taps(self.sigma_px)  # refuses what the filters cannot do

    def find(self, grey: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """The edge codes of `grey`, both (h, w) uint8."""
        return find_ridge_edges(grey, self.sigma_px, self.quantile, self.low_ratio, self.min_contrast, self.min_ridge)


@dataclass(frozen=True, slots=True)
class CbsSettings:
    """The circle based search (vision.cbs.find_segments). Raises ValueError for what cannot work."""

    radius_px: int = 11
    radius_step_px: int = 4  # the second pass' circle is smaller by this
    min_fill: float = 0.9
    min_walk_fill: float = 0.6
    skip_px: int = 11
    seed_grid_px: int = 6

    def __post_init__(self) -> None:
        if self.radius_step_px < 0 or self.radius_px - self.radius_step_px < 2:
            raise ValueError(
                f"radius_px {self.radius_px} less radius_step_px {self.radius_step_px} leaves no search circle: "
                "choose them so that both passes have a radius of 2 px or more."
            )
        if self.skip_px < 1 or self.seed_grid_px < 1:
            raise ValueError("skip_px and seed_grid_px are steps in pixels: choose 1 or more.")
        check_shares(self, "min_fill", "min_walk_fill")


@dataclass(frozen=True, slots=True)
class LinkSettings:
    """Linking (vision.linking.link_segments), and how long a linked line has to be."""

    max_turn_rad: float = math.radians(3.0)
    max_aside_px: float = 2.5
    max_gap_share: float = 0.25  # of the frame's diagonal
    min_length_share: float = 0.09  # of the frame's diagonal; shorter lines are branches and joints


class CbsFinder:
    """Edges by Canny or by steerable filters, the circle based search, linking ([Ceron] 3.2 and 3.3)."""

    def __init__(self, edges: EdgeSettings | SteerableSettings, search: CbsSettings, linking: LinkSettings) -> None:
        self._edges, self._search, self._linking = edges, search, linking
        radii_px = (search.radius_px, search.radius_px - search.radius_step_px)
        self._circles = tuple(make_circle(radius_px) for radius_px in radii_px)

    def find(self, grey: NDArray[np.uint8]) -> EdgeLines:
        """Find the edge lines of `grey`, (h, w) uint8 of any size."""
        search = self._search
        codes = self._edges.find(grey)
        segments = find_segments(
            codes, self._circles, search.min_fill, search.min_walk_fill, search.skip_px, search.seed_grid_px
        )
        return _linked(grey, segments, self._linking)


class BaselineFinder:
    """One of OpenCV's detectors, and linking: probabilistic Hough, LSD (von Gioi 2010), EDLines (Akinlar 2011)."""

    def __init__(self, kind: Baseline, edges: EdgeSettings, linking: LinkSettings) -> None:
        self._edges, self._linking = edges, linking
        finders: dict[Baseline, Callable[[NDArray[np.uint8]], NDArray[np.float64]]] = {
            "hough": self._hough,
            "lsd": self._lsd,
            "edlines": self._edlines,
        }
        self._segments = finders[kind]
        self._detector = cv2.createLineSegmentDetector() if kind == "lsd" else None
        self._drawing = cv2.ximgproc.createEdgeDrawing() if kind == "edlines" else None

    def find(self, grey: NDArray[np.uint8]) -> EdgeLines:
        """Find the edge lines of `grey`, (h, w) uint8 of any size."""
        if min(grey.shape) < 8:  # OpenCV's detectors do not all answer smaller ones
            return _linked(grey, np.empty((0, 4)), self._linking)
        segments = self._segments(grey)
        segments = segments[segment_lengths_px(segments) > 0]
        is_turned = measure_steps(grey, segments, 1.0) < 0
        segments[is_turned] = segments[is_turned][:, [2, 3, 0, 1]]
        return _linked(grey, segments, self._linking)

    def _hough(self, grey: NDArray[np.uint8]) -> NDArray[np.float64]:
        binary = np.where(self._edges.find(grey) > 0, 255, 0).astype(np.uint8)
        return _rows(cv2.HoughLinesP(binary, 1, math.radians(1.0), 50, minLineLength=30, maxLineGap=5))

    def _lsd(self, grey: NDArray[np.uint8]) -> NDArray[np.float64]:
        assert self._detector is not None  # noqa: S101  the kind says so
        return _rows(self._detector.detect(grey)[0])

    def _edlines(self, grey: NDArray[np.uint8]) -> NDArray[np.float64]:
        assert self._drawing is not None  # noqa: S101  the kind says so
        self._drawing.detectEdges(grey)
        return _rows(self._drawing.detectLines())


def _rows(found: object) -> NDArray[np.float64]:
    """OpenCV's (n, 1, 4) lines, or None, as (n, 4) float64."""
    return np.empty((0, 4)) if found is None else np.array(found, dtype=np.float64).reshape(-1, 4)


def _linked(grey: NDArray[np.uint8], segments: Segments, linking: LinkSettings) -> EdgeLines:
    """Link segments to edge lines."""
    diagonal_px = math.hypot(*grey.shape)
    lines, covered_px = link_segments(
        segments, linking.max_turn_rad, linking.max_aside_px, linking.max_gap_share * diagonal_px
    )
    is_long = segment_lengths_px(lines) >= linking.min_length_share * diagonal_px
    return edge_lines(grey, lines[is_long], covered_px[is_long])
