"""What `lineflight camera` does beside listing: watch a camera for a moment, calibrate one."""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from drivers.camera.calibration import Board, BoardFinder, Calibration, View, calibrate
from drivers.camera.camera import Camera, CameraError, Frame, Lens
from drivers.camera.recorded import IMAGE_SUFFIXES
from drivers.clock import ScaledClock
from mission.detect import draw
from vision.frame_check import FrameCheck, FrameCheckSettings
from vision.pipeline import LineFinder, VisionSettings
from vision.records import Trouble

_READ_TIMEOUT_S = 5.0


@dataclass(frozen=True, slots=True)
class Viewing:
    """What a camera gave in a moment.

    `rate_hz` is that of the frames' capture times; `ages_ms` how old each was when it was read; `level` the mean grey
    level of the last one; `trouble` what is wrong with it. `last` is None where no frame came.
    """

    n_frames: int
    n_dropped: int
    rate_hz: float | None
    ages_ms: tuple[float, ...]
    level: float
    trouble: Trouble | None
    last: Frame | None


def watch(camera: Camera, clock: ScaledClock, duration_s: float) -> Viewing:
    """Look at a camera for `duration_s` [s, wall] after its first frame, or until its recording ends.

    Raises CameraError when the camera fails.
    """
    check = FrameCheck(FrameCheckSettings())
    stamps_ns: list[int] = []
    ages_ms: list[float] = []
    n_dropped, trouble, last = 0, None, None
    end_s = time.monotonic() + _READ_TIMEOUT_S
    with camera:
        while time.monotonic() < end_s:
            try:
                frame = camera.read(max(0.0, end_s - time.monotonic()))
            except EOFError:
                break
            if frame is None:
                break
            if last is None:
                end_s = time.monotonic() + duration_s
            else:
                n_dropped += frame.seq - last.seq - 1
            last = frame
            stamps_ns.append(frame.t_capture_ns)
            ages_ms.append((clock.now_ns() - frame.t_capture_ns) / 1e6)
            trouble = check.trouble(frame.image, frame.t_capture_ns)
    span_s = (stamps_ns[-1] - stamps_ns[0]) / 1e9 if len(stamps_ns) > 1 else 0.0
    return Viewing(
        n_frames=len(stamps_ns),
        n_dropped=n_dropped,
        rate_hz=(len(stamps_ns) - 1 + n_dropped) / span_s if span_s > 0 else None,
        ages_ms=tuple(ages_ms),
        level=0.0 if last is None else float(last.image.mean()),
        trouble=trouble,
        last=last,
    )


def write_still(file: Path, frame: Frame, settings: VisionSettings) -> bool:
    """Draw what the line finder sees in a frame to an image file; whether it sees a power line. Raises CameraError."""
    image = frame.image if frame.image.ndim == 3 else np.repeat(frame.image[:, :, None], 3, axis=2)
    detection = LineFinder(settings).find(image)
    write_image(file, draw(image, detection))
    return detection.is_present


def write_image(file: Path, image: NDArray[np.uint8]) -> None:
    """Write an image, (h, w) or (h, w, 3) BGR, to a file of any kind that OpenCV knows. Raises CameraError."""
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        is_written, encoded = cv2.imencode(file.suffix or ".png", image)
        if is_written:
            file.write_bytes(encoded.tobytes())
    except (OSError, cv2.error) as error:
        raise CameraError(f"The image {file} cannot be written: {error}; name a .png or .jpg file.") from None


def board_photos(folder: Path) -> list[Path]:
    """The photographs in a folder, by name. Raises CameraError where there are none."""
    if not folder.is_dir():
        raise CameraError(f"There is no folder {folder}; name one with photographs of the board.")
    files = sorted(file for file in folder.iterdir() if file.suffix.lower() in IMAGE_SUFFIXES)
    if not files:
        raise CameraError(f"The folder {folder} holds no photographs; take some with lineflight camera show --keep.")
    return files


def calibrate_from(
    files: list[Path], board: Board, lens: Lens | None, tell: Callable[[Path, bool], None]
) -> tuple[Calibration, list[View]]:
    """Calibrate from photographs; `tell` hears of each whether the board was found in it.

    Raises CameraError for photographs of different sizes, and as drivers.camera.calibration does.
    """
    finder = BoardFinder(board)
    views: list[View] = []
    size: tuple[int, int] | None = None
    for file, image in _images(files):
        if size is None:
            size = (image.shape[1], image.shape[0])
        elif size != (image.shape[1], image.shape[0]):
            raise CameraError(
                f"{file} is {image.shape[1]} x {image.shape[0]} px, but the ones before are {size[0]} x {size[1]} px; "
                "a calibration is for one size."
            )
        view = finder.find(file.name, image)
        tell(file, view is not None)
        if view is not None:
            views.append(view)
    if size is None:
        raise CameraError("None of the photographs can be decoded.")
    return calibrate(views, *size, lens), views


def _images(files: list[Path]) -> Iterator[tuple[Path, NDArray[np.uint8]]]:
    for file in files:
        image = cv2.imread(str(file), cv2.IMREAD_GRAYSCALE)
        if image is not None:
            yield file, np.asarray(image, dtype=np.uint8)
