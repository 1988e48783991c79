"""Eyes that know the world: where a straight line at a known height appears in the image of the true pose.

It goes from the world to the image by the rotation matrix of the true attitude, so it checks guidance, which goes the
other way by Euler angles, rather than repeating it.
"""

import math
from collections.abc import Callable

import numpy as np

from drivers.camera.camera import Intrinsics
from drivers.clock import Clock
from mission.eyes import Notice
from vision.records import NO_LINES, LineEstimate, Track, VisionReport, wrap_line_angle_rad

Pose = tuple[tuple[float, float, float], tuple[float, float, float, float]]
"""Position NED [m] and attitude (w, x, y, z)."""

FRAME_PERIOD_NS = 40_000_000
LATENCY_NS = 60_000_000
_REACHES_M = np.linspace(-60.0, 60.0, 241)


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
    along = np.array([math.cos(line_heading_rad), math.sin(line_heading_rad), 0.0])
    points = np.array(line_point_ned_m) + _REACHES_M[:, None] * along - np.array(position_ned_m)
    body = points @ rotation_ned_from_frd(quaternion)  # the inverse rotation of each row
    right, down = body[:, 1].copy(), body[:, 2].copy()
    body[:, 1] = math.cos(askew_rad) * right + math.sin(askew_rad) * down
    body[:, 2] = math.cos(askew_rad) * down - math.sin(askew_rad) * right
    body = body[body[:, 2] > 0.2]
    x = camera.cx_px + camera.fx_px * body[:, 1] / body[:, 2]
    y = camera.cy_px - camera.fy_px * body[:, 0] / body[:, 2]
    is_inside = (x >= 0) & (x <= camera.width_px - 1) & (y >= 0) & (y <= camera.height_px - 1)
    if is_inside.sum() < 3:
        return None
    x0, x1 = (float(end) for end in x[is_inside][[0, -1]])
    y0, y1 = (float(end) for end in y[is_inside][[0, -1]])
    angle_rad = wrap_line_angle_rad(math.atan2(x1 - x0, -(y1 - y0)))
    normal = (math.cos(angle_rad), math.sin(angle_rad))
    centre = ((camera.width_px - 1) / 2, (camera.height_px - 1) / 2)
    offset_px = normal[0] * (x0 - centre[0]) + normal[1] * (y0 - centre[1])
    return LineEstimate(angle_rad, offset_px, 3, None, 1.0, t_capture_ns)


def bare_report(seq: int, t_capture_ns: int, estimate: LineEstimate | None, latency_ns: int = 0) -> VisionReport:
    """A sound frame's report that carries nothing but the estimate."""
    track = Track.SEARCHING if estimate is None else Track.TRACKING
    return VisionReport(seq, t_capture_ns, estimate, track, None, NO_LINES, latency_ns, 0, 0, None)


class GeometricEyes:
    """mission.eyes.Eyes over a straight line. `is_blind` shows no line, `is_silent` sends no report.

    `failure` is a dead worker, `impairment` a camera that is gone or blind. `latency_ns` is from a frame to its report,
    `stamp_late_ns` by how much later than it was taken a frame says that it was, `askew_rad` as for `see_line`.
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
                estimate = see_line(
                    position_m,
                    quaternion,
                    self._camera,
                    self._point,
                    self._heading_rad,
                    stamp_ns,
                    askew_rad=self.askew_rad,
                )
            report = bare_report(self._seq, stamp_ns, estimate, self.latency_ns)
            self._pending.append((stamp_ns + self.latency_ns, report))
            self._seq += 1
        due = [report for due_ns, report in self._pending if now_ns >= due_ns]
        self._pending = [(due_ns, report) for due_ns, report in self._pending if now_ns < due_ns]
        return due

    def take_notices(self) -> list[Notice]:
        """Nothing ever happens to these eyes."""
        return []
