"""Single gusts that come over a vehicle now and then: the 1-cosine gust of MIL-F-8785C."""

import math
import random

_QUIET_S = 12.0  # at least, from one gust's end to the next one
_FURTHER_S = 20.0  # and this much more on average: with the gust itself, somewhat more than one a minute
_STRENGTH = (0.25, 0.5)  # of the mean wind: 3 s gusts over open land reach 1.4 to 1.6 times it with the turbulence
_RISE_M = (25.0, 60.0)
_HOLD_M = (20.0, 120.0)
_VEER_RAD = math.radians(15.0)


def one_minus_cosine(travelled_m: float, length_m: float) -> float:
    """The discrete gust of MIL-F-8785C 3.7.2: 0 before it, (1 - cos(pi x / d)) / 2 within, 1 after its length d [m]."""
    share = min(max(travelled_m / length_m, 0.0), 1.0)
    return 0.5 * (1.0 - math.cos(math.pi * share))


class GustFronts:
    """Gusts at random times, each a rise, a while of more wind, and a fall. The same seed brings the same gusts.

    The specification's gust rises and stays; here it falls again in the same way, so that others can follow.
    """

    def __init__(self, seed: int) -> None:
        self._draw = random.Random(f"gust fronts {seed}")
        self._wait()

    def step(self, dt_s: float, travelled_m: float) -> tuple[float, float]:
        """What comes on top of the mean wind, along it and across it (to the right), in shares of it.

        After `dt_s` [s] more, in which `travelled_m` [m] of air have gone past.
        """
        if self._wait_s > 0.0:
            self._wait_s -= dt_s
            return (0.0, 0.0)
        self._past_m += travelled_m
        if self._past_m >= self._rise_m + self._hold_m + self._fall_m:
            self._wait()
            return (0.0, 0.0)
        share = one_minus_cosine(self._past_m, self._rise_m)
        share -= one_minus_cosine(self._past_m - self._rise_m - self._hold_m, self._fall_m)
        return (share * self._along, share * self._across)

    def _wait(self) -> None:
        """Draw the next gust, and how long it lets wait."""
        draw = self._draw
        self._wait_s = _QUIET_S + draw.expovariate(1 / _FURTHER_S)
        self._past_m = 0.0
        self._rise_m, self._fall_m = draw.uniform(*_RISE_M), draw.uniform(*_RISE_M)
        self._hold_m = draw.uniform(*_HOLD_M)
        strength, veer_rad = draw.uniform(*_STRENGTH), draw.uniform(-_VEER_RAD, _VEER_RAD)
        self._along, self._across = strength * math.cos(veer_rad), strength * math.sin(veer_rad)
