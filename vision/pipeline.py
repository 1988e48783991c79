"""The line finder: from an image to the power lines it shows and the line group's angle and offset."""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from vision.cbs import find_segments
from vision.circle import make_circle
from vision.conductors import Conductor, find_conductors
from vision.edge_lines import EdgeLines, ProjectionFinder, edge_lines
from vision.edges import find_edges, to_grey
from vision.line_group import choose_group, middle_offset_px, n_abreast
from vision.linking import link_segments, segment_lengths_px
from vision.orientation import main_angle_rad, mean_line_angle_rad, segment_angles_rad
from vision.records import Detection, Segments


@dataclass(frozen=True, slots=True)
class VisionSettings:
    """What can be tuned in the line finder. What ends in `_share` is a share of the frame's diagonal.

    The defaults serve 640x480 nadir frames with conductors about 1 px wide as well as photographs from nearby. Raises
    ValueError for a value that cannot work.
    """

    detector: Literal["projection", "cbs"] = "projection"

    # Edges for the circle based search (vision.edges.find_edges).
    blur_sigma_px: float = 1.0
    edge_quantile: float = 0.96
    edge_low_ratio: float = 0.4
    edge_min_contrast: float = 2.0  # grey levels per pixel

    # Circle based search (vision.cbs.find_segments).
    radius_px: int = 11
    radius_step_px: int = 4  # the second pass' circle is smaller by this
    min_fill: float = 0.9
    min_walk_fill: float = 0.6
    skip_px: int = 11
    seed_grid_px: int = 6

    # Linking (vision.linking.link_segments).
    link_max_turn_rad: float = math.radians(3.0)
    link_max_aside_px: float = 2.5
    link_max_gap_share: float = 0.25
    min_length_share: float = 0.09  # shorter lines are branches and joints

    # Projection (vision.edge_lines.ProjectionFinder).
    projection_min_coherence: float = 0.3
    projection_min_length_share: float = 0.25
    projection_min_contrast: float = 2.5  # grey levels per pixel of the shrunk image

    # Conductors (vision.conductors.find_conductors).
    max_conductor_width_share: float = 0.03
    pair_max_turn_rad: float = math.radians(2.5)
    min_coherence: float = 0.6
    min_contrast: float = 8.0  # grey levels

    # The line group (vision.line_group.choose_group).
    main_angle_tolerance_rad: float = math.radians(15.0)
    min_relative_support: float = 0.7
    min_relative_contrast: float = 0.35

    # Presence: one conductor whose support is this share of the frame's chord along it, and this many times what
    # texture adds up to along so many pixels: in a small image a line has to be surer than in a large one.
    presence_min_support: float = 0.68
    presence_min_sigmas: float = 10.5

    def __post_init__(self) -> None:
        if self.radius_step_px < 0 or self.radius_px - self.radius_step_px < 2:
            raise ValueError(
                f"radius_px {self.radius_px} less radius_step_px {self.radius_step_px} leaves no search circle: "
                "choose them so that both passes have a radius of 2 px or more."
            )
        if self.skip_px < 1 or self.seed_grid_px < 1:
            raise ValueError("skip_px and seed_grid_px are steps in pixels: choose 1 or more.")
        for name in ("edge_quantile", "edge_low_ratio", "min_fill", "min_walk_fill", "presence_min_support"):
            value = getattr(self, name)
            if not 0.0 < value <= 1.0:
                raise ValueError(f"{name} is {value}, but it is a share: choose it above 0 and at most 1.")


class LineFinder:
    """Finds the power lines of one image after the other; remembers nothing that it saw."""

    def __init__(self, settings: VisionSettings) -> None:
        self._settings = settings
        radii_px = (settings.radius_px, settings.radius_px - settings.radius_step_px)
        self._circles = tuple(make_circle(radius_px) for radius_px in radii_px)
        self._projection = ProjectionFinder(
            settings.projection_min_coherence,
            settings.projection_min_length_share,
            settings.projection_min_contrast,
        )

    def warm_up(self) -> None:
        """Compile every kernel, or load it from its cache, so that no frame in flight waits for the compiler."""
        image = np.full((96, 96, 3), 60, dtype=np.uint8)
        image[:, 40:43] = 220
        self.find(image)

    def find(self, image: NDArray[np.uint8]) -> Detection:
        """Find the power lines in `image`, (h, w) grey or (h, w, 3) BGR uint8, of any size from 1x1 on.

        The same image gives the same answer. Raises ValueError only for what is no such image.
        """
        settings = self._settings
        grey = to_grey(image)
        shape = (grey.shape[0], grey.shape[1])
        diagonal_px = math.hypot(*shape)
        edges = self._projection.find(grey) if settings.detector == "projection" else self._search(grey, diagonal_px)
        conductors = find_conductors(
            edges,
            grey,
            settings.max_conductor_width_share * diagonal_px,
            settings.pair_max_turn_rad,
            settings.min_coherence,
        )
        conductors = [c for c in conductors if c.contrast >= settings.min_contrast]
        group, peak_rad = choose_group(
            conductors,
            settings.main_angle_tolerance_rad,
            settings.min_relative_support,
            settings.min_relative_contrast,
        )
        power_lines = np.array([edge for conductor in group for edge in conductor.edges]).reshape(-1, 4)
        power_lines.setflags(write=False)
        if peak_rad is None:
            # Without a conductor the longest edges say which way the image runs.
            weights = (edges.coherence * edges.covered_px) ** 2
            peak_rad = main_angle_rad(segment_angles_rad(edges.segments), weights)
            return Detection(edges.segments, power_lines, peak_rad, 0.0, 0, 0.0, False)
        return self._judge(edges.segments, power_lines, group, shape)

    def _search(self, grey: NDArray[np.uint8], diagonal_px: float) -> EdgeLines:
        """Find edge lines by the circle based search and linking."""
        settings = self._settings
        codes = find_edges(
            grey,
            settings.blur_sigma_px,
            settings.edge_quantile,
            settings.edge_low_ratio,
            settings.edge_min_contrast,
        )
        segments = find_segments(
            codes,
            self._circles,
            settings.min_fill,
            settings.min_walk_fill,
            settings.skip_px,
            settings.seed_grid_px,
        )
        lines, covered_px = link_segments(
            segments,
            settings.link_max_turn_rad,
            settings.link_max_aside_px,
            settings.link_max_gap_share * diagonal_px,
        )
        is_long = segment_lengths_px(lines) >= settings.min_length_share * diagonal_px
        return edge_lines(grey, lines[is_long], covered_px[is_long])

    def _judge(
        self,
        segments: Segments,
        power_lines: Segments,
        group: list[Conductor],
        shape: tuple[int, int],
    ) -> Detection:
        """Say from the conductors whether there is a power line, and where its middle runs."""
        settings = self._settings
        is_present = any(
            c.support >= max(settings.presence_min_support, settings.presence_min_sigmas / math.sqrt(c.length_px))
            for c in group
        )
        angle_rad = mean_line_angle_rad(
            np.array([c.angle_rad for c in group]), np.array([c.length_px**2 for c in group])
        )
        # Each conductor is a witness, and it is wrong with the share of the frame that it does not surely cover.
        confidence = 1.0 - math.prod(1.0 - c.support for c in group)
        return Detection(
            segments,
            power_lines,
            angle_rad,
            middle_offset_px(group, angle_rad, shape),
            n_abreast(group, angle_rad, shape),
            confidence if is_present else min(confidence, settings.presence_min_support),
            is_present,
        )
