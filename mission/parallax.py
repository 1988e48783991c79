"""How high above a line the vehicle flies, from how the line moves in view as the vehicle crosses over.

One camera cannot tell the height of what it sees, but a vehicle that moves and knows how far can: a fence on the ground
passes more slowly than a conductor.
"""

import math
from dataclasses import dataclass, field

_MIN_WAY_M = 1.0
_MIN_SIGHTS = 8
_MIN_CORRELATION = 0.95


@dataclass(slots=True)
class Parallax:
    """A straight line fitted through (way across the line, distance to it as seen), by least squares.

    `assumed_height_m` is the height that distances were worked out with (guidance.locate_line): a line `h` below seems
    to be `assumed_height_m / h` times as far as it is.
    """

    assumed_height_m: float
    _n: int = field(default=0, init=False)
    _mean_way: float = field(default=0.0, init=False)
    _mean_seen: float = field(default=0.0, init=False)
    _way_way: float = field(default=0.0, init=False)
    _way_seen: float = field(default=0.0, init=False)
    _seen_seen: float = field(default=0.0, init=False)
    _first_way_m: float = field(default=math.inf, init=False)
    _last_way_m: float = field(default=-math.inf, init=False)

    def add(self, way_m: float, seen_m: float) -> None:
        """Take a sight: the vehicle is `way_m` along a heading, and the line seems to cross it `seen_m` ahead."""
        self._n += 1
        before_way, before_seen = way_m - self._mean_way, seen_m - self._mean_seen
        self._mean_way += before_way / self._n
        self._mean_seen += before_seen / self._n
        self._way_way += before_way * (way_m - self._mean_way)
        self._way_seen += before_way * (seen_m - self._mean_seen)
        self._seen_seen += before_seen * (seen_m - self._mean_seen)
        self._first_way_m, self._last_way_m = min(self._first_way_m, way_m), max(self._last_way_m, way_m)

    @property
    def height_m(self) -> float | None:
        """The height over the line [m]; infinite for one that does not come nearer.

        None until the vehicle has moved far enough for it, or where the sights do not tell of one line.
        """
        if self._n < _MIN_SIGHTS or self._last_way_m - self._first_way_m < _MIN_WAY_M:
            return None
        slope = -self._way_seen / self._way_way
        if slope <= 0.0:
            return math.inf
        correlation = slope * math.sqrt(self._way_way / self._seen_seen)
        return self.assumed_height_m / slope if correlation >= _MIN_CORRELATION else None
