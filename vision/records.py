"""What vision says about an image.

Angles: from image up, clockwise positive, in (-pi/2, pi/2] (docs/conventions.md). A segment is x1, y1, x2, y2 [px],
x right, y down, the centre of the first pixel at (0, 0).
"""

import enum
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Segments = NDArray[np.float64]
"""(n, 4) float64 [px]: x1, y1, x2, y2 of each segment; read-only."""

NO_LINES: Segments = np.empty((0, 4))
NO_LINES.setflags(write=False)


def wrap_line_angle_rad(angle_rad: float) -> float:
    """Wrap a line's angle, whose period is pi, into (-pi/2, pi/2] [rad]."""
    wrapped = math.fmod(angle_rad, math.pi)
    if wrapped <= -math.pi / 2:
        wrapped += math.pi
    elif wrapped > math.pi / 2:
        wrapped -= math.pi
    return wrapped


@dataclass(frozen=True, slots=True)
class ImageLine:
    """A straight line in the image; `angle_rad` and `offset_px` as in LineEstimate."""

    angle_rad: float
    offset_px: float


@dataclass(frozen=True, slots=True)
class LineEstimate:
    """The line group that one frame shows.

    The group's middle line runs along d = (sin angle_rad, -cos angle_rad) and passes the image centre at `offset_px`
    along its right-hand normal n = (cos angle_rad, sin angle_rad); so at angle 0 a positive offset is a line right of
    the centre. `n_lines` counts the conductors taken; `spacing_px` is the median distance of neighbours among them,
    None for a single one. `confidence` is in [0, 1], `t_capture_ns` is the frame's. Where the lens is calibrated, the
    pixels are those of the undistorted image. `conductors` are those that one cut across the group meets, one by one
    from left to right; a source that does not tell them apart leaves it empty. Where the line bends in view, all of it
    is about the span abreast of the image centre, and `next_span` is the middle of the other one.
    `presence` says how surely there is a line at all: below 1 a frame by itself is not enough, and the estimate counts
    only where it goes on with a line that was there a moment ago (vision.tracking).
    """

    angle_rad: float
    offset_px: float
    n_lines: int
    spacing_px: float | None
    confidence: float
    t_capture_ns: int
    next_span: ImageLine | None = None
    conductors: tuple[ImageLine, ...] = ()
    presence: float = 1.0

    @property
    def middle(self) -> ImageLine:
        """The group's middle line."""
        return ImageLine(self.angle_rad, self.offset_px)


@dataclass(frozen=True, slots=True, eq=False)  # arrays have no single answer to ==
class Detection:
    """All that the pipeline found in one image; what stands in LineEstimate, too, is meant as there.

    Segments run with the brighter side of their edge on their right. `angle_rad` is None where the image holds no
    segment at all. `is_present` says whether at least one thin conductor crosses enough of the frame (docs/decisions,
    after [Ceron] 6.1.3): only then do `power_lines` steer a vehicle.
    """

    segments: Segments
    power_lines: Segments
    angle_rad: float | None
    offset_px: float
    n_lines: int
    spacing_px: float | None
    confidence: float
    presence: float
    next_span: ImageLine | None = None
    conductors: tuple[ImageLine, ...] = ()

    @property
    def is_present(self) -> bool:
        """Whether the frame by itself shows a power line."""
        return self.presence >= 1.0

    def estimate(self, t_capture_ns: int) -> LineEstimate | None:
        """The estimate of a frame taken at `t_capture_ns`: None where there is no conductor."""
        if self.presence <= 0.0 or self.angle_rad is None:
            return None
        return LineEstimate(
            self.angle_rad,
            self.offset_px,
            self.n_lines,
            self.spacing_px,
            self.confidence,
            t_capture_ns,
            self.next_span,
            self.conductors,
            self.presence,
        )


class Track(enum.StrEnum):
    """How a frame continues those before it (vision.tracking)."""

    SEARCHING = "searching"
    """No line has been tracked yet."""
    TRACKING = "tracking"
    """The frame shows the line where it may be: its estimate counts."""
    DOUBTFUL = "doubtful"
    """The line was there a moment ago; this frame shows none, or one elsewhere."""
    LOST = "lost"
    """A line was tracked, and has not been seen for a while."""


class Trouble(enum.StrEnum):
    """What is wrong with a frame (vision.frame_check)."""

    UNREADABLE = "unreadable"
    """It is no 8-bit grey or BGR image."""
    DARK = "dark"
    OVEREXPOSED = "overexposed"
    FLAT = "flat"
    """It shows no contrast: a covered lens, fog."""
    FROZEN = "frozen"
    """It has been the very same image for a while: the camera repeats itself."""


BLINDING = frozenset({Trouble.UNREADABLE, Trouble.DARK, Trouble.FROZEN})
"""Troubles of frames that nothing can be seen in, whatever is there."""


@dataclass(frozen=True, slots=True, eq=False)  # arrays have no single answer to ==
class VisionReport:
    """What the vision worker sends for each frame it worked on.

    `estimate` is None where no line is present, and where `track` or `trouble` say that it must not steer; `trouble` is
    None for a sound frame. `latency_ns` is flight time from capture to this record, `work_ns` the
    pipeline's own time, `n_dropped` counts the camera's frames skipped since the last report. `power_lines` are kept
    for the log. `jpeg` holds the frame for the frames that the log keeps, else None.
    """

    seq: int
    t_capture_ns: int
    estimate: LineEstimate | None
    track: Track
    trouble: Trouble | None
    power_lines: Segments
    latency_ns: int
    work_ns: int
    n_dropped: int
    jpeg: bytes | None
