"""The camera protocol, and the records that every camera speaks in."""

from dataclasses import dataclass
from types import TracebackType
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray


class CameraError(Exception):
    """The camera could not be opened or read; the message is one sentence for a person."""


class CameraLost(CameraError):
    """A camera that gave frames gives none any more: it may be worth opening it again."""


@dataclass(frozen=True, slots=True)
class Frame:
    """One image and when it was taken.

    `seq` counts the camera's frames from 0, the dropped ones included. `t_capture_ns` is flight time (drivers.clock)
    at the middle of the exposure. `image` is read-only, (height, width) grey or (height, width, 3) BGR, uint8.
    """

    seq: int
    t_capture_ns: int
    image: NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class Intrinsics:
    """A pinhole camera: focal lengths and principal point [px], image size [px], OpenCV's distortion k1 k2 p1 p2 k3.

    Camera frame: x right, y down, z forward.
    """

    width_px: int
    height_px: int
    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class CameraSettings:
    """What we ask of a camera. A camera that answers with another size raises CameraError when opened."""

    width_px: int
    height_px: int
    rate_hz: float


class Camera(Protocol):
    """A source of frames. The newest frame wins: what was not read in time is dropped and shows as a gap in `seq`.

    Use it as a context manager; leaving it releases the device.
    """

    def read(self, timeout_s: float) -> Frame | None:
        """Wait for a frame that was not returned before, and return the newest; None after `timeout_s` [s, wall].

        Raises EOFError when a finite source has ended, CameraLost when the device is gone, CameraError when what it
        gives cannot be used.
        """
        ...

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...
