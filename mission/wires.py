"""The conductors of a line, told apart: where each one runs beside the line's axis, and how far below.

One camera cannot tell the distance of what it sees. But a vehicle that moves across a line, and knows how far, sees a
conductor 6 m below pass faster than the ground 16 m below. So each conductor is kept by itself, by a Kalman filter of
its place and its inverse depth (the parametrisation of Civera, Davison and Montiel, "Inverse Depth Parametrization for
Monocular SLAM", 2008, reduced to the plane across the line).
"""

import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass, field

_SLOPE_NOISE = 0.03  # what roll, pitch and their times err by [rad], about the same for all conductors
_DEPTH_DOUBT = 0.5  # of an inverse depth that is only supposed
_DEPTH_KNOWN = 0.15  # of one that the way flown has told
_DEPTH_DRIFT = 0.02  # in the square root of a second: conductors sag, ground rises
_PLACE_DRIFT_M = 0.03  # in the square root of a second: conductors swing
_POSITION_DRIFT_M = 0.08  # from one frame to the next: the vehicle's position drifts, and all wires with it
_GATE = 0.05  # a slope so far from a wire's is not that wire's
_MEMORY = 40.0  # sights over which a wire's share of hits is taken
_LONG_MEMORY = 200.0  # the same for a conductor of the line: it may be hard to see against this ground, but it is there
_ENOUGH_HITS = 5
_DEPTH_HITS = 15  # texture may look like a wire for a few frames, at any depth
_MEMBER_SHARE, _LOST_SHARE, _GONE_SHARE = 0.4, 0.15, 0.05
_TENTATIVE_S = 2.0  # a wire of a few sights is forgotten when it is not seen for so long
_IN_SIGHT_S = 0.5
_MOST_WIRES = 24


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
    unseen_s: float = 0.0
    is_member: bool = False

    @classmethod
    def at(cls, slope: float, aside_m: float, depth_m: float) -> "Wire":
        """A wire seen for the first time; its depth is supposed."""
        rho, var_rho = 1.0 / depth_m, (_DEPTH_DOUBT / depth_m) ** 2
        return cls(
            slope + aside_m * rho, rho, _SLOPE_NOISE**2 + aside_m**2 * var_rho, aside_m * var_rho, var_rho
        )  # fmt: skip

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
        return self.n_hits >= _DEPTH_HITS and math.sqrt(self.var_rho) < _DEPTH_KNOWN * self.rho_per_m

    @property
    def is_undecided(self) -> bool:
        """Whether it is in sight, and steadily so, but its depth is not known."""
        is_steady = self.n_hits >= _DEPTH_HITS and self.share >= _MEMBER_SHARE
        return is_steady and self.unseen_s < _IN_SIGHT_S and not self.is_depth_known

    def slope(self, aside_m: float) -> float:
        """The slope at which a vehicle there should see it."""
        return self.p - aside_m * self.rho_per_m

    def forecast(self, dt_s: float, climb_m: float) -> None:
        """Time passes, and the vehicle climbs: the depth grows, the place stays, and both are less sure."""
        share = 1.0 / max(0.2, 1.0 + self.rho_per_m * climb_m)
        self.p, self.rho_per_m = share * self.p, share * self.rho_per_m
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
        self.rho_per_m = max(1e-3, self.rho_per_m + to_rho / spread * error)
        self.var_p -= to_p * to_p / spread
        self.cov -= to_p * to_rho / spread
        self.var_rho -= to_rho * to_rho / spread
        self.n_hits, self.unseen_s = self.n_hits + 1, 0.0

    def shift(self, right_m: float) -> None:
        """Move it, or rather correct where it was thought to be."""
        self.p += right_m * self.rho_per_m


@dataclass(slots=True)
class Wires:
    """All that runs along one axis. The members are the line's conductors, as far as known.

    `supposed_depth_m` is for a wire that is new; `gap_m` is wider than what lies between two conductors of a line. Once
    `is_settled`, a member stays one however deep it seems to be: along a line its depth is hardly seen.
    """

    supposed_depth_m: float
    gap_m: float
    all: list[Wire] = field(default_factory=list)
    is_settled: bool = False

    @property
    def members(self) -> list[Wire]:
        """The line's conductors from left to right."""
        return sorted((wire for wire in self.all if wire.is_member), key=lambda wire: wire.place_m)

    @property
    def middle_m(self) -> float | None:
        """The line's middle [m] to the right of the axis, halfway between the outermost conductors."""
        places_m = [wire.place_m for wire in self.all if wire.is_member]
        return 0.5 * (min(places_m) + max(places_m)) if places_m else None

    @property
    def depth_m(self) -> float:
        """How far below the vehicle the line is [m]; supposed, before anything is known."""
        known = [wire.depth_m for wire in self.all if wire.is_member and wire.is_depth_known]
        return statistics.median(known) if known else self.supposed_depth_m

    @property
    def is_depth_known(self) -> bool:
        """Whether the depth of any conductor is known."""
        return any(wire.is_member and wire.is_depth_known for wire in self.all)

    @property
    def is_complete(self) -> bool:
        """Whether the depth of the line is known, and of all that is in sight beside it and may belong to it."""
        places_m = [wire.place_m for wire in self.all if wire.is_member]
        return self.is_depth_known and not any(
            min(abs(wire.place_m - place_m) for place_m in places_m) < self.gap_m
            for wire in self.all
            if not wire.is_member and wire.is_undecided
        )

    def forecast(self, dt_s: float, climb_m: float) -> None:
        """Time passes, and the vehicle climbs."""
        for wire in self.all:
            wire.forecast(dt_s, climb_m)

    def see(
        self, slopes: Sequence[float], aside_m: float, in_view: tuple[float, float], slack_m: float
    ) -> dict[int, Wire]:
        """Take in what a frame shows, from left to right; returns which wire each of `slopes` is.

        The frame shows slopes from `in_view[0]` to `in_view[1]`. Where nothing is in its place, all of it may have
        moved by up to `slack_m`: the position has drifted.
        """
        found = self._match(slopes, aside_m, 0.0)
        if self.members and not any(wire.is_member for wire in found.values()) and slack_m > 0.0:
            found = self._match_moved(slopes, aside_m, slack_m) or found
        if self.is_settled:
            self._drift({i: wire for i, wire in found.items() if wire.is_member}, slopes, aside_m)
        for i, wire in found.items():
            wire.correct(slopes[i], aside_m)
        seen = list(found.values())
        for wire in self.all:
            is_seen = any(wire is one for one in seen)
            if is_seen or in_view[0] < wire.slope(aside_m) < in_view[1]:
                memory = _LONG_MEMORY if wire.is_member and wire.is_depth_known else _MEMORY
                wire.share += (is_seen - wire.share) / memory
        for i, slope in enumerate(slopes):
            if i not in found and len(self.all) < _MOST_WIRES:
                self.all.append(Wire.at(slope, aside_m, self.depth_m))
        self._forget()
        return found

    def choose_members(self, deepest_m: float) -> None:
        """Say anew which wires are the line's conductors: those seen often enough, side by side, and not too deep.

        What is more than `deepest_m` below lies on the ground. Once the depth of the line is known, it has to be known
        of each conductor that is to count, too.
        """
        is_line_known = self.is_depth_known
        wires = [wire for wire in self.all if self._may_count(wire, deepest_m, is_line_known)]
        wires.sort(key=lambda wire: wire.place_m)
        if not wires:
            chosen = []
        else:
            surest = max(wires, key=lambda wire: (self.is_settled and wire.is_member, wire.is_depth_known, wire.n_hits))
            first = last = next(k for k, wire in enumerate(wires) if wire is surest)
            while first > 0 and wires[first].place_m - wires[first - 1].place_m < self.gap_m:
                first -= 1
            while last + 1 < len(wires) and wires[last + 1].place_m - wires[last].place_m < self.gap_m:
                last += 1
            chosen = wires[first : last + 1]
        for wire in self.all:
            wire.is_member = any(wire is one for one in chosen)

    def _drift(self, found: dict[int, Wire], slopes: Sequence[float], aside_m: float) -> None:
        """Move all wires by what the conductors in view have moved by together: it was the vehicle's position.

        A wire far aside tells less of it, since there a wrong depth looks the same.
        """
        weight, error = 1.0 / _POSITION_DRIFT_M**2, 0.0
        for i, wire in found.items():
            slope = wire.slope(aside_m)
            spread = _SLOPE_NOISE**2 + slope**2 * wire.var_rho / wire.rho_per_m**2
            weight += wire.rho_per_m**2 / spread
            error += wire.rho_per_m * (slopes[i] - slope) / spread
        for wire in self.all:
            wire.shift(error / weight)

    def _may_count(self, wire: Wire, deepest_m: float, is_line_known: bool) -> bool:
        if wire.is_member:
            is_too_deep = wire.is_depth_known and wire.depth_m > deepest_m and not self.is_settled
            return wire.share >= _LOST_SHARE and not is_too_deep
        if wire.n_hits < _ENOUGH_HITS or wire.share < _MEMBER_SHARE:
            return False
        return wire.depth_m <= deepest_m if wire.is_depth_known else not is_line_known

    def _match(self, slopes: Sequence[float], aside_m: float, moved_m: float) -> dict[int, Wire]:
        """The nearest pairs of slopes and wires, each used once."""
        pairs = sorted(
            (
                (abs(slope - wire.slope(aside_m - moved_m)), i, k)
                for i, slope in enumerate(slopes)
                for k, wire in enumerate(self.all)
            ),
        )
        found: dict[int, Wire] = {}
        used: set[int] = set()
        for error, i, k in pairs:
            if error <= _GATE and i not in found and k not in used:
                found[i] = self.all[k]
                used.add(k)
        return found

    def _match_moved(self, slopes: Sequence[float], aside_m: float, slack_m: float) -> dict[int, Wire]:
        """The shift of the members that explains most of the slopes, and least far; applied to all wires."""
        best: tuple[int, float] = (0, 0.0)
        best_m = 0.0
        for slope in slopes:
            for wire in self.members:
                moved_m = (slope - wire.slope(aside_m)) / wire.rho_per_m
                if abs(moved_m) > slack_m:
                    continue
                n_members = sum(one.is_member for one in self._match(slopes, aside_m, moved_m).values())
                if (n_members, -abs(moved_m)) > best:
                    best, best_m = (n_members, -abs(moved_m)), moved_m
        if best[0] == 0:
            return {}
        for wire in self.all:
            wire.shift(best_m)
        return self._match(slopes, aside_m, 0.0)

    def _forget(self) -> None:
        self.all = [
            wire
            for wire in self.all
            if wire.share >= _GONE_SHARE and (wire.n_hits >= _ENOUGH_HITS or wire.unseen_s < _TENTATIVE_S)
        ]
