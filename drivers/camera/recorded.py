"""A recording as a camera: a video, images, or the frames of a flight log, played at its own pace."""

import itertools
import time
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Protocol, Self

import cv2
import numpy as np
from numpy.typing import NDArray

from drivers.camera.camera import CameraError, CameraSettings, Frame
from drivers.clock import NS_PER_S, Clock
from drivers.mcap_stream import IMAGE_DATA_FIELD, IMAGE_TOPIC, bytes_field, open_messages

_N_GLANCES = 50  # frames of a log that tell its rate

IMAGE_SUFFIXES = frozenset({".bmp", ".jpeg", ".jpg", ".pgm", ".png", ".ppm", ".tif", ".tiff", ".webp"})


class Recording(Protocol):
    """Images in order, which can be skipped cheaply."""

    def skip(self) -> bool:
        """Pass over the next image; False at the end."""
        ...

    def read(self) -> NDArray[np.uint8] | None:
        """Decode the next image, (h, w, 3) BGR; None at the end. Raises CameraError when it cannot be decoded."""
        ...

    def rate_hz(self) -> float | None:
        """How many images a second it was taken at; None where it does not say. May pass over images."""
        ...

    def close(self) -> None:
        """Let go of the files."""
        ...


class ImageFiles:
    """Image files in the order given."""

    def __init__(self, paths: list[Path]) -> None:
        self._paths = iter(paths)

    def skip(self) -> bool:
        """Pass over the next image; False at the end."""
        return next(self._paths, None) is not None

    def read(self) -> NDArray[np.uint8] | None:
        """Decode the next image, (h, w, 3) BGR; None at the end. Raises CameraError when it cannot be decoded."""
        path = next(self._paths, None)
        if path is None:
            return None
        image = cv2.imread(str(path), cv2.IMREAD_COLOR)
        if image is None:
            raise CameraError(f"The image {path} cannot be decoded; remove it from the recording.")
        return np.asarray(image, dtype=np.uint8)

    def rate_hz(self) -> float | None:
        """Image files do not say."""
        return None

    def close(self) -> None:
        """Nothing stays open between two images."""


class VideoFile:
    """A video, by whatever OpenCV decodes it with."""

    def __init__(self, capture: cv2.VideoCapture) -> None:
        self._capture = capture

    def skip(self) -> bool:
        """Pass over the next image; False at the end."""
        return self._capture.grab()

    def read(self) -> NDArray[np.uint8] | None:
        """Decode the next image, (h, w, 3) BGR; None at the end."""
        is_read, image = self._capture.read()
        return np.asarray(image, dtype=np.uint8) if is_read else None

    def rate_hz(self) -> float | None:
        """What the container says."""
        rate_hz = self._capture.get(cv2.CAP_PROP_FPS)
        return rate_hz if rate_hz > 0 else None

    def close(self) -> None:
        """Let go of the file."""
        self._capture.release()


class LoggedImages:
    """The frames that a flight log kept, in order."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._file = path.open("rb")
        try:
            self._messages = open_messages(self._file)
        except ValueError:
            self._file.close()
            raise

    def skip(self) -> bool:
        """Pass over the next image; False at the end."""
        return self._next() is not None

    def read(self) -> NDArray[np.uint8] | None:
        """Decode the next image, (h, w, 3) BGR; None at the end. Raises CameraError when it cannot be decoded."""
        found = self._next()
        if found is None:
            return None
        try:
            jpeg = np.frombuffer(bytes_field(found[1], IMAGE_DATA_FIELD), dtype=np.uint8)
            image = cv2.imdecode(jpeg, cv2.IMREAD_COLOR) if jpeg.size else None
        except (KeyError, IndexError):  # no protobuf: another program's log
            image = None
        if image is None:
            raise CameraError(f"The log {self._path} holds a frame that cannot be decoded.")
        return np.asarray(image, dtype=np.uint8)

    def rate_hz(self) -> float | None:
        """The rate at which the next frames were kept."""
        times_ns = [found[0] for found in itertools.islice(iter(self._next, None), _N_GLANCES) if found is not None]
        return NS_PER_S / max(1.0, float(np.median(np.diff(times_ns)))) if len(times_ns) > 1 else None

    def close(self) -> None:
        """Let go of the file."""
        self._file.close()

    def _next(self) -> tuple[int, bytes] | None:
        try:
            return next(((t_ns, body) for topic, t_ns, body in self._messages if topic == IMAGE_TOPIC), None)
        except Exception as error:  # the decompressor and the parser each have their own
            raise CameraError(
                f"The log {self._path} is damaged ({type(error).__name__}: {error}); recover it with mcap."
            ) from error


class RecordedCamera:
    """Plays a recording against the clock: frame i is taken i periods after the first read began.

    Like a live camera it does not wait for a slow reader: frames whose time has passed are skipped, and show as a gap
    in `seq`. Time starts with the first read, so that opening early costs no frames.
    """

    def __init__(
        self,
        recording: Recording,
        settings: CameraSettings,
        clock: Clock,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._recording = recording
        self._settings = settings
        self._period_ns = round(NS_PER_S / settings.rate_hz)
        self._clock = clock
        self._sleep = sleep
        self._start_ns: int | None = None
        self._next_seq = 0

    def read(self, timeout_s: float) -> Frame | None:
        """Wait for the next frame's time and return it, or the newest that is due; None after `timeout_s` [s, wall].

        Raises EOFError at the recording's end, CameraError when an image is damaged or of another size.
        """
        now_ns = self._clock.now_ns()
        if self._start_ns is None:
            self._start_ns = now_ns
        wait_s = self._clock.wall_s((self._start_ns + self._next_seq * self._period_ns - now_ns) / NS_PER_S)
        if wait_s > timeout_s:
            self._sleep(timeout_s)
            return None
        if wait_s > 0:
            self._sleep(wait_s)
        newest = max(self._next_seq, (self._clock.now_ns() - self._start_ns) // self._period_ns)
        while self._next_seq < newest and self._recording.skip():
            self._next_seq += 1
        image = self._recording.read()
        if image is None:
            raise EOFError("The recording has ended.")
        check_size(image, self._settings)
        image.setflags(write=False)
        frame = Frame(self._next_seq, self._start_ns + self._next_seq * self._period_ns, image)
        self._next_seq += 1
        return frame

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._recording.close()


def open_recording(path: Path, settings: CameraSettings, clock: Clock) -> RecordedCamera:
    """Open a video, an image, a folder of images (in the order of their names), or a flight log (.mcap).

    A video plays at the rate it was taken at, a log at that which its frames were kept at, images at
    `settings.rate_hz`. Raises CameraError when there is no such file, nothing in it can be decoded, or its size is not
    the one of `settings`.
    """
    glance = _open(path)
    try:
        first = glance.read()
        if first is None:
            raise CameraError(f"The recording {path} holds no frames.")
        check_size(first, settings)
        rate_hz = glance.rate_hz() or settings.rate_hz
    finally:
        glance.close()
    # A fresh one starts at the first frame for certain; seeking back is not exact in every container.
    return RecordedCamera(_open(path), CameraSettings(settings.width_px, settings.height_px, rate_hz), clock)


def recording_size_px(path: Path) -> tuple[int, int]:
    """Width and height of a recording's first image. Raises CameraError as open_recording does."""
    recording = _open(path)
    try:
        first = recording.read()
    finally:
        recording.close()
    if first is None:
        raise CameraError(f"The recording {path} holds no frames.")
    return first.shape[1], first.shape[0]


def check_size(image: NDArray[np.uint8], settings: CameraSettings) -> None:
    """Raise CameraError when `image`, (h, w, ...), is not of the size that was asked for."""
    height_px, width_px = image.shape[:2]
    if (width_px, height_px) != (settings.width_px, settings.height_px):
        raise CameraError(
            f"The recording is {width_px} x {height_px} px but the camera settings ask for "
            f"{settings.width_px} x {settings.height_px} px; change the settings or rescale the recording."
        )


def _open(path: Path) -> Recording:
    """The recording at `path`, from its start. Raises CameraError where there is none."""
    suffix = path.suffix.lower()
    if path.is_dir():
        try:
            paths = sorted(entry for entry in path.iterdir() if entry.suffix.lower() in IMAGE_SUFFIXES)
        except OSError as error:
            raise CameraError(f"The folder {path} cannot be read: {error.strerror}.") from None
        if not paths:
            raise CameraError(f"The folder {path} holds no images; name a folder with .png or .jpg files.")
        return ImageFiles(paths)
    if not path.exists():
        raise CameraError(f"There is no recording at {path}; check the path behind 'file:'.")
    if suffix in IMAGE_SUFFIXES:
        return ImageFiles([path])
    if suffix == ".mcap":
        try:
            return LoggedImages(path)
        except (OSError, ValueError) as error:
            raise CameraError(f"The log {path} cannot be read: {error}.") from None
    capture = cv2.VideoCapture(str(path))
    if not capture.isOpened():
        raise CameraError(f"The file {path} is neither an image nor a video that can be decoded; convert it first.")
    return VideoFile(capture)
