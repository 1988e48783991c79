"""How high above a line the vehicle flies, from how the line moves in view as the vehicle crosses over.

One camera cannot tell the height of what it sees, but a vehicle that moves and knows how far can: a fence on the ground
passes more slowly than a conductor.
"""

import math
from dataclasses import dataclass, field

_MIN_WAY_M = 1.2
_JUMP = 0.2  # share of the assumed height: a line that jumps so far from one sight to the next is another one


@dataclass(slots=True)
class Parallax:
    """Adds up the vehicle's way across a line, and by how much the line seemed to come nearer meanwhile.

    `assumed_height_m` is the height that distances were worked out with (guidance.locate_line): a line `h` below seems
    to be `assumed_height_m / h` times as far as it is. The middle of a line moves when a conductor comes into view or
    leaves it, so that only sights of as many conductors are compared.
    """

    assumed_height_m: float
    _way_m: float = field(default=0.0, init=False)
    _nearer_m: float = field(default=0.0, init=False)
    _last: tuple[float, float, int] | None = field(default=None, init=False)

    def add(self, way_m: float, seen_m: float, n_lines: int) -> None:
        """Take a sight: the vehicle is `way_m` along a heading, and the line seems to cross it `seen_m` ahead."""
        last, self._last = self._last, (way_m, seen_m, n_lines)
        if last is None or last[2] != n_lines:
            return
        if abs(seen_m - last[1]) > _JUMP * self.assumed_height_m:
            self._way_m = self._nearer_m = 0.0
            return
        self._way_m += way_m - last[0]
        self._nearer_m += last[1] - seen_m

    @property
    def height_m(self) -> float | None:
        """The height over the line [m]; infinite for one that does not come nearer.

        None until the vehicle has moved far enough for it.
        """
        if self._way_m < _MIN_WAY_M:
            return None
        return self.assumed_height_m * self._way_m / self._nearer_m if self._nearer_m > 0.0 else math.inf
