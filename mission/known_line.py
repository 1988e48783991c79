"""The line that is flown to and followed, as far as it is known: which of what vision shows is it, and where it runs.

A fence or a kerb beside the line may for a while be clearer than its conductors, and a tilted camera may show a part of
them only. But a power line does not jump sideways: what is seen has to be where its conductors are (mission/wires.py).
At an angle support it turns, but the new span begins where the old one ends.
"""

import itertools
import math
import statistics
from dataclasses import dataclass, field, replace

from drivers.clock import NS_PER_S
from mission.guidance import Bearing, GuidanceSettings, WorldLine, wrap_angle_rad
from mission.wires import Wires
from vision.records import wrap_line_angle_rad

_STRAIGHT_RAD = 0.21  # 12 degrees: less may be a wrong angle
_AWAY_M = 6.0  # how far from the vehicle a bend may be, seen or flown past
_MOST_AWAY_M = 12.0
MAX_TURN_RAD = 1.2  # 69 degrees: angle supports turn by 60
_OUT_OF_SIGHT_S = 0.5  # after which the line may be somewhat elsewhere
_TOLERANCE_M = 1.5  # what the estimates of place and height err by then
_DRIFT_M_S = 0.2  # the position may drift so fast while the line is out of sight
_MOST_M = 4.0
ABOVE_GROUND = 0.85  # share of the height over the take-off point: what is further below than that lies on the ground
TOO_DEEP = 2.0  # of the planned height over the line: what is further below than that is something else
_N_ELSEWHERE = 3  # sights of another direction, before that is the one looked at
_GONE_S = 2.0  # a line that is not surely one, or that is not followed yet, is given up when it is not seen for so long
_SAME_RAD, _AGAIN_S = 0.2, 0.5  # two views of one span beyond a bend differ by less
_GAP = 0.75  # share of the planned height: conductors of one line are less far apart
_BUNDLE = 0.04  # wires closer than this slope are one conductor: a bundle's are 0.4 m apart
_MOST_IN_VIEW, _LARGEST_BUNDLE, _MOST_CONDUCTORS = 30, 6, 18  # more are the rows of a field, which pass for each other
_DEPTH_AGREES = 0.35  # share by which the height that the spacing tells may differ from what the way flown has told


@dataclass(frozen=True, slots=True)
class View:
    """What a frame showed of a line, seen from where the vehicle was, `ground_m` above the take-off point.

    `conductors` are one at least; the frame shows slopes from `in_view[0]` to `in_view[1]` to the right of `middle`.
    """

    t_ns: int
    north_m: float
    east_m: float
    down_m: float
    ground_m: float
    middle: Bearing
    conductors: tuple[Bearing, ...]
    in_view: tuple[float, float]
    next_span: Bearing | None = None

    def along(self, heading_rad: float) -> "View":
        """The same for one who looks along the line's other heading, where that is nearer to `heading_rad`."""
        middle = self.middle.along(heading_rad)
        is_same = math.cos(middle.heading_rad - self.middle.heading_rad) > 0.0
        return replace(
            self,
            middle=middle,
            conductors=tuple(conductor.along(heading_rad) for conductor in self.conductors),
            in_view=self.in_view if is_same else (-self.in_view[1], -self.in_view[0]),
        )


@dataclass(frozen=True, slots=True)
class Found:
    """The line in a view, of `n_conductors` as far as known.

    `is_placed` says whether its place counts, or its heading only. `depth_m` is how far below the line is, where the
    way flown has told that of all that seems to belong to it; None: not yet. `height_m` is the same by the spacing of
    the conductors, where all were seen and the mission tells it.
    """

    line: WorldLine
    n_conductors: int
    is_placed: bool
    next_line: WorldLine | None
    depth_m: float | None
    height_m: float | None


@dataclass(slots=True)
class KnownLine:
    """What was seen of the line so far; nothing before a first view.

    While a flight looks for its line, whatever may be one is; from `begin` on there is one that is followed, and
    nothing counts but what may be its conductors, or a span that it goes on in.
    """

    is_begun: bool = False
    _axis: WorldLine | None = None
    _wires: Wires = field(default_factory=lambda: Wires(1.0, 1.0))
    _seen_ns: int = 0
    _last_ns: int = 0
    _last_down_m: float = 0.0
    _n_elsewhere: int = 0
    _turned: tuple[int, float] = (0, 0.0)

    def forget(self) -> None:
        """Look for any line."""
        self.is_begun, self._axis, self._n_elsewhere = False, None, 0

    def begin(self) -> None:
        """What is seen now is the line to follow."""
        if self._axis is not None:
            self.is_begun = self._wires.is_settled = True

    def see(self, view: View, guidance: GuidanceSettings) -> Found | None:
        """Take in a view; returns the line, or None where the view shows something else."""
        if self._axis is None:
            self._start(view, guidance)
        self._wires.forecast(max(0, view.t_ns - self._last_ns) / NS_PER_S, self._last_down_m - view.down_m)
        self._last_ns, self._last_down_m = max(view.t_ns, self._last_ns), view.down_m
        axis = self._axis or view.middle.line(view.north_m, view.east_m, guidance.height_over_line_m)
        view = view.along(axis.heading_rad)
        bundles = _bundles(view.conductors)
        if _are_of_a_field(bundles):
            return None
        view = replace(view, conductors=tuple(_middle_of(bundle) for bundle in bundles))
        if self._is_gone(view.t_ns):
            self._start(view, guidance)
            axis = self._axis or axis
        elif abs(wrap_line_angle_rad(view.middle.heading_rad - axis.heading_rad)) > _STRAIGHT_RAD:
            if not self._turns(view, axis, guidance):
                return self._beyond(view, axis)
            axis = self._axis or axis
        else:
            self._n_elsewhere = 0
        return self._find(view, axis, guidance)

    def _start(self, view: View, guidance: GuidanceSettings) -> None:
        self._axis = view.middle.line(view.north_m, view.east_m, guidance.height_over_line_m)
        self._wires = Wires(guidance.height_over_line_m, _GAP * guidance.height_over_line_m)
        self._wires.is_settled = self.is_begun
        self._last_ns, self._last_down_m, self._seen_ns = view.t_ns, view.down_m, view.t_ns

    def _is_gone(self, t_ns: int) -> bool:
        """Whether what is followed was hardly a line: one of which the depth is not known, not seen for a while."""
        return self.is_begun and not self._wires.is_sure and t_ns - self._seen_ns > _GONE_S * NS_PER_S

    def _find(self, view: View, axis: WorldLine, guidance: GuidanceSettings) -> Found | None:
        """The line in a view of the same direction."""
        wires = self._wires
        aside_m = -axis.offset_m(view.north_m, view.east_m, axis.heading_rad)
        slopes = [conductor.slope for conductor in view.conductors]
        seen = wires.see(slopes, aside_m, view.in_view, self._slack_m(view.t_ns))
        wires.choose_members(min(ABOVE_GROUND * view.ground_m, TOO_DEEP * guidance.height_over_line_m))
        here = {i: wire for i, wire in seen.items() if wire.is_member}
        if not here and (self.is_begun or wires.members):
            return None
        if not here and seen and all(wire.is_depth_known for wire in seen.values()):
            return None  # nothing but what lies on the ground
        heading_rad = view.middle.heading_rad
        if here:
            self._seen_ns = view.t_ns
            turns_rad = [wrap_line_angle_rad(view.conductors[i].heading_rad - axis.heading_rad) for i in here]
            heading_rad = wrap_angle_rad(axis.heading_rad + statistics.fmean(turns_rad))
        abreast = WorldLine(axis.heading_rad, view.north_m, view.east_m).beside(-aside_m)
        self._axis = WorldLine(heading_rad, abreast.north_m, abreast.east_m)
        middle_m = wires.middle_m
        if middle_m is None:
            line = view.middle.line(view.north_m, view.east_m, wires.depth_m)
        else:
            line = self._axis.beside(middle_m)
        height_m = self._height_m([slopes[i] for i in sorted(here)], guidance)
        if height_m is not None and self.is_begun:
            wires.learn_depth(height_m)
        return Found(
            line,
            max(1, len(wires.members)),
            True,
            self._next_line(view),
            wires.depth_m if wires.is_complete else None,
            height_m,
        )

    def _next_line(self, view: View) -> WorldLine | None:
        span = view.next_span
        return None if span is None else span.line(view.north_m, view.east_m, self._wires.depth_m)

    def _slack_m(self, t_ns: int) -> float:
        """How far the line may be from where it was seen last."""
        unseen_s = max(0, t_ns - self._seen_ns) / NS_PER_S
        return min(_MOST_M, _TOLERANCE_M + _DRIFT_M_S * unseen_s) if unseen_s > _OUT_OF_SIGHT_S else 0.0

    def _height_m(self, slopes: list[float], guidance: GuidanceSettings) -> float | None:
        """The height that the spacing of all conductors tells; None where it cannot be told from this view."""
        spacing_m, planned_m, wires = guidance.conductor_spacing_m, guidance.height_over_line_m, self._wires
        if spacing_m is None or len(slopes) < 2 or len(slopes) != len(wires.members):
            return None
        height_m = spacing_m / statistics.median(b - a for a, b in itertools.pairwise(slopes))
        is_other = abs(height_m - wires.depth_m) > _DEPTH_AGREES * wires.depth_m
        if is_other and wires.is_depth_known and not self.is_begun:  # later on the spacing is the better witness
            return None
        return height_m if 0.5 * planned_m <= height_m <= TOO_DEEP * planned_m else None

    def _turns(self, view: View, axis: WorldLine, guidance: GuidanceSettings) -> bool:
        """Whether a view of another direction is of the next span, or of what is looked at from now on."""
        if not self.is_begun:
            self._n_elsewhere += 1
            is_kept = self._wires.is_depth_known and view.t_ns - self._seen_ns < _GONE_S * NS_PER_S
            if self._n_elsewhere < _N_ELSEWHERE or is_kept:
                return False
            self._n_elsewhere = 0
            self._start(view, guidance)
            return True
        wires, middle_m = self._wires, self._wires.middle_m or 0.0
        if abs(wrap_line_angle_rad(view.middle.heading_rad - axis.heading_rad)) > MAX_TURN_RAD:
            return False
        span = view.middle.line(view.north_m, view.east_m, wires.depth_m)
        places_m = [wire.place_m for wire in wires.members] or [0.0]
        part_m = 0.5 * (max(places_m) - min(places_m)) if len(view.conductors) < len(places_m) else 0.0
        drift_m = _DRIFT_M_S * max(0, view.t_ns - self._seen_ns) / NS_PER_S
        if span.meeting_m(axis.beside(middle_m), view.north_m, view.east_m) > min(
            _MOST_AWAY_M, _AWAY_M + part_m + 3.0 * drift_m
        ):
            return False
        seen_ns, heading_rad = self._turned
        self._turned = (view.t_ns, span.heading_rad)
        is_again = abs(wrap_line_angle_rad(span.heading_rad - heading_rad)) < _SAME_RAD
        if not is_again or view.t_ns - seen_ns > _AGAIN_S * NS_PER_S:
            return False
        self._axis = span.beside(-middle_m)
        return True

    def _beyond(self, view: View, axis: WorldLine) -> Found | None:
        """The line in a view that is about another direction, but shows the known one beyond a bend."""
        if not self.is_begun or view.next_span is None:
            return None
        if abs(wrap_line_angle_rad(view.next_span.heading_rad - axis.heading_rad)) > _STRAIGHT_RAD:
            return None
        return Found(axis.beside(self._wires.middle_m or 0.0), len(self._wires.members), False, None, None, None)


def _bundles(conductors: tuple[Bearing, ...]) -> list[list[Bearing]]:
    """The conductors from left to right, those of one bundle together."""
    bundles: list[list[Bearing]] = []
    for conductor in sorted(conductors, key=lambda conductor: conductor.slope):
        if bundles and conductor.slope - bundles[-1][-1].slope < _BUNDLE:
            bundles[-1].append(conductor)
        else:
            bundles.append([conductor])
    return bundles


def _are_of_a_field(bundles: list[list[Bearing]]) -> bool:
    """Whether they are too many side by side to be those of a line."""
    is_dense = sum(map(len, bundles)) > _MOST_IN_VIEW or max(map(len, bundles)) > _LARGEST_BUNDLE
    return is_dense or len(bundles) > _MOST_CONDUCTORS


def _middle_of(bundle: list[Bearing]) -> Bearing:
    """The wires of one bundle as one conductor."""
    first_rad = bundle[0].heading_rad
    turn_rad = statistics.fmean(wrap_line_angle_rad(one.heading_rad - first_rad) for one in bundle)
    return Bearing(first_rad + turn_rad, statistics.fmean(one.slope for one in bundle))
