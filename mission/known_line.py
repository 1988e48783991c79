"""The line that is followed, as far as it is known: which of the lines that vision shows is it.

A fence or a kerb beside the line may for a while be clearer than its conductors. A power line does not jump sideways:
at an angle support it turns, but the new span begins where the old one ends.
"""

from dataclasses import dataclass

from drivers.clock import NS_PER_S
from mission.guidance import WorldLine
from vision.records import LineEstimate, wrap_line_angle_rad

_TOLERANCE_M = 1.5  # what the estimates of place and height err by from one frame to the next ones
_DRIFT_M_S = 0.2  # the position may drift so fast while the line is out of sight
_MOST_M = 4.0
_STRAIGHT_RAD = 0.21  # 12 degrees: less may be a wrong angle
_AWAY_M = 6.0  # how far from the vehicle a bend may be, seen or flown past
_MOST_AWAY_M = 12.0
MAX_TURN_RAD = 1.2  # 69 degrees: angle supports turn by 60


@dataclass(slots=True)
class KnownLine:
    """Where the line was seen last; nothing before a task has begun to follow it."""

    line: WorldLine | None = None
    half_width_m: float = 0.0
    seen_s: float = 0.0

    def forget(self) -> None:
        """Look for any line."""
        self.line, self.half_width_m = None, 0.0

    def follow(self, line: WorldLine, now_s: float) -> None:
        """This is it, all of it, seen at `now_s` [s]."""
        self.line, self.seen_s = line, now_s

    def begin(self, line: WorldLine, t_capture_ns: int) -> None:
        """Follow this line, if none is known yet."""
        if self.line is None:
            self.follow(line, t_capture_ns / NS_PER_S)

    def measure(self, estimate: LineEstimate, m_per_px: float) -> None:
        """Learn from a whole sight how wide the line is."""
        self.half_width_m = 0.5 * (estimate.n_lines - 1) * (estimate.spacing_px or 0.0) * m_per_px

    def is_it(self, line: WorldLine, north_m: float, east_m: float, now_s: float, *, is_whole: bool) -> bool:
        """Whether a line seen from a place may be the known one; where a part is seen, its middle may lie beside it.

        One that has turned begins where the known one ends: they meet near the place.
        """
        if self.line is None:
            return True
        heading_rad = self.line.heading_rad
        turn_rad = abs(wrap_line_angle_rad(line.heading_rad - heading_rad))
        if turn_rad > MAX_TURN_RAD:
            return False
        drift_m = _DRIFT_M_S * max(0.0, now_s - self.seen_s)
        part_m = 0.0 if is_whole else self.half_width_m
        if turn_rad > _STRAIGHT_RAD:
            return line.meeting_m(self.line, north_m, east_m) <= min(_MOST_AWAY_M, _AWAY_M + part_m + 3.0 * drift_m)
        aside_m = line.offset_m(north_m, east_m, heading_rad) - self.line.offset_m(north_m, east_m, heading_rad)
        return abs(aside_m) <= min(_MOST_M, _TOLERANCE_M + drift_m) + part_m
