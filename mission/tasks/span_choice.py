"""Which span of the line is followed: the one below, until the setpoint is where it bends."""

from dataclasses import dataclass

from mission.autopilot import Setpoint
from mission.guidance import WorldLine, nearest_heading_rad
from mission.tasks.task import Sight
from vision.records import wrap_line_angle_rad

_PASSED_M = 1.0  # so far behind the vehicle, a bend in view is still one to turn at
_SAME_RAD = 0.2  # two sights of one span differ by less
_SAME_BEND_M = 2.0
_LEAST_TURN_RAD = 0.1
_N_SIGHTS = 2  # of one bend, before it is turned at
_IN_SIGHT_M = 12.0  # so far behind a bend, the span before it is out of sight
_DOUBT_S = 1.5  # when nothing but the span before the bend has been seen for so long, there was none


@dataclass(frozen=True, slots=True)
class _LeftSpan:
    """The span before the last bend: its heading, and until which way flown [m] what runs so is taken for it."""

    heading_rad: float
    tolerance_rad: float
    until_m: float


class SpanChoice:
    """Chooses between the spans in sight. `line` is the one followed, `target_rad` which way along it.

    `bend_m` is how far ahead of the setpoint the line bends, None where no bend is in sight. One frame alone does not
    turn the vehicle: a bend counts that several sights agree about.
    """

    def __init__(self) -> None:
        self.line: WorldLine | None = None
        self.target_rad: float | None = None
        self.bend_m: float | None = None
        self._beyond: WorldLine | None = None
        self._n_agreeing = 0
        self._left: _LeftSpan | None = None

    def is_turning(self, moved_m: float) -> bool:
        """Whether a bend has just been left behind, at the way flown so far [m]."""
        return self._left is not None and moved_m <= self._left.until_m

    def take(self, line: WorldLine, heading_rad: float, *, is_place_sure: bool) -> None:
        """Follow a line, its direction nearest to `heading_rad`; the place of a part of it does not count."""
        self.target_rad = nearest_heading_rad(line.heading_rad, heading_rad)
        self.line = line if is_place_sure else self.line

    def see(self, reference: Setpoint, sight: Sight, moved_m: float, unseen_s: float) -> bool:
        """Take in a sight, `unseen_s` after the last one that counted; false where it does not count.

        Such a one shows no line, or nothing but the span that the setpoint has left at a bend, which the vehicle may
        still be over.
        """
        found = sight.found
        if found is None:
            return False
        line = found.line
        if self.target_rad is None:
            self.take(line, reference.yaw_rad, is_place_sure=found.is_placed)
            return True
        target_rad = self.target_rad
        in_sight = [span for span in (line, found.next_line) if span is not None]
        spans = [span for span in in_sight if not self._is_left(span, moved_m)]
        if not spans:
            if unseen_s <= _DOUBT_S:
                return False
            self._left, self.line, spans = None, None, in_sight  # there was no bend
        spans.sort(key=lambda span: abs(wrap_line_angle_rad(span.heading_rad - target_rad)))
        self.bend_m = None
        turn_rad = abs(wrap_line_angle_rad(spans[0].heading_rad - target_rad))
        if len(spans) == 1 and turn_rad > _SAME_RAD and self.line is not None:
            # The vehicle has flown past a bend that it did not see: nothing but the span beyond it is in view.
            return self._approach(reference, sight, self.line, spans[0], moved_m, is_passed=True)
        is_bent = found.next_line is not None
        self.take(spans[0], target_rad, is_place_sure=found.is_placed or is_bent)
        if len(spans) == 2:
            self._approach(reference, sight, spans[0], spans[1], moved_m, is_passed=spans[0] is not line)
        return True

    def _approach(
        self, reference: Setpoint, sight: Sight, span: WorldLine, beyond: WorldLine, moved_m: float, *, is_passed: bool
    ) -> bool:
        """Turn at a bend that several sights agree about, once the setpoint or (`is_passed`) the vehicle is there.

        Returns whether it has turned.
        """
        along_rad = self.target_rad or 0.0
        from_vehicle_m = beyond.crossing_m(sight.north_m, sight.east_m, along_rad, least_rad=_LEAST_TURN_RAD)
        bend_m = beyond.crossing_m(reference.north_m, reference.east_m, along_rad, least_rad=_LEAST_TURN_RAD)
        if bend_m is None or from_vehicle_m is None:
            return False
        if not is_passed and from_vehicle_m <= -_PASSED_M:
            return False
        is_again = (
            self._beyond is not None
            and abs(wrap_line_angle_rad(beyond.heading_rad - self._beyond.heading_rad)) < _SAME_RAD
            and abs(
                beyond.meeting_m(span, reference.north_m, reference.east_m)
                - self._beyond.meeting_m(span, reference.north_m, reference.east_m)
            )
            < _SAME_BEND_M
        )
        self._n_agreeing = self._n_agreeing + 1 if is_again else 1
        self._beyond = beyond
        if self._n_agreeing < _N_SIGHTS:
            return False
        self.bend_m = bend_m
        if bend_m > 0.0 and not is_passed:
            return False
        turn_rad = abs(wrap_line_angle_rad(beyond.heading_rad - span.heading_rad))
        self._left = _LeftSpan(span.heading_rad, min(_SAME_RAD, turn_rad / 2), moved_m + _IN_SIGHT_M)
        self._beyond, self._n_agreeing = None, 0
        self.take(beyond, along_rad, is_place_sure=True)
        return True

    def _is_left(self, span: WorldLine, moved_m: float) -> bool:
        left = self._left
        if left is None or moved_m > left.until_m:
            return False
        return abs(wrap_line_angle_rad(span.heading_rad - left.heading_rad)) < left.tolerance_rad
