"""The line finder: from an image to the power lines it shows and the line group's angle and offset."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vision.cbs import find_segments
from vision.circle import make_circle
from vision.conductors import Conductor, find_conductors, middle_offset_px, n_abreast
from vision.edges import find_edges, to_grey
from vision.linking import link_segments, segment_lengths_px
from vision.orientation import line_angle_distance_rad, main_angle_rad, mean_line_angle_rad, segment_angles_rad
from vision.records import Detection, Segments


@dataclass(frozen=True, slots=True)
class VisionSettings:
    """What can be tuned in the line finder. What ends in `_share` is a share of the frame's diagonal.

    The defaults serve 640x480 nadir frames with conductors about 1 px wide as well as photographs from nearby. Raises
    ValueError for a value that cannot work.
    """

    # Edges (vision.edges.find_edges).
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

    # Power lines: the lines of some length near the main angle, and which of them are thin (vision.conductors).
    main_angle_tolerance_rad: float = math.radians(10.0)
    min_length_share: float = 0.09
    max_conductor_width_share: float = 0.03
    pair_max_turn_rad: float = math.radians(2.5)
    min_counted_reach: float = 0.3  # share of the frame's chord
    min_relative_reach: float = 0.35  # of the reach of the conductor that reaches furthest

    # Presence: one thin conductor of this length that covers this share of the frame's chord along it.
    presence_min_length_share: float = 0.25
    presence_min_reach: float = 0.6

    def __post_init__(self) -> None:
        if self.radius_step_px < 0 or self.radius_px - self.radius_step_px < 2:
            raise ValueError(
                f"radius_px {self.radius_px} less radius_step_px {self.radius_step_px} leaves no search circle: "
                "choose them so that both passes have a radius of 2 px or more."
            )
        if self.skip_px < 1 or self.seed_grid_px < 1:
            raise ValueError("skip_px and seed_grid_px are steps in pixels: choose 1 or more.")
        for name in ("edge_quantile", "edge_low_ratio", "min_fill", "min_walk_fill", "presence_min_reach"):
            value = getattr(self, name)
            if not 0.0 < value <= 1.0:
                raise ValueError(f"{name} is {value}, but it is a share: choose it above 0 and at most 1.")


class LineFinder:
    """Finds the power lines of one image after the other; keeps nothing from image to image."""

    def __init__(self, settings: VisionSettings) -> None:
        self._settings = settings
        radii_px = (settings.radius_px, settings.radius_px - settings.radius_step_px)
        self._circles = tuple(make_circle(radius_px) for radius_px in radii_px)

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
        angles_rad = segment_angles_rad(lines)
        # The square of the length: one line across the frame outweighs a meadow's many short pieces.
        peak_rad = main_angle_rad(angles_rad, covered_px**2)
        if peak_rad is None:
            return Detection(segments, segments, None, 0.0, 0, 0.0, False)
        is_chosen = (line_angle_distance_rad(angles_rad, peak_rad) <= settings.main_angle_tolerance_rad) & (
            segment_lengths_px(lines) >= settings.min_length_share * diagonal_px
        )
        power_lines: Segments = lines[is_chosen]
        power_lines.setflags(write=False)
        conductors = find_conductors(
            power_lines,
            covered_px[is_chosen],
            shape,
            settings.max_conductor_width_share * diagonal_px,
            settings.pair_max_turn_rad,
        )
        # Conductors cross the frame side by side: beside one that does, a short line is a branch or a joint.
        best_reach = max((c.reach for c in conductors), default=0.0)
        conductors = [c for c in conductors if c.reach >= settings.min_relative_reach * best_reach]
        power_lines = power_lines[sorted(member for c in conductors for member in c.members)]
        power_lines.setflags(write=False)
        return self._judge(segments, power_lines, conductors, peak_rad, shape, diagonal_px)

    def _judge(
        self,
        segments: Segments,
        power_lines: Segments,
        conductors: list[Conductor],
        peak_rad: float,
        shape: tuple[int, int],
        diagonal_px: float,
    ) -> Detection:
        """Say from the conductors whether there is a power line, and where its middle runs."""
        settings = self._settings
        thin = [c for c in conductors if c.width_px is not None and c.reach >= settings.min_counted_reach]
        is_present = any(
            c.reach >= settings.presence_min_reach and c.length_px >= settings.presence_min_length_share * diagonal_px
            for c in thin
        )
        group = thin or conductors
        if not group:
            return Detection(segments, power_lines, peak_rad, 0.0, 0, 0.0, False)
        angle_rad = mean_line_angle_rad(
            np.array([c.angle_rad for c in group]), np.array([c.length_px**2 for c in group])
        )
        n_lines = n_abreast(thin, angle_rad, shape)
        # Each thin conductor is a witness, and it is wrong with the share of the frame that it does not cover.
        confidence = 1.0 - math.prod(1.0 - c.reach for c in thin)
        return Detection(
            segments,
            power_lines,
            angle_rad,
            middle_offset_px(group, angle_rad, shape),
            n_lines,
            confidence if is_present else min(confidence, settings.presence_min_reach),
            is_present,
        )
