"""How long a camera exposes and how much it amplifies, and how its automatic finds that out, frame by frame."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.clock import NS_PER_S

SUNNY_S = 0.0003
"""The exposure time [s] at gain 1 that shows a white sheet in a clear noon's light just white.

The sunny 16 rule for a lens of f/2.8 at ISO 100: 1 / 100 s * (2.8 / 16)^2.
"""

_LUMINANCE_BGR = (0.0722, 0.7152, 0.2126)  # ITU-R BT.709
_CORNER_WEIGHT = 0.3
_N_ROUNDS = 30
_DARKEST = 1e-4  # what is metered counts as no less, so that one look into the dark cannot throw the exposure away


@dataclass(frozen=True, slots=True)
class Exposure:
    """Exposure time [s], and analogue gain from 1 on."""

    time_s: float
    gain: float = 1.0

    @property
    def scale(self) -> float:
        """What linear light, in units of a clear noon's white, is multiplied with to give the sensor's signal."""
        return self.time_s / SUNNY_S * self.gain


SUNNY = Exposure(SUNNY_S)
"""The exposure for a clear noon."""


@dataclass(frozen=True, slots=True)
class AutoExposure:
    """How a camera's automatic works; the default is that of a small machine vision camera set up for flight.

    It brings the mean of the picture, the middle counting more, to `target` of white in linear light. It lengthens the
    exposure up to `longest_s`, which keeps motion blur small, and only then amplifies, up to `most_gain`. A step in
    the light is down to 1 / e of itself, as a ratio, after `time_constant_s`. Raises ValueError for limits that
    contradict each other.
    """

    target: float = 0.18
    shortest_s: float = 0.00005
    longest_s: float = 0.008
    most_gain: float = 16.0
    time_constant_s: float = 0.15

    def __post_init__(self) -> None:
        if not 0.0 < self.target < 1.0:
            raise ValueError(f"An automatic exposure aims between 0 and 1, not at {self.target}.")
        if not (0.0 < self.shortest_s <= self.longest_s and self.most_gain >= 1.0 and self.time_constant_s > 0.0):
            raise ValueError("An automatic exposure needs 0 < shortest_s <= longest_s, a gain of 1 or more and a time.")

    def split(self, scale: float) -> Exposure:
        """The exposure nearest to a scale (Exposure.scale) within the limits: as much time as allowed, then gain."""
        time_s = min(max(scale * SUNNY_S, self.shortest_s), self.longest_s)
        gain = min(max(scale * SUNNY_S / time_s, 1.0), self.most_gain)
        return Exposure(time_s, gain)


class ExposureMeter:
    """Follows the light from frame to frame; what it chooses depends on the frames shown to it alone.

    `exposure` is the one for the next frame, None before the first.
    """

    def __init__(self, automatic: AutoExposure | None = None) -> None:
        self._automatic = AutoExposure() if automatic is None else automatic
        self._t_ns: int | None = None
        self.exposure: Exposure | None = None

    def settle(self, light: NDArray[np.float32], t_ns: int) -> Exposure:
        """Choose at once the exposure that a camera would come to, that looks at `light` for long."""
        exposure = self._automatic.split(1.0)
        for _ in range(_N_ROUNDS):  # a picture burnt out at first tells only by and by how bright it is
            exposure = self._automatic.split(exposure.scale * self._ratio(light, exposure))
        self.exposure, self._t_ns = exposure, t_ns
        return exposure

    def follow(self, light: NDArray[np.float32], t_ns: int) -> Exposure:
        """Look at a frame taken at `t_ns` with `exposure`, and choose that of the next one.

        `light` is (height, width, 3) float32 linear BGR as it falls on the sensor, or evenly spread samples of it.
        """
        if self.exposure is None or self._t_ns is None:
            return self.settle(light, t_ns)
        part = -math.expm1(-max(0, t_ns - self._t_ns) / NS_PER_S / self._automatic.time_constant_s)
        ratio = self._ratio(light, self.exposure) ** part
        self.exposure, self._t_ns = self._automatic.split(self.exposure.scale * ratio), t_ns
        return self.exposure

    def _ratio(self, light: NDArray[np.float32], exposure: Exposure) -> float:
        """By what the exposure is short of the target; what is over white counts as white, as a sensor sees it."""
        signal = np.minimum(exposure.scale * (light @ np.array(_LUMINANCE_BGR, dtype=np.float32)), 1.0)
        return self._automatic.target / max(_DARKEST, float(np.average(signal, weights=_weights(*signal.shape))))


def _weights(n_rows: int, n_columns: int) -> NDArray[np.float64]:
    """How much each sample counts: 1 in the middle, falling to the corners."""
    y, x = np.linspace(-1.0, 1.0, n_rows)[:, None], np.linspace(-1.0, 1.0, n_columns)[None, :]
    return 1.0 - (1.0 - _CORNER_WEIGHT) * 0.5 * (x**2 + y**2)
