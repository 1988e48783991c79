"""Draw a flight on one page: the map, what the camera saw, and how well the line was followed."""

import math

import cv2
import numpy as np

from drivers.clock import NS_PER_S
from mission.log.canvas import ACCENT, BAD, DIM_INK, GOOD, PANEL, SHADOW, Align, Box, Canvas, Color, Image
from mission.log.flight_report import FlightReport
from mission.log.measures import nearest_on_axis, true_axis
from mission.log.reader import Flight
from mission.log.strip_chart import Strip, draw_strip
from mission.log.task_spans import FOLLOW_TASK, flight_start_ns
from mission.log.track_map import MapBackground, MapView, draw_map, map_view
from mission.log.wording import counted
from mission.records import Result
from vision.records import VisionReport

WIDTH_PX, HEIGHT_PX = 1600, 900
MAP_BOX = Box(28, 100, 840, 772)
_RIGHT_X, _RIGHT_WIDTH = 892, 680
_FRAME_GAP_PX = 16
_ANGLE_COLOR: Color = (214, 160, 250)
_OFFSET_COLOR: Color = (222, 196, 92)


def flight_view(flight: Flight) -> MapView:
    """Choose the ground that a flight's map will show, and at what scale."""
    return map_view(flight, MAP_BOX.width, MAP_BOX.height)


def draw_summary(flight: Flight, report: FlightReport, background: MapBackground | None) -> Image:
    """Draw a flight that was read with its images.

    `background` is a picture of the ground for the map, best of what `flight_view` tells; None draws a grid.
    Returns (900, 1600, 3) uint8 BGR.
    """
    canvas = Canvas(WIDTH_PX, HEIGHT_PX)
    _draw_heading(canvas, report)
    draw_map(canvas, MAP_BOX, flight, background)
    frames_bottom = _draw_frames(canvas, flight, report)
    _draw_strips(canvas, frames_bottom + 16, flight, report)
    return canvas.image


def _draw_heading(canvas: Canvas, report: FlightReport) -> None:
    minutes, seconds = divmod(round(report.duration_s), 60)
    canvas.text((28, 48), report.mission, 32, is_bold=True)
    color = GOOD if report.result == Result.COMPLETED else BAD
    width_px = canvas.text((28, 78), report.headline, 18, color, is_bold=True)
    words = f"{minutes}:{seconds:02d} min, {counted(len(report.tasks), 'task')}"
    canvas.text((28 + width_px + 12, 78), words, 18, DIM_INK)
    tiles = []
    if report.lateral is not None:
        tiles.append((f"{report.lateral.mean_m:.2f} m", "mean distance from the line"))
    elif report.legs:
        tiles.append((f"{report.legs[0].avg_error_m:.2f} m", "mean distance from a straight line"))
    if report.yaw_error is not None:
        tiles.append((f"{report.yaw_error.median_deg:.1f}°", "median heading error"))
    if report.vision.latency_ms is not None:
        tiles.append((f"{report.vision.latency_ms.p50:.0f} ms", "from frame to estimate"))
    if report.setpoints.rate_hz is not None:
        tiles.append((f"{report.setpoints.rate_hz:.0f} Hz", "setpoints"))
    right = WIDTH_PX - 28
    for figure, words in reversed(tiles):
        width_px = max(canvas.text_width(figure, 28, is_bold=True), canvas.text_width(words, 16))
        canvas.text((right, 50), figure, 28, align=Align.RIGHT, is_bold=True)
        canvas.text((right, 76), words, 16, DIM_INK, align=Align.RIGHT)
        right -= width_px + 36


def _draw_frames(canvas: Canvas, flight: Flight, report: FlightReport) -> int:
    """Draw up to two frames side by side; returns the row below them."""
    width_px = (_RIGHT_WIDTH - _FRAME_GAP_PX) // 2
    height_px = width_px * 3 // 4
    chosen = choose_frames(flight, report)
    for place in range(2):
        box = Box(_RIGHT_X + place * (width_px + _FRAME_GAP_PX), MAP_BOX.y, width_px, height_px)
        if place < len(chosen):
            _draw_frame(canvas, box, chosen[place], flight_start_ns(flight))
        else:
            canvas.panel(box, PANEL)
            canvas.text((box.x + width_px / 2, box.y + height_px / 2), "no frame", 17, DIM_INK, align=Align.MIDDLE)
    return MAP_BOX.y + height_px


def choose_frames(flight: Flight, report: FlightReport) -> list[VisionReport]:
    """Choose up to two frames that show power lines, from mid first leg and mid last leg, in time order."""
    shown = [seen for seen in flight.reports if seen.jpeg is not None]
    with_lines = [seen for seen in shown if len(seen.power_lines)] or shown
    if len(with_lines) < 2:
        return with_lines
    windows = _following_s(report)
    wanted_s = [windows[0], windows[-1]] if windows else [(0.0, report.duration_s)] * 2
    shares = (0.5, 0.5) if len(windows) > 1 else (0.33, 0.67)
    chosen: list[VisionReport] = []
    for (start_s, end_s), share in zip(wanted_s, shares, strict=True):
        wanted_ns = flight_start_ns(flight) + (start_s + share * (end_s - start_s)) * NS_PER_S
        left = [seen for seen in with_lines if all(seen is not other for other in chosen)]
        chosen.append(min(left, key=lambda seen: abs(seen.t_capture_ns - wanted_ns)))
    return sorted(chosen, key=lambda seen: seen.t_capture_ns)


def _draw_frame(canvas: Canvas, box: Box, seen: VisionReport, start_ns: int) -> None:
    frame = cv2.imdecode(np.frombuffer(seen.jpeg or b"", np.uint8), cv2.IMREAD_COLOR)
    if frame is None:
        return
    scale = max(box.width / frame.shape[1], box.height / frame.shape[0])
    # As much of the frame as fills the box, about its middle.
    shift_px = (np.array([box.width, box.height]) - np.array(frame.shape[1::-1]) * scale) / 2
    target_from_frame = np.array([[scale, 0.0, shift_px[0]], [0.0, scale, shift_px[1]]])
    shrunk = cv2.warpAffine(frame, target_from_frame, (box.width, box.height), flags=cv2.INTER_AREA)
    canvas.paste(box, np.asarray(shrunk, dtype=np.uint8))
    for line in seen.power_lines:
        ends = line.reshape(2, 2) * scale + shift_px + np.array([box.x, box.y])
        canvas.polyline(ends, SHADOW, 5, box)
        canvas.polyline(ends, ACCENT, 2, box)
    words = f"{(seen.t_capture_ns - start_ns) / NS_PER_S:.1f} s"
    if seen.estimate is not None:
        lines = "1 line" if seen.estimate.n_lines == 1 else f"{seen.estimate.n_lines} lines"
        words += f"   {lines} at {math.degrees(seen.estimate.angle_rad):+.1f}°"
    plate = Box(box.x + 10, box.bottom - 38, canvas.text_width(words, 16) + 20, 28)
    canvas.panel(plate, SHADOW, opacity=0.75, radius_px=8)
    canvas.text((plate.x + 10, plate.y + 20), words, 16)


def _draw_strips(canvas: Canvas, top: int, flight: Flight, report: FlightReport) -> None:
    windows = _following_s(report)
    start_s, end_s = (windows[0][0], windows[-1][1]) if windows else (0.0, report.duration_s)
    gap_px = 12
    height_px = (MAP_BOX.bottom - top - gap_px) // 2
    upper = Box(_RIGHT_X, top, _RIGHT_WIDTH, height_px)
    lower = Box(_RIGHT_X, MAP_BOX.bottom - height_px, _RIGHT_WIDTH, height_px)

    def strip(title: str, unit: str, values: list[tuple[int, float]], least_limit: float, color: Color) -> Strip:
        timed = np.array(
            [((t_ns - flight_start_ns(flight)) / NS_PER_S, value) for t_ns, value in values], dtype=np.float64
        ).reshape(-1, 2)
        is_shown = np.zeros(len(timed), dtype=np.bool_)
        for window_start_s, window_end_s in windows:
            is_shown |= (timed[:, 0] >= window_start_s) & (timed[:, 0] <= window_end_s)
        timed = timed[is_shown]
        return Strip(title, unit, timed[:, 0], timed[:, 1], start_s, end_s, tuple(windows), least_limit, color)

    estimates = [seen.estimate for seen in flight.reports if seen.estimate is not None]
    angles = [(estimate.t_capture_ns, math.degrees(estimate.angle_rad)) for estimate in estimates]
    draw_strip(
        canvas, upper, strip("Line in the image: angle", "degrees", angles, 5.0, _ANGLE_COLOR), has_time_axis=False
    )
    if flight.line is not None and flight.truth:
        points = np.array([(pose.north_m, pose.east_m) for pose in flight.truth])
        distance_m, _ = nearest_on_axis(points, true_axis(flight.line))
        distances = list(zip((pose.t_ns for pose in flight.truth), distance_m.tolist(), strict=True))
        lateral = strip("True distance from the line, right of it positive", "metres", distances, 0.5, _OFFSET_COLOR)
    else:
        offsets = [(estimate.t_capture_ns, estimate.offset_px) for estimate in estimates]
        lateral = strip("Line in the image: offset", "pixels", offsets, 20.0, _OFFSET_COLOR)
    draw_strip(canvas, lower, lateral, has_time_axis=True)


def _following_s(report: FlightReport) -> list[tuple[float, float]]:
    return [
        (task.start_s, report.duration_s if task.end_s is None else task.end_s)
        for task in report.tasks
        if task.task == FOLLOW_TASK
    ]
