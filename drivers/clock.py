"""The flight's clock, shared by every process of a flight.

Time is integer nanoseconds. On a real vehicle it is CLOCK_MONOTONIC; in a dry-run it may run faster, and because
CLOCK_MONOTONIC is one for all processes of a machine, they agree on the scaled time without talking to each other.
"""

import time
from dataclasses import dataclass
from typing import Protocol

NS_PER_S = 1_000_000_000


class Clock(Protocol):
    """What the rest of the program asks of time."""

    def now_ns(self) -> int:
        """Flight time now [ns]."""
        ...

    def wall_s(self, flight_s: float) -> float:
        """How long to sleep [s, wall] until `flight_s` [s, flight] have passed."""
        ...


@dataclass(frozen=True, slots=True)
class ScaledClock:
    """CLOCK_MONOTONIC, run `speed` times faster from `epoch_ns` on. The default is CLOCK_MONOTONIC itself."""

    speed: float = 1.0
    epoch_ns: int = 0

    def now_ns(self) -> int:
        """Flight time now [ns]."""
        monotonic_ns = time.monotonic_ns()
        if self.speed == 1.0:
            return monotonic_ns
        return self.epoch_ns + round((monotonic_ns - self.epoch_ns) * self.speed)

    def wall_s(self, flight_s: float) -> float:
        """How long to sleep [s, wall] until `flight_s` [s, flight] have passed."""
        return max(0.0, flight_s / self.speed)
