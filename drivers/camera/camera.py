"""The camera protocol, and the records that every camera speaks in."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import TracebackType
from typing import Literal, Protocol, Self

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


Lens = Literal["pinhole", "fisheye"]
N_COEFFICIENTS: Mapping[Lens, int] = {"pinhole": 5, "fisheye": 4}
"""How many numbers describe a lens' distortion, in OpenCV's order: k1 k2 p1 p2 k3, or k1 k2 k3 k4."""


@dataclass(frozen=True, slots=True)
class Intrinsics:
    """How a camera maps rays to pixels: image size, focal lengths and principal point [px], and its lens' distortion.

    Camera frame: x right, y down, z forward. `lens` names OpenCV's model that `distortion` belongs to: the plain one
    (Brown-Conrady), or the fisheye one (Kannala-Brandt) for lenses with strong distortion. Raises ValueError for
    what describes no camera.
    """

    width_px: int
    height_px: int
    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    distortion: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0, 0.0)
    lens: Lens = "pinhole"

    def __post_init__(self) -> None:
        if not (self.width_px > 0 and self.height_px > 0 and self.fx_px > 0 and self.fy_px > 0):
            raise ValueError("a camera's image size and focal lengths are positive")
        if len(self.distortion) != N_COEFFICIENTS[self.lens]:
            raise ValueError(
                f"a {self.lens} lens has {N_COEFFICIENTS[self.lens]} distortion coefficients, "
                f"not {len(self.distortion)}"
            )
        if not all(map(math.isfinite, (self.fx_px, self.fy_px, self.cx_px, self.cy_px, *self.distortion))):
            raise ValueError("a camera's intrinsics are finite numbers")

    @property
    def is_distorted(self) -> bool:
        """Whether straight lines may be bent in the image."""
        return self.lens == "fisheye" or any(self.distortion)

    @property
    def matrix(self) -> NDArray[np.float64]:
        """OpenCV's camera matrix, (3, 3) [px]."""
        return np.array([[self.fx_px, 0.0, self.cx_px], [0.0, self.fy_px, self.cy_px], [0.0, 0.0, 1.0]])


@dataclass(frozen=True, slots=True)
class CameraSettings:
    """What we ask of a camera. A camera that answers with something else raises CameraError when opened.

    `pixel_format` is V4L2's four characters such as YUYV or MJPG; None takes raw frames where they are fast enough,
    else JPEG. `controls` are set in this order, by the names that `lineflight camera show` prints, such as
    ("auto_exposure", 1), ("exposure_time_absolute", 20). Both are for V4L2 alone.
    """

    width_px: int
    height_px: int
    rate_hz: float
    pixel_format: str | None = None
    controls: tuple[tuple[str, int], ...] = ()


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
