"""The conductors of a line, told apart: which of the wires along an axis they are, and where the line's middle runs."""

import itertools
import statistics
from collections.abc import Sequence
from dataclasses import dataclass, field

from mission.wire import Wire

_GATE = 0.045  # a slope so far from a wire's is not that wire's
_JUMP_M, _N_JUMP = 1.5, 5  # all may be moved so far when so many sights in a row show more of the line there
_MEMORY_S = 1.3  # over which a wire's share of hits is taken
_LONG_MEMORY_S = 6.7  # the same for a conductor of the line: it may be hard to see against this ground, but it is there
_MOST_AT_ONCE = 0.25
_ENOUGH_HITS = 5
_MEMBER_SHARE, _LOST_SHARE, _GONE_SHARE = 0.4, 0.15, 0.05
_TENTATIVE_S = 2.0  # a wire of a few sights is forgotten when it is not seen for so long
_PASSED_S = 10.0  # and any that is not the line's
_MOST_WIRES = 24
_LEAST_GAP_M = 0.25
_POSITION_DRIFT_M = 0.15  # in the square root of a second: the vehicle's position drifts, and all wires with it
_LINE_DRIFT = 0.1  # in the square root of a second: the line's inverse depth changes, uphill
_LEARN = 0.1  # of what another witness of the depth says, each time
_SPREAD = 0.01  # what the slopes of one frame's wires err by against each other


@dataclass(slots=True)
class Wires:
    """All that runs along one axis. The members are the line's conductors, as far as known.

    `supposed_depth_m` is for a wire that is new; `gap_m` is wider than what lies between two conductors of a line. Once
    `is_settled`, a member stays one however deep it seems to be: along a line its depth is hardly seen. And where the
    depth of the line was known then, whatever is to count as well has to be known to be no deeper.
    """

    supposed_depth_m: float
    gap_m: float
    all: list[Wire] = field(default_factory=list)
    is_settled: bool = False
    _was_known: bool = False
    _dt_s: float = 0.0
    _n_elsewhere: int = 0

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
        members = [wire for wire in self.all if wire.is_member]
        known = [wire.depth_m for wire in members if wire.is_depth_known] or [wire.depth_m for wire in members]
        return statistics.median(known) if known else self.supposed_depth_m

    @property
    def is_depth_known(self) -> bool:
        """Whether the depth of any conductor is known."""
        return any(wire.is_member and wire.is_depth_known for wire in self.all)

    @property
    def is_sure(self) -> bool:
        """Whether the depth of the line is known, or was when it was settled."""
        return self.is_depth_known or (self.is_settled and self._was_known)

    @property
    def is_complete(self) -> bool:
        """Whether the depth of the line is known, and of all that is in sight beside it and may belong to it.

        And no two conductors hang where one has room: rows on the ground that were taken for each other seem to.
        """
        places_m = [wire.place_m for wire in self.members]
        is_crowded = any(b - a < _LEAST_GAP_M for a, b in itertools.pairwise(places_m))
        return (
            self.is_depth_known
            and not is_crowded
            and not any(
                min(abs(wire.place_m - place_m) for place_m in places_m) < self.gap_m
                for wire in self.all
                if not wire.is_member and wire.is_undecided
            )
        )

    def forecast(self, dt_s: float, climb_m: float) -> None:
        """Time passes, and the vehicle climbs."""
        self._dt_s = dt_s
        for wire in self.all:
            wire.forecast(dt_s, climb_m)
        self.all = [wire for wire in self.all if wire.can_be]

    def see(
        self, slopes: Sequence[float], aside_m: float, in_view: tuple[float, float], slack_m: float
    ) -> dict[int, Wire]:
        """Take in what a frame shows, from left to right; returns which wire each of `slopes` is.

        The frame shows slopes from `in_view[0]` to `in_view[1]`. Where nothing is in its place, all of it may have
        moved by up to `slack_m`: the position has drifted.
        """
        found = self._match(slopes, aside_m, 0.0)
        members = self.members
        if members:
            found = self._match_moved(slopes, aside_m, slack_m, found) or found
        if self.is_settled:
            self._drift({i: wire for i, wire in found.items() if wire.is_member}, slopes, aside_m)
        for i, wire in found.items():
            wire.correct(slopes[i], aside_m)
        seen = list(found.values())
        for wire in self.all:
            is_seen = any(wire is one for one in seen)
            if is_seen or in_view[0] < wire.slope(aside_m) < in_view[1]:
                memory_s = _LONG_MEMORY_S if any(wire is one for one in members) else _MEMORY_S
                wire.share += (is_seen - wire.share) * min(_MOST_AT_ONCE, self._dt_s / memory_s)
        self.all += [Wire.at(slopes[i], aside_m, self.depth_m) for i in self._new(slopes, found, aside_m)]
        self._forget()
        return found

    def choose_members(self, deepest_m: float) -> None:
        """Say anew which wires are the line's conductors: those seen often enough, side by side, and not too deep.

        What is more than `deepest_m` below lies on the ground. Once the depth of the line is known, it has to be known
        of each conductor that is to count, too.
        """
        is_line_known = self._was_known = self.is_sure
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

    def learn_depth(self, depth_m: float) -> None:
        """Take it from another witness how far below the line is, and come nearer to that."""
        share = 1.0 + _LEARN * (self.depth_m / depth_m - 1.0)
        for wire in self.all:
            if wire.is_member:
                wire.near(share)

    def _drift(self, found: dict[int, Wire], slopes: Sequence[float], aside_m: float) -> None:
        """Move all by what the conductors in view have moved by together, and deepen them by how they draw together.

        The one is the vehicle's position, the other the line that sags or the ground that rises. Least squares for
        both, each as small as it usually is.
        """
        if not found or self._dt_s <= 0.0:
            return
        moves, deepens = (1.0 / (drift**2 * self._dt_s) for drift in (_POSITION_DRIFT_M, _LINE_DRIFT))
        moves_deepens = to_move = to_deepen = 0.0
        for i, wire in found.items():
            slope, rho = wire.slope(aside_m), wire.rho_per_m
            error = (slopes[i] - slope) / _SPREAD**2
            moves += rho * rho / _SPREAD**2
            moves_deepens += rho * slope / _SPREAD**2
            deepens += slope * slope / _SPREAD**2
            to_move += rho * error
            to_deepen += slope * error
        determinant = moves * deepens - moves_deepens**2
        moved_m = (deepens * to_move - moves_deepens * to_deepen) / determinant
        nearer = (moves * to_deepen - moves_deepens * to_move) / determinant
        for wire in self.all:
            wire.shift(moved_m)
            if wire.is_member:
                wire.near(max(0.5, 1.0 + nearer))

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

    def _match_moved(
        self, slopes: Sequence[float], aside_m: float, slack_m: float, found: dict[int, Wire]
    ) -> dict[int, Wire]:
        """The shift that shows more of the line, and least far, applied to all; nothing where none is to be believed.

        At once, up to `slack_m`, where nothing is in its place; where something is, when several sights show more of
        the line a little aside. At least half of the conductors have to be seen there.
        """
        members = self.members
        n_here = sum(wire.is_member for wire in found.values())
        if n_here >= min(len(slopes), len(members)):
            self._n_elsewhere = 0
            return {}
        is_lost = n_here == 0 and slack_m > 0.0
        best: tuple[int, float] = (n_here, 0.0)
        best_m, within_m = 0.0, slack_m if is_lost else _JUMP_M
        for slope in slopes:
            for wire in members:
                moved_m = (slope - wire.slope(aside_m)) / wire.rho_per_m
                if abs(moved_m) > within_m:
                    continue
                n_members = sum(one.is_member for one in self._match(slopes, aside_m, moved_m).values())
                if (n_members, -abs(moved_m)) > best:
                    best, best_m = (n_members, -abs(moved_m)), moved_m
        if best[0] == n_here or 2 * best[0] < len(members):
            self._n_elsewhere = 0
            return {}
        self._n_elsewhere += 1
        if not is_lost and self._n_elsewhere < _N_JUMP:
            return {}
        self._n_elsewhere = 0
        for wire in self.all:
            wire.shift(best_m)
        return self._match(slopes, aside_m, 0.0)

    def _new(self, slopes: Sequence[float], found: dict[int, Wire], aside_m: float) -> list[int]:
        """Which of the slopes are of a wire that is not known yet: those with none near by. The list stays short."""
        new = [
            i
            for i, slope in enumerate(slopes)
            if i not in found and all(abs(slope - wire.slope(aside_m)) > _GATE for wire in self.all)
        ]
        n_over = len(self.all) + len(new) - _MOST_WIRES
        others = sorted((wire for wire in self.all if not wire.is_member), key=lambda wire: -wire.unseen_s)
        for wire in others[: max(0, n_over)]:
            self.all = [one for one in self.all if one is not wire]
        return new[: max(0, _MOST_WIRES - len(self.all))]

    def _forget(self) -> None:
        self.all = [wire for wire in self.all if wire.is_member or _is_worth_keeping(wire)]


def _is_worth_keeping(wire: Wire) -> bool:
    """Whether a wire that is not the line's may yet be seen again."""
    keep_s = _PASSED_S if wire.n_hits >= _ENOUGH_HITS else _TENTATIVE_S
    return wire.share >= _GONE_SHARE and wire.unseen_s < keep_s
