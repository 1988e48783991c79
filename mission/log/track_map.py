"""The map of a flight, seen from above with north up: the track by task over the line's conductors."""

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from mission.autopilot import VehicleState
from mission.log.canvas import ACCENT, DIM_INK, INK, SHADOW, Align, Box, Canvas, Color, Image
from mission.log.reader import Flight
from mission.log.task_spans import task_spans
from mission.log.wording import words_of
from mission.records import TruePose

TASK_COLOR: dict[str, Color] = {
    "takeoff": (236, 236, 236),
    "ascend": (236, 214, 170),
    "move_until": (242, 170, 76),
    "align": (232, 122, 190),
    "follow_lines": ACCENT,
    "rotate": (150, 120, 250),
    "move_forward": (190, 210, 90),
    "return": (190, 210, 90),
    "descend": (205, 190, 160),
    "land": (190, 190, 190),
}
_OTHER_COLOR: Color = (200, 200, 200)
_GRID_COLOR: Color = (54, 45, 38)
_CONDUCTOR_COLOR: Color = (250, 250, 250)
_MARGIN_SHARE = 0.14
_MIN_SPAN_M = 20.0
_BACKGROUND_LIGHT = 0.72  # so that tracks and words stand out


BoundsNe = tuple[float, float, float, float]
"""A rectangle of ground [m]: north min, east min, north max, east max."""


@dataclass(frozen=True, slots=True)
class MapView:
    """The ground that a map shows, north up, and its scale."""

    bounds_ne_m: BoundsNe
    px_per_m: float

    def to_px(self, points_ne_m: NDArray[np.float64], box: Box) -> NDArray[np.float64]:
        """Turn (n, 2) north, east [m] into (n, 2) x, y [px] on the picture, the map standing in `box`."""
        _, west_m, north_m, _ = self.bounds_ne_m
        from_corner = np.column_stack([points_ne_m[:, 1] - west_m, north_m - points_ne_m[:, 0]])
        return np.asarray(from_corner * self.px_per_m + np.array([box.x - 0.5, box.y - 0.5]))


@dataclass(frozen=True, slots=True)
class MapBackground:
    """A picture of the ground, (h, w, 3) BGR uint8, north up, whose outer edges are the bounds."""

    image: Image
    bounds_ne_m: BoundsNe


def task_color(task: str) -> Color:
    """Which colour a task has in every part of the picture."""
    return TASK_COLOR.get(task, _OTHER_COLOR)


def map_view(flight: Flight, width_px: int, height_px: int) -> MapView:
    """Choose the ground to show so that the whole track fits into a map of this size, with a margin."""
    track = _track(flight)
    low, high = (track.min(axis=0), track.max(axis=0)) if len(track) else (np.zeros(2), np.zeros(2))
    span_m = np.maximum(high - low, 1e-6)
    fit_m = max(span_m[0] / height_px, span_m[1] / width_px) * min(width_px, height_px)
    m_per_px = float(max(fit_m, _MIN_SPAN_M)) * (1 + 2 * _MARGIN_SHARE) / min(width_px, height_px)
    north_m, east_m = ((low + high) / 2).tolist()
    half_north_m, half_east_m = height_px * m_per_px / 2, width_px * m_per_px / 2
    bounds = (north_m - half_north_m, east_m - half_east_m, north_m + half_north_m, east_m + half_east_m)
    return MapView(bounds, 1 / m_per_px)


def draw_map(canvas: Canvas, box: Box, flight: Flight, background: MapBackground | None) -> None:
    """Draw the map into `box`."""
    view = map_view(flight, box.width, box.height)
    if background is None:
        canvas.panel(box)
        _draw_grid(canvas, box, view)
    else:
        canvas.paste(box, _cut(background, view, box))
    _draw_conductors(canvas, box, view, flight)
    tasks = _draw_track(canvas, box, view, flight)
    _draw_marks(canvas, box, view, flight)
    _draw_legend(canvas, box, view.to_px(_track(flight), box), tasks, has_line=flight.line is not None)
    _draw_scale(canvas, box, view)
    _draw_north(canvas, box)


def _poses(flight: Flight) -> list[tuple[int, float, float]]:
    """Time, north and east: the true ones where they are known, so that they fit the true line."""
    records: tuple[TruePose | VehicleState, ...] = flight.truth or flight.states
    return [(record.t_ns, record.north_m, record.east_m) for record in records]


def _track(flight: Flight) -> NDArray[np.float64]:
    return np.array([pose[1:] for pose in _poses(flight)], dtype=np.float64).reshape(-1, 2)


def _cut(background: MapBackground, view: MapView, box: Box) -> Image:
    """The part of the background that the view shows, darkened; mirrored beyond its edges."""
    south_m, west_m, north_m, east_m = background.bounds_ne_m
    height_px, width_px = background.image.shape[:2]
    x_scale = width_px / (east_m - west_m) / view.px_per_m
    y_scale = height_px / (north_m - south_m) / view.px_per_m
    _, view_west_m, view_north_m, _ = view.bounds_ne_m
    # A pixel's place is its centre, half a pixel from its edges.
    x_shift = ((view_west_m - west_m) * view.px_per_m + 0.5) * x_scale - 0.5
    y_shift = ((north_m - view_north_m) * view.px_per_m + 0.5) * y_scale - 0.5
    source_from_target = np.array([[x_scale, 0.0, x_shift], [0.0, y_scale, y_shift]])
    cut = cv2.warpAffine(
        background.image,
        source_from_target,
        (box.width, box.height),
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_REFLECT_101,
    )
    return np.asarray(cut * _BACKGROUND_LIGHT, dtype=np.uint8)


def _draw_grid(canvas: Canvas, box: Box, view: MapView) -> None:
    step_m = nice_length_m(box.width / view.px_per_m / 8)
    south_m, west_m, north_m, east_m = view.bounds_ne_m
    for line_m in np.arange(math.ceil(south_m / step_m) * step_m, north_m, step_m).tolist():
        canvas.polyline(view.to_px(np.array([[line_m, west_m], [line_m, east_m]]), box), _GRID_COLOR, 1, box)
    for line_m in np.arange(math.ceil(west_m / step_m) * step_m, east_m, step_m).tolist():
        canvas.polyline(view.to_px(np.array([[south_m, line_m], [north_m, line_m]]), box), _GRID_COLOR, 1, box)


def _draw_conductors(canvas: Canvas, box: Box, view: MapView, flight: Flight) -> None:
    if flight.line is None:
        return
    for conductor in flight.line.conductors_ned_m:
        points = view.to_px(np.array(conductor)[:, :2], box)
        canvas.polyline(points, _CONDUCTOR_COLOR, 1, box)
    for north_m, east_m, _ in flight.line.supports_ned_m:
        x, y = view.to_px(np.array([[north_m, east_m]]), box)[0].tolist()
        if box.x + 8 < x < box.right - 8 and box.y + 8 < y < box.bottom - 8:
            canvas.dot((x, y), 6.0, SHADOW)
            canvas.dot((x, y), 4.0, _CONDUCTOR_COLOR)


def _draw_track(canvas: Canvas, box: Box, view: MapView, flight: Flight) -> list[str]:
    """Draw the track, each task in its colour; returns the tasks in the order flown, each once."""
    times_ns = np.array([t_ns for t_ns, _, _ in _poses(flight)], dtype=np.int64)
    points = view.to_px(_track(flight), box)
    pieces = []
    for span in task_spans(flight):
        end_ns = flight.end_ns if span.end_ns is None else span.end_ns
        piece = points[(times_ns >= span.start_ns) & (times_ns <= end_ns)]
        if len(piece):
            pieces.append((span.task, piece))
    for _, piece in pieces:
        canvas.polyline(piece, SHADOW, 8, box)
    for task, piece in pieces:
        canvas.polyline(piece, task_color(task), 4, box)
    return list(dict.fromkeys(task for task, _ in pieces))


def _draw_marks(canvas: Canvas, box: Box, view: MapView, flight: Flight) -> None:
    track = _track(flight)
    if not len(track):
        return
    start, end = view.to_px(track[[0, -1]], box).tolist()
    is_one_place = math.dist(start, end) < 60
    name = "landing" if flight.mission_ended is not None else "end of the log"
    marks = [(start, "take-off, " + name)] if is_one_place else [(start, "take-off"), (end, name)]
    for place in (start, end):
        canvas.dot(place, 9.0, SHADOW)
        canvas.dot(place, 6.0, INK, 3)
    for (x, y), words in marks:
        plate = Box(round(x) + 18, round(y) - 15, canvas.text_width(words, 17) + 20, 30)
        canvas.panel(plate, SHADOW, opacity=0.7, radius_px=8)
        canvas.text((plate.x + 10, plate.y + 21), words, 17)


def _draw_legend(canvas: Canvas, box: Box, track_px: NDArray[np.float64], tasks: list[str], *, has_line: bool) -> None:
    """Draw the legend where it hides least of the track; the right-hand corners belong to north and the scale."""
    entries = [(words_of(task), task_color(task), 5) for task in tasks]
    if has_line:
        entries.append(("conductors", _CONDUCTOR_COLOR, 1))
    if not entries:
        return
    width_px = max(canvas.text_width(words, 17) for words, _, _ in entries) + 62
    height_px = 26 * len(entries) + 18
    left, right, top, bottom = box.x + 16, box.right - 16 - width_px, box.y + 16, box.bottom - 16 - height_px
    corners = [(left, top), (left, bottom), (right, bottom - 64), (right, top + 68)]
    plate = min((Box(x, y, width_px, height_px) for x, y in corners), key=lambda plate: _n_inside(track_px, plate))
    canvas.panel(plate, SHADOW, opacity=0.7)
    for row, (words, color, line_px) in enumerate(entries):
        y = plate.y + 22 + 26 * row
        canvas.panel(Box(plate.x + 14, y - line_px // 2, 24, line_px), color, radius_px=line_px // 2)
        canvas.text((plate.x + 48, y + 6), words, 17)


def _n_inside(points_px: NDArray[np.float64], box: Box) -> int:
    low, high = np.array([box.x, box.y]), np.array([box.right, box.bottom])
    return int(((points_px >= low) & (points_px < high)).all(axis=1).sum())


def _draw_scale(canvas: Canvas, box: Box, view: MapView) -> None:
    length_m = nice_length_m(box.width / view.px_per_m / 5)
    length_px = length_m * view.px_per_m
    plate = Box(box.right - 16 - round(length_px) - 36, box.bottom - 16 - 48, round(length_px) + 36, 48)
    canvas.panel(plate, SHADOW, opacity=0.7)
    left, y = plate.x + 18.0, plate.bottom - 14.0
    ends = [[left, y - 6], [left, y], [left + length_px, y], [left + length_px, y - 6]]
    canvas.polyline(np.array(ends), INK, 2)
    canvas.text((left + length_px / 2, y - 10), f"{length_m:g} m", 17, align=Align.MIDDLE)


def _draw_north(canvas: Canvas, box: Box) -> None:
    x, y = box.right - 42.0, box.y + 44.0
    canvas.dot((x, y), 26.0, SHADOW)
    canvas.polyline(np.array([[x, y + 14], [x, y - 10]]), DIM_INK, 2)
    canvas.polyline(np.array([[x - 5, y - 4], [x, y - 11], [x + 5, y - 4]]), DIM_INK, 2)
    canvas.text((x, y - 15), "N", 12, INK, align=Align.MIDDLE, is_bold=True)


def nice_length_m(about_m: float) -> float:
    """Choose 1, 2 or 5 times a power of ten, at most `about_m` [m]."""
    power = 10.0 ** math.floor(math.log10(about_m))
    return max(step * power for step in (1.0, 2.0, 5.0) if step * power <= about_m * (1 + 1e-9))
