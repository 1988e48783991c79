"""How high above a line the vehicle flies, from how the line moves in view as the vehicle crosses over.

One camera cannot tell the height of what it sees, but a vehicle that moves and knows how far can: a fence on the ground
passes more slowly than a conductor.
"""

import math
import statistics
from collections import deque
from dataclasses import dataclass, field

_STEP_M = 0.6  # of way between the two sights of a pair
_N_PAIRS = 10
_JUMP = 0.4  # share of the assumed height: a line that jumps so far from one sight to the next is another one


@dataclass(slots=True)
class Parallax:
    """Compares sights of a line with those before them, taken a little way back.

    `assumed_height_m` is the height that distances were worked out with (guidance.locate_line): a line `h` below seems
    to be `assumed_height_m / h` times as far as it is. The middle of a line moves when a conductor comes into view or
    leaves it, so that only sights of as many conductors are compared; where they are other ones, the median does not
    mind.
    """

    assumed_height_m: float
    _sights: deque[tuple[float, float, int]] = field(default_factory=lambda: deque(maxlen=150), init=False)
    _slopes: deque[float] = field(default_factory=lambda: deque(maxlen=60), init=False)

    def add(self, way_m: float, seen_m: float, n_lines: int) -> None:
        """Take a sight: the vehicle is `way_m` along a heading, and the line seems to cross it `seen_m` ahead."""
        if self._sights and abs(seen_m - self._sights[-1][1]) > _JUMP * self.assumed_height_m:
            if self._sights[-1][2] == n_lines:
                self._slopes.clear()
            self._sights.clear()
        for before_way_m, before_seen_m, before_n in reversed(self._sights):
            if before_n == n_lines and way_m - before_way_m >= _STEP_M:
                self._slopes.append((before_seen_m - seen_m) / (way_m - before_way_m))
                break
        self._sights.append((way_m, seen_m, n_lines))

    @property
    def height_m(self) -> float | None:
        """The height over the line [m]; infinite for one that does not come nearer.

        None until the vehicle has moved far enough for it.
        """
        if len(self._slopes) < _N_PAIRS:
            return None
        slope = statistics.median(self._slopes)
        return self.assumed_height_m / slope if slope > 0.0 else math.inf
