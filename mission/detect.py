"""Find power lines in images, folders and videos: what `lineflight detect` does."""

import json
import math
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vision.pipeline import Detector, LineFinder, VisionSettings
from vision.records import Detection

IMAGE_SUFFIXES = {".bmp", ".jpeg", ".jpg", ".png", ".tif", ".tiff", ".webp"}
VIDEO_SUFFIXES = {".avi", ".m4v", ".mkv", ".mov", ".mp4", ".webm"}

_SEGMENT_BGR = (200, 160, 60)
_LINE_BGR = (40, 180, 255)


class DetectError(Exception):
    """There is nothing to look at; the message is one sentence for a person."""


@dataclass(frozen=True, slots=True)
class Picture:
    """An image to look at, BGR uint8, or None with why it could not be read. `frame` counts a video's frames from 0."""

    file: Path
    frame: int | None
    image: NDArray[np.uint8] | None
    failure: str | None = None


def read_pictures(source: Path) -> Iterator[Picture]:
    """The image, the folder's images in order of their names, or the video's frames. Raises DetectError."""
    if source.is_dir():
        files = sorted(file for file in source.iterdir() if file.suffix.lower() in IMAGE_SUFFIXES)
        if not files:
            raise DetectError(f"{source} holds no images ({', '.join(sorted(IMAGE_SUFFIXES))}).")
        yield from map(_read_image, files)
    elif not source.exists():
        raise DetectError(f"There is no file or folder {source}.")
    elif source.suffix.lower() in VIDEO_SUFFIXES:
        yield from _read_video(source)
    else:
        yield _read_image(source)


def detect(finder: LineFinder, picture: Picture) -> tuple[Detection, dict[str, Any]]:
    """Find the lines of a readable picture; also as the JSON object that `--json` prints."""
    if picture.image is None:
        raise ValueError("a picture that could not be read")
    begin_ns = time.perf_counter_ns()
    detection = finder.find(picture.image)
    elapsed_ms = (time.perf_counter_ns() - begin_ns) / 1e6
    height_px, width_px = picture.image.shape[:2]
    entry: dict[str, Any] = {"file": str(picture.file)}
    if picture.frame is not None:
        entry["frame"] = picture.frame
    entry |= {
        "width": width_px,
        "height": height_px,
        "segments": np.round(detection.segments, 2).tolist(),
        "power_lines": np.round(detection.power_lines, 2).tolist(),
        "angle_deg": None if detection.angle_rad is None else round(math.degrees(detection.angle_rad), 2),
        "offset_px": round(detection.offset_px, 2),
        "n_lines": detection.n_lines,
        "spacing_px": None if detection.spacing_px is None else round(detection.spacing_px, 2),
        "confidence": round(detection.confidence, 3),
        "present": detection.is_present,
        "elapsed_ms": round(elapsed_ms, 2),
    }
    return detection, entry


def draw(image: NDArray[np.uint8], detection: Detection) -> NDArray[np.uint8]:
    """A copy of the BGR image with its segments thin and its power lines bold."""
    canvas = image.copy()
    width_px = max(1, round(max(image.shape[:2]) / 500))
    for segments, colour, thickness_px in (
        (detection.segments, _SEGMENT_BGR, width_px),
        (detection.power_lines, _LINE_BGR, width_px + 1),
    ):
        for x1, y1, x2, y2 in segments:
            ends = (round(x1 * 8), round(y1 * 8)), (round(x2 * 8), round(y2 * 8))
            cv2.line(canvas, *ends, colour, thickness_px, cv2.LINE_AA, shift=3)
    return canvas


def _read_image(file: Path) -> Picture:
    try:
        raw = np.fromfile(file, dtype=np.uint8)
        image = cv2.imdecode(raw, cv2.IMREAD_COLOR) if raw.size else None
    except (OSError, cv2.error) as error:
        return Picture(file, None, None, f"{file} cannot be read: {error}.")
    if image is None:
        return Picture(file, None, None, f"{file} is not an image that OpenCV can read.")
    return Picture(file, None, np.asarray(image, dtype=np.uint8))


def _read_video(file: Path) -> Iterator[Picture]:
    video = cv2.VideoCapture(str(file))
    try:
        if not video.isOpened():
            raise DetectError(f"{file} is not a video that OpenCV can read.")
        index = 0
        while True:
            is_read, image = video.read()
            if not is_read:
                return
            yield Picture(file, index, np.asarray(image, dtype=np.uint8))
            index += 1
    finally:
        video.release()


def detect_all(source: Path, detector: Detector, *, as_json: bool, draw_to: Path | None) -> int:
    """Detect in all that `source` holds, print a line for each picture, draw; returns how many could not be read.

    `draw_to` is a file for a single image, else a folder, which is made. Raises DetectError.
    """
    finder = LineFinder(VisionSettings(detector=detector))
    finder.warm_up()
    is_single = source.is_file() and source.suffix.lower() not in VIDEO_SUFFIXES
    n_unreadable = 0
    for picture in read_pictures(source):
        if picture.image is None:
            n_unreadable += 1
            sys.stderr.write(f"{picture.failure}\n")
            continue
        detection, entry = detect(finder, picture)
        sys.stdout.write((json.dumps(entry) if as_json else _sentence(entry)) + "\n")
        if draw_to is not None:
            _write_drawing(draw_to if is_single else draw_to / _drawing_name(picture), draw(picture.image, detection))
    return n_unreadable


def _sentence(entry: dict[str, Any]) -> str:
    name = entry["file"] if "frame" not in entry else f"{entry['file']}#{entry['frame']}"
    if entry["angle_deg"] is None:
        return f"{name}: no segments, {entry['elapsed_ms']:.1f} ms"
    found = "power line" if entry["present"] else "no power line; the longest segments run"
    n_lines = len(entry["power_lines"])
    return f"{name}: {found} at {entry['angle_deg']:+.1f} degrees, {n_lines} segments, {entry['elapsed_ms']:.1f} ms"


def _drawing_name(picture: Picture) -> str:
    return f"{picture.file.stem}.png" if picture.frame is None else f"{picture.file.stem}-{picture.frame:06d}.png"


def _write_drawing(file: Path, image: NDArray[np.uint8]) -> None:
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        is_written, encoded = cv2.imencode(file.suffix or ".png", image)
        if is_written:
            file.write_bytes(encoded.tobytes())
    except (OSError, cv2.error) as error:
        raise DetectError(
            f"The drawing {file} cannot be written: {error}; name a .png or .jpg file or a folder."
        ) from None
