"""The frames that a page shows: as many and as large as its size allows, with the lines that were found on them."""

import base64
import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from drivers.clock import NS_PER_S
from mission.log.page.thinning import evenly
from mission.log.reader import Flight, read_images
from vision.records import VisionReport

BUDGET_BYTES = 5_200_000
"""For all JPEGs of a page; as text in the page they take a third more."""

MOST_FRAMES = 600
_N_TRIED = 12


@dataclass(frozen=True, slots=True)
class _Size:
    width_px: int
    quality: int


_SIZES = (_Size(640, 75), _Size(640, 60), _Size(480, 60), _Size(400, 50), _Size(320, 50))


def page_frames(flight: Flight, start_ns: int) -> list[dict[str, Any]]:
    """Each frame chosen: its time [s from the start], its JPEG as base64, and what vision said about it.

    Raises LogError when the log cannot be read any more.
    """
    reports = {report.t_capture_ns: report for report in flight.reports if report.t_capture_ns in flight.image_times_ns}
    times_ns = list(reports)
    wanted = {times_ns[k] for k in evenly(len(times_ns), MOST_FRAMES).tolist()}
    jpegs = sorted((t_ns, jpeg) for t_ns, jpeg in read_images(flight) if t_ns in wanted) if wanted else []
    size, n_frames = _choose([jpeg for _, jpeg in jpegs])
    frames = []
    for k in evenly(len(jpegs), n_frames).tolist():
        t_ns, jpeg = jpegs[k]
        small = _shrink(jpeg, size)
        if small is not None:
            frames.append(_entry(reports[t_ns], *small, (t_ns - start_ns) / NS_PER_S))
    return frames


def _choose(jpegs: list[bytes]) -> tuple[_Size, int]:
    """The largest size at which all frames fit, told by trying some of them; fewer frames where none does."""
    tried = [jpegs[k] for k in evenly(len(jpegs), _N_TRIED).tolist()]
    n_bytes = 1.0
    for size in _SIZES:
        lengths = [len(small[0]) for jpeg in tried if (small := _shrink(jpeg, size)) is not None]
        n_bytes = max(1.0, sum(lengths) / max(1, len(lengths)))
        if n_bytes * len(jpegs) <= BUDGET_BYTES:
            return size, len(jpegs)
    return _SIZES[-1], int(BUDGET_BYTES / n_bytes)


def _shrink(jpeg: bytes, size: _Size) -> tuple[bytes, float] | None:
    """The frame no wider than wanted, and by how much it was scaled; None for what is no image."""
    image = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)
    if image is None:
        return None
    scale = min(1.0, size.width_px / image.shape[1])
    if scale < 1.0:
        image = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    return cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, size.quality])[1].tobytes(), scale


def _entry(report: VisionReport, jpeg: bytes, scale: float, t_s: float) -> dict[str, Any]:
    estimate = report.estimate
    return {
        "t": round(t_s, 3),
        "jpeg": base64.b64encode(jpeg).decode(),
        "lines": np.round(report.power_lines * scale, 1).tolist(),
        "angle_deg": None if estimate is None else round(math.degrees(estimate.angle_rad), 2),
        "offset_px": None if estimate is None else round(estimate.offset_px, 1),
        "n_lines": 0 if estimate is None else estimate.n_lines,
        "trouble": None if report.trouble is None else str(report.trouble),
        "track": str(report.track),
        "latency_ms": round(report.latency_ns / 1e6, 1),
    }
