"""Eyes that know the world: where a straight line at a known height appears in the image of the true pose.

It goes from the world to the image by the rotation matrix of the true attitude, so it checks guidance, which goes the
other way by Euler angles, rather than repeating it.
"""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from drivers.camera.camera import Intrinsics
from drivers.clock import Clock
from mission.eyes import Notice
from vision.records import NO_LINES, ImageLine, LineEstimate, Track, VisionReport, wrap_line_angle_rad

Pose = tuple[tuple[float, float, float], tuple[float, float, float, float]]
"""Position NED [m] and attitude (w, x, y, z)."""

FRAME_PERIOD_NS = 40_000_000
LATENCY_NS = 60_000_000
_REACHES_M = np.linspace(-60.0, 60.0, 241)
_Pixels = tuple[np.ndarray, np.ndarray]


def rotation_ned_from_frd(quaternion: tuple[float, float, float, float]) -> np.ndarray:
    """The rotation matrix of a quaternion (w, x, y, z)."""
    w, x, y, z = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def see_line(
    position_ned_m: tuple[float, float, float],
    quaternion: tuple[float, float, float, float],
    camera: Intrinsics,
    line_point_ned_m: tuple[float, float, float],
    line_heading_rad: float,
    t_capture_ns: int = 0,
    *,
    askew_rad: float = 0.0,
) -> LineEstimate | None:
    """The estimate of a straight level line; None where it does not cross the image.

    `askew_rad` is by how much the camera is rolled to the right on its mount, which nobody knows of.
    """
    pixels = _project(
        position_ned_m, quaternion, camera, line_point_ned_m, line_heading_rad, _REACHES_M, askew_rad=askew_rad
    )
    if pixels is None:
        return None
    line = _image_line(pixels, camera)
    return LineEstimate(line.angle_rad, line.offset_px, 3, None, 1.0, t_capture_ns)


def see_bend(
    position_ned_m: tuple[float, float, float],
    quaternion: tuple[float, float, float, float],
    camera: Intrinsics,
    bend_ned_m: tuple[float, float, float],
    headings_rad: tuple[float, float],
    t_capture_ns: int = 0,
) -> LineEstimate | None:
    """The estimate of a level line with two spans, that come to `bend_ned_m` along one heading and leave it along one.

    It is about the span that is nearer to the image's centre; the other one is the next span.
    """
    before, after = (
        _project(position_ned_m, quaternion, camera, bend_ned_m, heading_rad, reaches_m)
        for heading_rad, reaches_m in zip(
            headings_rad, (_REACHES_M[_REACHES_M <= 0.0], _REACHES_M[_REACHES_M >= 0.0]), strict=True
        )
    )
    spans = [span for span in (before, after) if span is not None]
    if not spans:
        return None
    u_px, v_px = (camera.width_px - 1) / 2, (camera.height_px - 1) / 2
    spans.sort(key=lambda span: float(np.hypot(span[0] - u_px, span[1] - v_px).min()))
    lines = [_image_line(span, camera) for span in spans]
    next_span = lines[1] if len(lines) == 2 else None
    return LineEstimate(lines[0].angle_rad, lines[0].offset_px, 3, None, 1.0, t_capture_ns, next_span)


def _project(
    position_ned_m: tuple[float, float, float],
    quaternion: tuple[float, float, float, float],
    camera: Intrinsics,
    line_point_ned_m: tuple[float, float, float],
    line_heading_rad: float,
    reaches_m: np.ndarray,
    *,
    askew_rad: float = 0.0,
) -> _Pixels | None:
    """Where a line's points appear in the image, in the order of their reaches; None where fewer than three do."""
    along = np.array([math.cos(line_heading_rad), math.sin(line_heading_rad), 0.0])
    points = np.array(line_point_ned_m) + reaches_m[:, None] * along - np.array(position_ned_m)
    body = points @ rotation_ned_from_frd(quaternion)  # the inverse rotation of each row
    right, down = body[:, 1].copy(), body[:, 2].copy()
    body[:, 1] = math.cos(askew_rad) * right + math.sin(askew_rad) * down
    body[:, 2] = math.cos(askew_rad) * down - math.sin(askew_rad) * right
    body = body[body[:, 2] > 0.2]
    x = camera.cx_px + camera.fx_px * body[:, 1] / body[:, 2]
    y = camera.cy_px - camera.fy_px * body[:, 0] / body[:, 2]
    is_inside = (x >= 0) & (x <= camera.width_px - 1) & (y >= 0) & (y <= camera.height_px - 1)
    return (x[is_inside], y[is_inside]) if is_inside.sum() >= 3 else None


def _image_line(pixels: _Pixels, camera: Intrinsics) -> ImageLine:
    x0, x1 = (float(end) for end in pixels[0][[0, -1]])
    y0, y1 = (float(end) for end in pixels[1][[0, -1]])
    angle_rad = wrap_line_angle_rad(math.atan2(x1 - x0, -(y1 - y0)))
    normal = (math.cos(angle_rad), math.sin(angle_rad))
    centre = ((camera.width_px - 1) / 2, (camera.height_px - 1) / 2)
    return ImageLine(angle_rad, normal[0] * (x0 - centre[0]) + normal[1] * (y0 - centre[1]))


def bare_report(seq: int, t_capture_ns: int, estimate: LineEstimate | None, latency_ns: int = 0) -> VisionReport:
    """A sound frame's report that carries nothing but the estimate."""
    track = Track.SEARCHING if estimate is None else Track.TRACKING
    return VisionReport(seq, t_capture_ns, estimate, track, None, NO_LINES, latency_ns, 0, 0, None)


class GeometricEyes:
    """mission.eyes.Eyes over a straight line. `is_blind` shows no line, `is_silent` sends no report.

    `failure` is a dead worker, `impairment` a camera that is gone or blind. `latency_ns` is from a frame to its report,
    `stamp_late_ns` by how much later than it was taken a frame says that it was, `askew_rad` as for `see_line`. They
    take another line for it, `aside_m` to the right of it and turned by `turned_rad` to the right below the vehicle.
    With `bend_m` and `bend_rad` the line turns to the right so far beyond its point; `is_bend_hidden` keeps from them
    what is not the nearer span.
    """

    def __init__(
        self,
        pose: Callable[[], Pose | None],
        clock: Clock,
        camera: Intrinsics,
        line_point_ned_m: tuple[float, float, float],
        line_heading_rad: float,
    ) -> None:
        self._pose = pose
        self._clock = clock
        self._camera = camera
        self._point = line_point_ned_m
        self._heading_rad = line_heading_rad
        self._next_ns = 0
        self._seq = 0
        self._pending: list[tuple[int, VisionReport]] = []
        self.is_blind = False
        self.is_silent = False
        self.latency_ns = LATENCY_NS
        self.stamp_late_ns = 0
        self.askew_rad = 0.0
        self.aside_m = 0.0
        self.turned_rad = 0.0
        self.bend_m, self.bend_rad = math.inf, 0.0
        self.is_bend_hidden = False
        self.failure: str | None = None
        self.missing: str | None = None
        self.impairment: Notice | None = None

    def take(self) -> list[VisionReport]:
        """Look whenever a frame is due; hand it over when its latency has passed."""
        now_ns = self._clock.now_ns()
        pose = self._pose()
        if pose is None:
            return []
        if now_ns >= self._next_ns and self.failure is None and not self.is_silent:
            self._next_ns = now_ns + FRAME_PERIOD_NS
            position_m, quaternion = pose
            estimate = None
            stamp_ns = now_ns + self.stamp_late_ns
            if not self.is_blind:
                estimate = self._see(position_m, quaternion, stamp_ns)
            report = bare_report(self._seq, stamp_ns, estimate, self.latency_ns)
            self._pending.append((stamp_ns + self.latency_ns, report))
            self._seq += 1
        due = [report for due_ns, report in self._pending if now_ns >= due_ns]
        self._pending = [(due_ns, report) for due_ns, report in self._pending if now_ns < due_ns]
        return due

    def _see(
        self,
        position_m: tuple[float, float, float],
        quaternion: tuple[float, float, float, float],
        stamp_ns: int,
    ) -> LineEstimate | None:
        north_m, east_m, down_m = self._point
        north, east = math.cos(self._heading_rad), math.sin(self._heading_rad)
        if math.isfinite(self.bend_m):
            bend = (north_m + self.bend_m * north, east_m + self.bend_m * east, down_m)
            headings_rad = (self._heading_rad, self._heading_rad + self.bend_rad)
            estimate = see_bend(position_m, quaternion, self._camera, bend, headings_rad, stamp_ns)
            if estimate is not None and self.is_bend_hidden:
                estimate = replace(estimate, next_span=None)
            return estimate
        along_m = (position_m[0] - north_m) * north + (position_m[1] - east_m) * east
        abreast = (
            north_m + along_m * north - self.aside_m * east,
            east_m + along_m * east + self.aside_m * north,
            down_m,
        )
        heading_rad = self._heading_rad + self.turned_rad
        return see_line(position_m, quaternion, self._camera, abreast, heading_rad, stamp_ns, askew_rad=self.askew_rad)

    def take_notices(self) -> list[Notice]:
        """Nothing ever happens to these eyes."""
        return []
