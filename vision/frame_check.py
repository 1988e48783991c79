"""What is wrong with a frame, so that a line that is not seen has an explanation, and a frozen image never steers."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.clock import NS_PER_S
from vision.edges import is_image
from vision.records import Trouble

_SAMPLE_SIDE_PX = 40  # of the shorter side: enough pixels to judge, and looking at them takes no time


@dataclass(frozen=True, slots=True)
class FrameCheckSettings:
    """When a frame is called dark, overexposed, flat or frozen; levels are grey levels, shares those of all pixels."""

    dark_level: int = 16
    max_light_share: float = 0.01  # of pixels above dark_level in a dark frame
    bright_level: int = 250
    max_bright_share: float = 0.5
    min_deviation: float = 2.0
    frozen_after_s: float = 0.5  # and n_frozen frames
    n_frozen: int = 5


class FrameCheck:
    """Looks at one frame after the other. A sensor's noise makes every image new: one that stays the same is frozen."""

    def __init__(self, settings: FrameCheckSettings) -> None:
        self._settings = settings
        self._last: NDArray[np.uint8] | None = None
        self._same_since_ns = 0
        self._n_same = 0

    def trouble(self, image: NDArray[np.uint8], t_capture_ns: int) -> Trouble | None:
        """What is wrong with `image`, (h, w) or (h, w, 3) uint8, taken at `t_capture_ns`; None for a sound one."""
        settings = self._settings
        if not is_image(image):
            return Trouble.UNREADABLE
        stride = max(1, min(image.shape[:2]) // _SAMPLE_SIDE_PX)
        sample = image[::stride, ::stride].copy()
        if self._last is None or not np.array_equal(sample, self._last):
            self._same_since_ns, self._n_same = t_capture_ns, 0
        self._last = sample
        self._n_same += 1
        is_long = t_capture_ns - self._same_since_ns > settings.frozen_after_s * NS_PER_S
        if is_long and self._n_same >= settings.n_frozen:
            return Trouble.FROZEN
        if np.count_nonzero(sample >= settings.dark_level) <= settings.max_light_share * sample.size:
            return Trouble.DARK
        if np.count_nonzero(sample >= settings.bright_level) > settings.max_bright_share * sample.size:
            return Trouble.OVEREXPOSED
        if np.std(sample) < settings.min_deviation:
            return Trouble.FLAT
        return None
