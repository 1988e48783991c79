"""A strip chart: one quantity against time, with the tasks' times shaded behind it."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mission.log.canvas import DIM_INK, RULE, Align, Box, Canvas, Color

Floats = NDArray[np.float64]

_MARGIN_LEFT_PX = 64
_MARGIN_RIGHT_PX = 18
_TITLE_PX = 44
_AXIS_PX = 28
_GAP_S = 0.5


@dataclass(frozen=True, slots=True)
class Strip:
    """What a chart shows: values (n,) at times (n,) [s], over `start_s` to `end_s`, with `bands` [s] shaded.

    The scale reaches to `least_limit` either way at least, so that noise does not look like trouble.
    """

    title: str
    unit: str
    times_s: Floats
    values: Floats
    start_s: float
    end_s: float
    bands: tuple[tuple[float, float], ...]
    least_limit: float
    color: Color


def draw_strip(canvas: Canvas, box: Box, strip: Strip, *, has_time_axis: bool) -> None:
    """Draw a chart into `box`, symmetric about zero; times are written below where `has_time_axis`."""
    canvas.panel(box)
    canvas.text((box.x + 18, box.y + 25), strip.title, 17, is_bold=True)
    bottom_px = _AXIS_PX if has_time_axis else 14
    plot = Box(
        box.x + _MARGIN_LEFT_PX,
        box.y + _TITLE_PX,
        box.width - _MARGIN_LEFT_PX - _MARGIN_RIGHT_PX,
        box.height - _TITLE_PX - bottom_px,
    )
    reach = float(np.percentile(np.abs(strip.values), 99.5)) if strip.values.size else 0.0
    limit = nice_limit(max(reach, strip.least_limit))
    px_per_s = plot.width / max(strip.end_s - strip.start_s, 1e-9)

    def x_px(time_s: float) -> float:
        return plot.x + (time_s - strip.start_s) * px_per_s

    for band_start_s, band_end_s in strip.bands:
        left, right = round(x_px(band_start_s)), round(x_px(band_end_s))
        if right > left:
            canvas.panel(Box(left, plot.y, right - left, plot.height), strip.color, opacity=0.10, radius_px=0)
    for share, words in ((0.0, f"{limit:g}"), (0.5, "0"), (1.0, f"-{limit:g}")):
        y = plot.y + share * plot.height
        canvas.polyline(np.array([[plot.x, y], [plot.right, y]]), RULE, 1)
        canvas.text((plot.x - 10, y + 5), words, 15, DIM_INK, align=Align.RIGHT)
    canvas.text((box.right - 18, box.y + 25), strip.unit, 15, DIM_INK, align=Align.RIGHT)
    if has_time_axis:
        step_s = nice_limit(max((strip.end_s - strip.start_s) / 8, 1e-3))
        for time_s in np.arange(math.ceil(strip.start_s / step_s) * step_s, strip.end_s + 1e-9, step_s).tolist():
            canvas.text((x_px(time_s), box.bottom - 9), f"{time_s:g} s", 15, DIM_INK, align=Align.MIDDLE)
    if not strip.values.size:
        canvas.text(
            (plot.x + plot.width / 2, plot.y + plot.height / 2 - 8), "no values", 15, DIM_INK, align=Align.MIDDLE
        )
        return
    xs = plot.x + (strip.times_s - strip.start_s) * px_per_s
    ys = plot.y + plot.height / 2 * (1 - strip.values / limit)
    breaks = np.flatnonzero(np.diff(strip.times_s) > _GAP_S) + 1
    for piece in np.split(np.column_stack([xs, ys]), breaks):
        canvas.polyline(piece, strip.color, 2, plot)


def nice_limit(about: float) -> float:
    """Choose 1, 2 or 5 times a power of ten, at least `about`."""
    power = 10.0 ** math.floor(math.log10(about))
    return min(step * power for step in (1.0, 2.0, 5.0, 10.0) if step * power >= about * (1 - 1e-9))
