"""A flight's log made into a video: its poses rendered again, with what was found and done on the way."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from drivers.camera.camera import Intrinsics
from drivers.clock import NS_PER_S
from mission.log.canvas import ACCENT, INK, Box, Canvas
from mission.log.reader import Flight
from mission.log.task_spans import TaskSpan, flight_start_ns, task_spans
from mission.log.track_map import MapView, map_view, task_color
from mission.log.wording import words_of
from mission.simulated.pictures import MOUNTS, PicturesError, picture_camera, scaled
from sitl.control import quaternion_of
from sitl.pose import Pose
from sitl.render.map import render_map
from sitl.render.motion import motion_between
from sitl.render.photographer import Photographer
from sitl.render.renderer import Renderer
from sitl.render.truth.sampling import CameraName
from sitl.world.file import load_world
from sitl.world.light import LIGHT_NAMES, LightName
from sitl.world.records import World

RATE_HZ = 25.0
ReplayCamera = Literal["down", "front", "both"]

_HFOV_DEG = 80.0
_HOLE_S = 1.0  # poses farther apart tell nothing of what was flown between them
_NOT_IN_LOG = "not in the log"
_REPORT_NS = 200_000_000  # a report farther away in time says nothing about a frame
_LINE_BGR = (40, 180, 255)
_INSET_SHARE = 0.28  # of the picture's height
_BAR_PX = 30
_MARGIN_PX = 10


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """Where the vehicle was: times (n,) [s] from the first on; (n, 6) north, east, down [m], roll, pitch, yaw [rad]."""

    start_ns: int
    times_s: NDArray[np.float64]
    values: NDArray[np.float64]

    def is_told_at(self, t_s: float) -> bool:
        """Whether the log has the vehicle's place around a time, and no hole of the log lies there."""
        after = int(np.searchsorted(self.times_s, t_s))
        if after in (0, len(self.times_s)) or self.times_s[after] == t_s:
            return True
        return bool(self.times_s[after] - self.times_s[after - 1] <= _HOLE_S)

    def pose_at(self, t_s: float) -> Pose:
        """The pose at a time, in between by straight lines; yaw is kept unwrapped."""
        north, east, down, roll, pitch, yaw = (float(np.interp(t_s, self.times_s, column)) for column in self.values.T)
        t_ns = self.start_ns + round(t_s * NS_PER_S)
        return Pose(t_ns, north, east, down, quaternion_of(roll, pitch, yaw))


def track_of(flight: Flight) -> Track:
    """The flight's true poses, with the tilt that telemetry told, or telemetry's alone where there is no truth.

    Raises PicturesError for a log without either.
    """
    records = flight.truth or flight.states
    if not records:
        raise PicturesError(f"The log {flight.path} holds no poses; there is nothing to replay.")
    times_ns = np.array([record.t_ns for record in records])
    start_ns = int(times_ns[0])
    times_s = (times_ns - start_ns) / NS_PER_S
    tilts = np.zeros((len(records), 2))
    if flight.states:
        told_s = [(state.t_ns - start_ns) / NS_PER_S for state in flight.states]
        tilts[:, 0] = np.interp(times_s, told_s, [state.roll_rad for state in flight.states])
        tilts[:, 1] = np.interp(times_s, told_s, [state.pitch_rad for state in flight.states])
    places = np.array([[record.north_m, record.east_m, record.down_m] for record in records])
    yaws = np.unwrap([record.yaw_rad for record in records])
    return Track(start_ns, times_s, np.column_stack([places, tilts, yaws]))


def world_of(flight: Flight, world: str | None, light: LightName | None) -> World:
    """The world that a log names, or the given one. Raises PicturesError, and WorldError where it cannot be read."""
    told = flight.mission.metadata
    name = world or told.get("world")
    if name is None and told.get("camera", "").startswith("sim:"):
        name = told["camera"].removeprefix("sim:")
    if name is None:
        raise PicturesError(f"The log {flight.path} names no world: it was not flown in a simulated one; give --world.")
    lights: dict[str, LightName] = {known: known for known in LIGHT_NAMES}
    if light is None and "light" in told:
        light = lights.get(told["light"])
        if light is None:
            raise PicturesError(f"The log {flight.path} tells of the light '{told['light']}'; choose one with --light.")
    return load_world(name, light)


def write_video(
    flight: Flight,
    world: World,
    out: Path,
    camera: ReplayCamera,
    size_px: tuple[int, int] | None,
    on_frame: Callable[[int, int], None],
) -> int:
    """Render the flight into an MP4 file, and say how many frames it has.

    Where poses are missing for more than a second the last picture stands, and the bar says so; the clock counts from
    the first task's start. `size_px` is the size of each camera's picture, None as the flight's. `on_frame` hears which
    frame of how many is done. Raises PicturesError.
    """
    intrinsics = flight.camera or picture_camera(640, 480, _HFOV_DEG)
    if size_px is not None:
        intrinsics = scaled(intrinsics, *size_px)
    names: tuple[CameraName, ...] = ("down", "front") if camera == "both" else (camera,)
    views = [_View(world, name, intrinsics) for name in names]
    width_px, height_px = len(views) * intrinsics.width_px, intrinsics.height_px
    track = track_of(flight)
    n_frames = 1 + int(track.times_s[-1] * RATE_HZ)
    overlay = _Overlay(flight, world, width_px, height_px)
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise PicturesError(f"The video {out} cannot be written: {error.strerror}.") from error
    video = cv2.VideoWriter(str(out), cv2.VideoWriter.fourcc(*"mp4v"), RATE_HZ, (width_px, height_px + _BAR_PX))
    try:
        if not video.isOpened():
            raise PicturesError(
                f"The video {out} cannot be written; name a .mp4 file in a folder that you may write to."
            )
        for k, frame in enumerate(_frames(track, views, overlay, n_frames)):
            video.write(frame)
            on_frame(k + 1, n_frames)
    finally:
        video.release()
    return n_frames


class _View:
    """One camera of the replay; the one ahead has a plain lens."""

    def __init__(self, world: World, name: CameraName, intrinsics: Intrinsics) -> None:
        self.name = name
        lens = intrinsics if name == "down" else picture_camera(intrinsics.width_px, intrinsics.height_px, _HFOV_DEG)
        self._photographer = Photographer(Renderer(world, lens, MOUNTS[name]))
        self._before: Pose | None = None

    def take(self, pose: Pose, seq: int) -> NDArray[np.uint8]:
        image = self._photographer.take(motion_between(self._before, pose), seq).image
        self._before = pose
        return image

    def forget(self) -> None:
        """What is taken next is not next to what was taken before."""
        self._before = None


def _frames(track: Track, views: list[_View], overlay: "_Overlay", n_frames: int) -> Iterator[NDArray[np.uint8]]:
    picture: NDArray[np.uint8] | None = None
    pose = track.pose_at(0.0)
    for k in range(n_frames):
        t_s = k / RATE_HZ
        if picture is not None and not track.is_told_at(t_s):
            for view in views:
                view.forget()
            yield overlay.finish(picture, pose, track.start_ns + round(t_s * NS_PER_S), is_told=False)
            continue
        pose = track.pose_at(t_s)
        images = []
        for view in views:
            image = view.take(pose, k)
            if view.name == "down":
                overlay.draw_lines(image, pose.t_ns)
            images.append(image)
        picture = np.hstack(images)
        yield overlay.finish(picture, pose, pose.t_ns)


def clock(t_s: float) -> str:
    """Minutes and seconds since the flight's start, with a sign before it."""
    tenths = round(abs(t_s) * 10)
    sign = "-" if t_s < 0 and tenths else ""
    return f"{sign}{tenths // 600}:{tenths % 600 / 10:04.1f}"


class _Overlay:
    """What is drawn over the pictures: the lines found, a bar with task and time, and a small map."""

    def __init__(self, flight: Flight, world: World, width_px: int, height_px: int) -> None:
        self._reports = flight.reports
        self._report_times = np.array([report.t_capture_ns for report in flight.reports], dtype=np.int64)
        self._spans = task_spans(flight)
        self._start_ns = flight_start_ns(flight)
        self._camera = flight.camera or picture_camera(640, 480, _HFOV_DEG)
        self._canvas = Canvas(width_px, height_px + _BAR_PX)
        side = round(_INSET_SHARE * height_px)
        self._box = Box(width_px - side - _MARGIN_PX, _MARGIN_PX, side, side)
        self._map_view: MapView = map_view(flight, side, side)
        self._map = render_map(world, self._map_view.bounds_ne_m, self._map_view.px_per_m)[:side, :side]

    def draw_lines(self, image: NDArray[np.uint8], t_ns: int) -> None:
        """Draw the power lines of the report nearest in time."""
        if not len(self._report_times):
            return
        nearest = int(np.argmin(np.abs(self._report_times - t_ns)))
        if abs(int(self._report_times[nearest]) - t_ns) > _REPORT_NS:
            return
        # Reports are in the pixels of the flight's camera.
        scale = np.tile([image.shape[1] / self._camera.width_px, image.shape[0] / self._camera.height_px], 2)
        for x1, y1, x2, y2 in (self._reports[nearest].power_lines + 0.5) * scale - 0.5:
            cv2.line(
                image, (round(x1 * 8), round(y1 * 8)), (round(x2 * 8), round(y2 * 8)), _LINE_BGR, 2, cv2.LINE_AA, 3
            )

    def finish(self, image: NDArray[np.uint8], pose: Pose, t_ns: int, *, is_told: bool = True) -> NDArray[np.uint8]:
        """The whole frame at a time; the next call draws over it. Where it is not told, the picture is an older one."""
        canvas, height_px = self._canvas, image.shape[0]
        canvas.image[:height_px] = image
        canvas.panel(Box(0, height_px, image.shape[1], _BAR_PX), radius_px=1)
        span = self._span_at(t_ns) if is_told else None
        task = "" if span is None else words_of(span.task)
        baseline = height_px + _BAR_PX - 10
        canvas.text(
            (12, baseline),
            task if is_told else _NOT_IN_LOG,
            15,
            INK if span is None else task_color(span.task),
            is_bold=True,
        )
        height = f"{round(-pose.down_m, 1) + 0.0:.1f} m     " if is_told else ""
        told = height + clock((t_ns - self._start_ns) / NS_PER_S)
        canvas.text((image.shape[1] - 12 - canvas.text_width(told, 15), baseline), told, 15)
        canvas.paste(self._box, self._map, radius_px=6)
        place = self._map_view.to_px(np.array([[pose.north_m, pose.east_m]]), self._box)[0]
        ahead = 9.0 * np.array([np.sin(pose.yaw_rad), -np.cos(pose.yaw_rad)])
        canvas.polyline(np.array([place, place + ahead]), ACCENT, 2, self._box)
        canvas.dot((place[0], place[1]), 4.0, ACCENT)
        return canvas.image

    def _span_at(self, t_ns: int) -> TaskSpan | None:
        started = [span for span in self._spans if span.start_ns <= t_ns]
        if not started or (started[-1].end_ns is not None and started[-1].end_ns < t_ns):
            return None
        return started[-1]
