"""Wind: a constant mean with its profile, Dryden gusts by MIL-F-8785C's low-altitude model, and what else is asked for.

The same seed brings the same wind.
"""

import math
import random
from dataclasses import dataclass

from sitl.gust_front import GustFronts
from sitl.lee import Lee
from sitl.vehicle import Vector

_FEET_PER_M = 1 / 0.3048
_REFERENCE_HEIGHT_M = 20 * 0.3048  # W20 is the wind at 20 ft
_MOST_ROUGHER = 0.5  # turbulence in a lee is up to half as strong again (sitl.lee)

ROUGHNESS_M = 0.15 * 0.3048
"""The roughness length of MIL-F-8785C's profile near the ground [m]."""
COVER_ROUGHNESS_M = {
    "pasture": ROUGHNESS_M,
    "meadow": 0.03,
    "cropland": 0.10,
    "village": 0.50,
    "forest_floor": 1.0,
}
"""Roughness lengths by ground cover [m]: the Davenport classes (Wieringa, J. Wind Eng. 41, 1992), and a pasture's."""


@dataclass(frozen=True, slots=True)
class GustScales:
    """Dryden's lengths [m] and standard deviations [m/s] along (u), across (v) and vertical to (w) the mean wind."""

    length_u_m: float
    length_v_m: float
    length_w_m: float
    sigma_u_m_s: float
    sigma_v_m_s: float
    sigma_w_m_s: float


def gust_scales(height_m: float, wind_20ft_m_s: float) -> GustScales:
    """Scales of MIL-F-8785C 3.7.3 for a height over the ground [m] and the mean wind at 20 ft, W20 [m/s].

    The specification holds from 10 to 1000 ft; outside, its value at the nearer end is taken.
    """
    height_ft = min(max(height_m * _FEET_PER_M, 10.0), 1000.0)
    factor = 0.177 + 0.000823 * height_ft
    length_m = height_ft / factor**1.2 / _FEET_PER_M
    sigma_w_m_s = 0.1 * wind_20ft_m_s
    sigma_m_s = sigma_w_m_s / factor**0.4
    return GustScales(length_m, length_m, height_ft / _FEET_PER_M, sigma_m_s, sigma_m_s, sigma_w_m_s)


class _SecondOrder:
    """White noise through (1 + sqrt(3) T s) / (1 + T s)^2, Dryden's lateral and vertical form, of unit deviation.

    Two chained first-order lags, each advanced exactly over the step. For white noise that drives the first lag to unit
    variance, their covariance is x1x1 = 1, x1x2 = x2x2 = 1/2, and the output c1 x1 + c2 x2 has unit variance with
    c1 = sqrt(3/2), c2 = (1 - sqrt(3)) / sqrt(2).
    """

    __slots__ = ("_noise", "_x1", "_x2")
    _C1 = math.sqrt(3 / 2)
    _C2 = (1 - math.sqrt(3)) / math.sqrt(2)

    def __init__(self, noise: random.Random) -> None:
        self._noise = noise
        self._x1 = noise.gauss(0.0, 1.0)
        self._x2 = 0.5 * self._x1 + 0.5 * noise.gauss(0.0, 1.0)

    def step(self, ratio: float) -> float:
        """Advance by `ratio` = dt / T; returns the gust in units of its deviation."""
        decay = math.exp(-ratio)
        before = self._x1
        self._x1 = decay * before + math.sqrt(1 - decay * decay) * self._noise.gauss(0.0, 1.0)
        self._x2 = decay * self._x2 + (1 - decay) * 0.5 * (before + self._x1)
        return self._C1 * self._x1 + self._C2 * self._x2


class _FirstOrder:
    """White noise through 1 / (1 + T s), Dryden's longitudinal form, of unit deviation."""

    __slots__ = ("_noise", "_x")

    def __init__(self, noise: random.Random) -> None:
        self._noise = noise
        self._x = noise.gauss(0.0, 1.0)

    def step(self, ratio: float) -> float:
        """Advance by `ratio` = dt / T; returns the gust in units of its deviation."""
        decay = math.exp(-ratio)
        self._x = decay * self._x + math.sqrt(1 - decay * decay) * self._noise.gauss(0.0, 1.0)
        return self._x


class Wind:
    """The air's velocity where the vehicle is.

    `speed_m_s` is the mean at 20 ft; with height it follows the logarithmic profile of MIL-F-8785C 3.7.3
    for the ground's roughness length (by default the specification's 0.15 ft). `from_rad` is where it blows from,
    clockwise from north; None draws it from `seed`. `fronts` adds single gusts, `lee` what stands upwind.
    """

    def __init__(
        self,
        speed_m_s: float,
        seed: int,
        from_rad: float | None = None,
        *,
        roughness_m: float = ROUGHNESS_M,
        fronts: GustFronts | None = None,
    ) -> None:
        """Raises ValueError when `speed_m_s` is negative."""
        if speed_m_s < 0:
            raise ValueError(f"wind speed is {speed_m_s} m/s; give 0 or more, and its direction apart")
        draw = random.Random(f"wind {seed}")
        self.speed_m_s = speed_m_s
        self.from_rad = draw.uniform(-math.pi, math.pi) if from_rad is None else from_rad
        self.roughness_m = roughness_m
        self.lee: Lee | None = None
        self._fronts = fronts
        self._along = (-math.cos(self.from_rad), -math.sin(self.from_rad))
        self._u = _FirstOrder(draw)
        self._v = _SecondOrder(draw)
        self._w = _SecondOrder(draw)

    def mean_m_s(self, height_m: float) -> float:
        """Mean wind at a height over the ground [m]; below 3 ft, or twice the roughness, it is that of there."""
        roughness_m = self.roughness_m
        height_m = max(height_m, 3 * 0.3048, 2 * roughness_m)
        return self.speed_m_s * math.log(height_m / roughness_m) / math.log(_REFERENCE_HEIGHT_M / roughness_m)

    def step(
        self, dt_s: float, height_m: float, airspeed_m_s: float, position_ned_m: Vector = (0.0, 0.0, 0.0)
    ) -> tuple[float, float, float]:
        """The air's velocity NED [m/s] after `dt_s`; gusts drift past at `airspeed_m_s`, at least at the mean wind.

        `height_m` is over the ground; the place NED [m] matters in the lee of something.
        """
        if self.speed_m_s == 0.0:
            return (0.0, 0.0, 0.0)
        scales = gust_scales(height_m, self.speed_m_s)
        mean_m_s = self.mean_m_s(height_m)
        travelled_m = max(airspeed_m_s, mean_m_s) * dt_s
        along = self._u.step(travelled_m / scales.length_u_m) * scales.sigma_u_m_s
        across = self._v.step(travelled_m / scales.length_v_m) * scales.sigma_v_m_s
        down = self._w.step(travelled_m / scales.length_w_m) * scales.sigma_w_m_s
        if self._fronts is not None:
            more, aside = self._fronts.step(dt_s, travelled_m)
            along += more * mean_m_s
            across += aside * mean_m_s
        if self.lee is not None:
            lost = self.lee.step(dt_s, position_ned_m)
            rougher = 1.0 + min(lost, _MOST_ROUGHER)
            along, across, down = rougher * along, rougher * across, rougher * down
            mean_m_s *= 1.0 - lost
        u = mean_m_s + along
        north, east = self._along
        return (u * north - across * east, u * east + across * north, down)
