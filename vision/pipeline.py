"""The line finder: from an image to the power lines it shows and the line group's angle and offset."""

import math
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from drivers.camera.camera import Intrinsics
from vision.bend import find_bend
from vision.checks import check_shares
from vision.conductors import Conductor, find_conductors
from vision.edge_lines import ProjectionFinder, ProjectionSettings
from vision.edges import to_grey
from vision.finders import (
    BaselineFinder,
    CbsFinder,
    CbsSettings,
    EdgeLineFinder,
    EdgeSettings,
    LinkSettings,
    SteerableSettings,
)
from vision.lens import LensCorrection
from vision.line_group import abreast, choose_group, middle_offset_px, one_by_one, spacing_px
from vision.orientation import main_angle_rad, mean_line_angle_rad, segment_angles_rad
from vision.records import Detection, ImageLine, Segments

Detector = Literal["projection", "cbs", "steerable", "hough", "lsd", "edlines"]


@dataclass(frozen=True, slots=True)
class VisionSettings:
    """What can be tuned in the line finder. What ends in `_share` is a share of the frame's diagonal.

    `camera` is the calibrated camera whose frames are looked at, which must be of its size; None takes the lens for one
    that keeps straight lines straight.

    The defaults serve 640x480 nadir frames with conductors about 1 px wide as well as photographs from nearby. Raises
    ValueError for a value that cannot work.
    """

    detector: Detector = "projection"
    camera: Intrinsics | None = None
    projection: ProjectionSettings = field(default_factory=ProjectionSettings)
    edges: EdgeSettings = field(default_factory=EdgeSettings)
    steerable: SteerableSettings = field(default_factory=SteerableSettings)
    search: CbsSettings = field(default_factory=CbsSettings)
    linking: LinkSettings = field(default_factory=LinkSettings)

    # Conductors (vision.conductors.find_conductors).
    max_conductor_width_share: float = 0.03
    max_conductor_width_px: float = math.inf  # where the distance is known
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
        check_shares(self, "min_coherence", "min_relative_support", "min_relative_contrast", "presence_min_support")


def make_edge_finder(settings: VisionSettings) -> EdgeLineFinder:
    """The finder that the settings name."""
    if settings.detector == "projection":
        return ProjectionFinder(settings.projection)
    if settings.detector == "cbs":
        return CbsFinder(settings.edges, settings.search, settings.linking)
    if settings.detector == "steerable":
        return CbsFinder(settings.steerable, settings.search, settings.linking)
    return BaselineFinder(settings.detector, settings.edges, settings.linking)


class LineFinder:
    """Finds the power lines of one image after the other; remembers nothing that it saw."""

    def __init__(self, settings: VisionSettings) -> None:
        self._settings = settings
        self._edge_finder = make_edge_finder(settings)
        camera = settings.camera
        self._lens = LensCorrection(camera) if camera is not None and camera.is_distorted else None

    def warm_up(self) -> None:
        """Compile every kernel, or load it from its cache, so that no frame in flight waits for the compiler."""
        camera = self._settings.camera
        size = (96, 96) if camera is None else (camera.height_px, camera.width_px)
        colour = np.full((*size, 3), 60, dtype=np.uint8)
        # In the middle, where no lens bends it: a line that is not found compiles nothing of what comes after.
        middle = size[1] // 2
        colour[:, middle : middle + 3] = 220
        grey = np.ascontiguousarray(colour[:, :, 0])
        # To the compiler an array that must not be written to is another type, and cameras give those.
        locked = grey.copy()
        locked.setflags(write=False)
        for image in (colour, grey, locked):
            self.find(image)

    def find(self, image: NDArray[np.uint8]) -> Detection:
        """Find the power lines in `image`, (h, w) grey or (h, w, 3) BGR uint8, of any size from 1x1 on.

        The same image gives the same answer. Raises ValueError only for what is no such image, or is not of the
        calibrated camera's size where its lens is to be corrected.
        """
        settings, lens = self._settings, self._lens
        grey = to_grey(image)
        if lens is not None:
            grey = lens.straighten(grey)
        shape = (grey.shape[0], grey.shape[1])
        diagonal_px = math.hypot(*shape)
        edges = self._edge_finder.find(grey)
        conductors = find_conductors(
            edges,
            grey,
            min(settings.max_conductor_width_px, settings.max_conductor_width_share * diagonal_px),
            settings.pair_max_turn_rad,
            settings.min_coherence,
        )
        conductors = [c for c in conductors if c.contrast >= settings.min_contrast]
        if lens is not None:
            conductors = lens.correct_axes(conductors)
        group, peak_rad = choose_group(
            conductors,
            settings.main_angle_tolerance_rad,
            settings.min_relative_support,
            settings.min_relative_contrast,
        )
        bend = find_bend(
            conductors,
            shape,
            settings.main_angle_tolerance_rad,
            settings.min_relative_support,
            settings.min_relative_contrast,
        )
        beyond = [] if bend is None else bend.beyond.conductors
        if bend is not None:
            group = bend.here.conductors
        power_lines = np.array([edge for conductor in (*group, *beyond) for edge in conductor.edges]).reshape(-1, 4)
        power_lines.setflags(write=False)
        segments = edges.segments
        if lens is not None:
            segments, power_lines = lens.in_frame(segments), lens.in_frame(power_lines)
        if peak_rad is None:
            # Without a conductor the longest edges say which way the image runs.
            weights = (edges.coherence * edges.covered_px) ** 2
            peak_rad = main_angle_rad(segment_angles_rad(edges.segments), weights)
            return Detection(segments, power_lines, peak_rad, 0.0, 0, None, 0.0, 0.0)
        next_span = None if bend is None else ImageLine(bend.beyond.angle_rad, bend.beyond.offset_px)
        return self._judge(segments, power_lines, group, beyond, next_span, shape)

    def _judge(
        self,
        segments: Segments,
        power_lines: Segments,
        group: list[Conductor],
        beyond: list[Conductor],
        next_span: ImageLine | None,
        shape: tuple[int, int],
    ) -> Detection:
        """Say from the conductors, here and beyond a bend, whether there is a power line, and where its middle runs."""
        settings = self._settings
        presence = max(
            c.support / max(settings.presence_min_support, settings.presence_min_sigmas / math.sqrt(c.length_px))
            for c in (*group, *beyond)
        )
        angle_rad = mean_line_angle_rad(
            np.array([c.angle_rad for c in group]), np.array([c.length_px**2 for c in group])
        )
        # Each conductor is a witness, and it is wrong with the share of the frame that it does not surely cover.
        confidence = 1.0 - math.prod(1.0 - c.support for c in group)
        row = abreast(group, angle_rad, shape)
        return Detection(
            segments,
            power_lines,
            angle_rad,
            middle_offset_px(group, angle_rad, shape),
            len(row),
            spacing_px(row, angle_rad, shape),
            confidence if presence >= 1.0 else min(confidence, settings.presence_min_support),
            presence,
            next_span,
            one_by_one(row, angle_rad, shape),
        )
