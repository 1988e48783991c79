"""One conductor, or whatever else runs along a line: where it is beside the axis, and how far below. A Kalman filter.

One camera cannot tell the distance of what it sees. But a vehicle that moves across a line, and knows how far, sees a
conductor 6 m below pass faster than the ground 16 m below. The filter keeps place and inverse depth (the
parametrisation of Civera, Davison and Montiel, "Inverse Depth Parametrization for Monocular SLAM", 2008, reduced to the
plane across the line).
"""

import math
from dataclasses import dataclass

_SLOPE_NOISE = 0.03  # what roll, pitch and their times err by [rad], about the same for all wires of a frame
_DEPTH_DOUBT = 0.5  # of an inverse depth that is only supposed
_DEPTH_KNOWN = 0.15  # of one that the way flown has told
_DEPTH_DRIFT = 0.02  # in the square root of a second: conductors sag, ground rises
_PLACE_DRIFT_M = 0.03  # in the square root of a second: conductors swing
_DEPTH_HITS, _DEPTH_SEEN_S = 12, 0.5  # texture may look like a wire for a few frames, at any depth
_SEEN_AT_MOST_S = 0.1  # at once
_STEADY_SHARE = 0.4
_IN_SIGHT_S = 0.5
_LEAST_VARIANCE = 1e-12
_LEAST_PER_M, _MOST_PER_M = 1e-3, 2.0  # inverse depths: what is nearer is none, and must not be flown over


@dataclass(slots=True)
class Wire:
    """One thing that runs along the axis: a conductor, or a kerb.

    A wire at `place_m`, `depth_m` below a vehicle at `aside_m` (both to the right of the axis), is seen at the slope
    (place_m - aside_m) / depth_m = p - aside_m rho, where rho = 1 / depth_m and p = place_m rho: linear in both. The
    three variances are theirs. `share` is that of the sights that should have shown it and did.
    """

    p: float
    rho_per_m: float
    var_p: float
    cov: float
    var_rho: float
    n_hits: int = 1
    share: float = 0.5
    seen_s: float = 0.0
    unseen_s: float = 0.0
    is_member: bool = False

    @classmethod
    def at(cls, slope: float, aside_m: float, depth_m: float) -> "Wire":
        """A wire seen for the first time; its depth is supposed."""
        rho, var_rho = 1.0 / depth_m, (_DEPTH_DOUBT / depth_m) ** 2
        var_p = _SLOPE_NOISE**2 + aside_m**2 * var_rho
        return cls(slope + aside_m * rho, rho, var_p, aside_m * var_rho, var_rho)

    @property
    def place_m(self) -> float:
        """How far to the right of the axis it is [m]."""
        return self.p / self.rho_per_m

    @property
    def depth_m(self) -> float:
        """How far below the vehicle it is [m]."""
        return 1.0 / self.rho_per_m

    @property
    def is_depth_known(self) -> bool:
        """Whether the depth is more than supposed."""
        is_looked_at = self.n_hits >= _DEPTH_HITS and self.seen_s >= _DEPTH_SEEN_S
        return is_looked_at and math.sqrt(self.var_rho) < _DEPTH_KNOWN * self.rho_per_m

    @property
    def is_undecided(self) -> bool:
        """Whether it is in sight, and steadily so, but its depth is not known."""
        is_steady = self.n_hits >= _DEPTH_HITS and self.share >= _STEADY_SHARE
        return is_steady and self.unseen_s < _IN_SIGHT_S and not self.is_depth_known

    @property
    def can_be(self) -> bool:
        """Whether it can be there at all; one that the vehicle would have to touch was none."""
        return self.rho_per_m < _MOST_PER_M

    def slope(self, aside_m: float) -> float:
        """The slope at which a vehicle there should see it."""
        return self.p - aside_m * self.rho_per_m

    def forecast(self, dt_s: float, climb_m: float) -> None:
        """Time passes, and the vehicle climbs: the depth grows, the place stays, and both are less sure."""
        share = 1.0 / max(0.2, 1.0 + self.rho_per_m * climb_m)
        self.near(share)
        place_m = self.place_m
        drift = (_DEPTH_DRIFT * self.rho_per_m) ** 2 * dt_s
        self.var_p += drift * place_m**2 + (_PLACE_DRIFT_M * self.rho_per_m) ** 2 * dt_s
        self.cov += drift * place_m
        self.var_rho += drift
        self.unseen_s += dt_s

    def correct(self, slope: float, aside_m: float) -> None:
        """Take in a sight."""
        to_p, to_rho = self.var_p - aside_m * self.cov, self.cov - aside_m * self.var_rho
        spread = to_p - aside_m * to_rho + _SLOPE_NOISE**2
        error = slope - self.slope(aside_m)
        self.p += to_p / spread * error
        self.rho_per_m = max(_LEAST_PER_M, self.rho_per_m + to_rho / spread * error)
        self.var_p = max(_LEAST_VARIANCE, self.var_p - to_p * to_p / spread)
        self.cov -= to_p * to_rho / spread
        self.var_rho = max(_LEAST_VARIANCE, self.var_rho - to_rho * to_rho / spread)
        self.seen_s += min(self.unseen_s, _SEEN_AT_MOST_S)
        self.n_hits, self.unseen_s = self.n_hits + 1, 0.0

    def shift(self, right_m: float) -> None:
        """Move it, or rather correct where it was thought to be."""
        self.p += right_m * self.rho_per_m

    def near(self, share: float) -> None:
        """Make the inverse depth `share` times as large; the place stays."""
        self.p, self.rho_per_m = share * self.p, share * self.rho_per_m
