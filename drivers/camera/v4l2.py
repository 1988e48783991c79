"""A V4L2 camera (a USB camera on Linux), read through OpenCV by a thread that never lets frames queue up."""

import threading
import time
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Protocol, Self

import cv2
import numpy as np

from drivers.camera.camera import CameraError, CameraLost, CameraSettings, Frame
from drivers.camera.mailbox import Mailbox
from drivers.camera.v4l2_device import set_controls
from drivers.clock import NS_PER_S, ScaledClock

# Raw first: JPEG's blocks eat conductors that are thinner than a pixel. Many USB cameras reach larger sizes at full
# rate only as MJPG, though.
_PIXEL_FORMATS = ("YUYV", "MJPG")
_RATE_TOLERANCE = 0.1
_OLDEST_STAMP_NS = 1 * NS_PER_S
_JOIN_TIMEOUT_S = 2.0


class Capture(Protocol):
    """The part of cv2.VideoCapture that is used here."""

    def isOpened(self) -> bool: ...  # noqa: D102, N802

    def set(self, propId: int, value: float) -> bool: ...  # noqa: D102, N803

    def get(self, propId: int) -> float: ...  # noqa: D102, N803

    def grab(self) -> bool: ...  # noqa: D102

    def retrieve(self) -> tuple[bool, cv2.typing.MatLike]: ...  # noqa: D102

    def release(self) -> None: ...  # noqa: D102


class V4l2Camera:
    """An opened V4L2 device; see `open_v4l2`.

    A grabber thread takes every frame as it comes, so that the driver's queue stays empty and the newest frame is never
    older than one period.
    """

    def __init__(self, capture: Capture, device: Path, settings: CameraSettings, clock: ScaledClock) -> None:
        self._capture = capture
        self._device = device
        self._settings = settings
        self._clock = clock
        self._mailbox: Mailbox[Frame] = Mailbox()
        self._stop = threading.Event()
        self._grabber = threading.Thread(target=self._grab, name=f"grab {device}", daemon=True)

    def read(self, timeout_s: float) -> Frame | None:
        """Wait for a frame that was not returned before; None after `timeout_s` [s, wall].

        `t_capture_ns` is the driver's own stamp. Raises CameraLost when the device is gone.
        """
        return self._mailbox.get(timeout_s)

    def __enter__(self) -> Self:
        self._grabber.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stop.set()
        self._grabber.join(_JOIN_TIMEOUT_S)

    def _grab(self) -> None:
        # The thread releases the device itself: a grab that hangs on an unplugged camera may outlive __exit__.
        try:
            seq = 0
            while not self._stop.is_set():
                is_read = self._capture.grab()
                t_capture_ns = self._capture_time_ns()
                if is_read:
                    is_read, image = self._capture.retrieve()
                if not is_read:
                    raise CameraLost(f"The camera {self._device} stopped giving frames; check its cable.")
                if image.shape[:2] != (self._settings.height_px, self._settings.width_px):
                    raise CameraError(f"The camera {self._device} changed its size to {image.shape[1::-1]} in flight.")
                frame = np.asarray(image, dtype=np.uint8)
                frame.setflags(write=False)
                self._mailbox.put(Frame(seq, t_capture_ns, frame))
                seq += 1
        except CameraError as error:
            self._mailbox.close(error)
        except Exception as error:  # a thread that ends silently would look like the end of a recording
            self._mailbox.close(CameraError(f"The camera {self._device} failed: {error}"))
        finally:
            self._mailbox.close()
            self._capture.release()

    def _capture_time_ns(self) -> int:
        """Flight time [ns] of the frame just grabbed."""
        # V4L2 stamps buffers by CLOCK_MONOTONIC, when the first or the last of the frame came in: the middle of the
        # exposure is less than a period away. A driver that does not stamp leaves 0 or another clock's time there.
        stamp_ns = round(self._capture.get(cv2.CAP_PROP_POS_MSEC) * 1e6)
        if not 0 <= time.monotonic_ns() - stamp_ns <= _OLDEST_STAMP_NS:
            return self._clock.now_ns()
        return self._clock.epoch_ns + round((stamp_ns - self._clock.epoch_ns) * self._clock.speed)


def _connect(device: Path) -> Capture:
    return cv2.VideoCapture(str(device), cv2.CAP_V4L2)


def open_v4l2(
    device: Path, settings: CameraSettings, clock: ScaledClock, connect: Callable[[Path], Capture] = _connect
) -> V4l2Camera:
    """Open a V4L2 device such as /dev/video0 and make it give what `settings` ask for.

    `connect` makes the capture. Raises CameraError when the device is missing, busy, gives another size or format or a
    lower rate than asked for, or does not take a control's value.
    """
    if not device.exists():
        raise CameraError(f"There is no camera at {device}; plug it in, or name another (lineflight camera list).")
    capture = connect(device)
    if not capture.isOpened():
        raise CameraError(f"The camera {device} cannot be opened; end the program that uses it, or name another.")
    answers = []
    for pixel_format in _PIXEL_FORMATS if settings.pixel_format is None else (settings.pixel_format,):
        capture.set(cv2.CAP_PROP_FOURCC, cv2.VideoWriter.fourcc(*pixel_format))
        capture.set(cv2.CAP_PROP_FRAME_WIDTH, settings.width_px)
        capture.set(cv2.CAP_PROP_FRAME_HEIGHT, settings.height_px)
        capture.set(cv2.CAP_PROP_FPS, settings.rate_hz)
        width_px, height_px = (
            round(capture.get(cv2.CAP_PROP_FRAME_WIDTH)),
            round(capture.get(cv2.CAP_PROP_FRAME_HEIGHT)),
        )
        rate_hz = capture.get(cv2.CAP_PROP_FPS)
        # Asked for a format that the camera lacks, OpenCV takes one of its own choice.
        given = (int(capture.get(cv2.CAP_PROP_FOURCC)) & 0xFFFFFFFF).to_bytes(4, "little").decode(errors="replace")
        # A driver that does not know its rate says 0.
        is_fast_enough = rate_hz <= 0 or rate_hz >= settings.rate_hz * (1 - _RATE_TOLERANCE)
        is_as_asked = settings.pixel_format in (None, given)
        if (width_px, height_px) == (settings.width_px, settings.height_px) and is_fast_enough and is_as_asked:
            try:
                # By a file of our own: OpenCV knows only some of the controls, and rescales some of those.
                if settings.controls:
                    set_controls(device, settings.controls)
            except CameraError:
                capture.release()
                raise
            return V4l2Camera(capture, device, settings, clock)
        answers.append(f"{width_px} x {height_px} px at {rate_hz:g} Hz as {given}")
    capture.release()
    asked = f"{settings.width_px} x {settings.height_px} px at {settings.rate_hz:g} Hz"
    asked += "" if settings.pixel_format is None else f" as {settings.pixel_format}"
    raise CameraError(
        f"The camera {device} was asked for {asked} but gives {' and '.join(answers)}; ask for what it has "
        f"(lineflight camera show v4l2:{device})."
    )
