"""The line over time: which estimates go on where the last one was, and whether the line is being tracked or lost.

One frame may show a fence for the line, or a part of the group; and where a line was a moment ago, less is enough to go
on with it than it takes to find one. A vehicle turns and drifts only so fast, so an estimate
that jumps is withheld until the next frames say the same. Nothing is smoothed and nothing is made up: what comes out is
the frame's own estimate, or None.
"""

import math
from dataclasses import dataclass, replace

from drivers.clock import NS_PER_S
from vision.records import LineEstimate, Track, wrap_line_angle_rad


@dataclass(frozen=True, slots=True)
class TrackSettings:
    """How far the line may move between two frames, and how often a jump must repeat itself before it is believed.

    Rates are those of a vehicle that turns and rolls briskly; times are flight time. The middle of a group may move by
    half a spacing more for each conductor that came into view or left it.
    """

    max_turn_rad_s: float = math.radians(120.0)
    turn_slack_rad: float = math.radians(5.0)
    max_drift_s: float = 1.5  # shares of the frame's diagonal in a second
    max_gap_s: float = 0.3  # after a longer one the line may be anywhere, and is confirmed anew
    drift_slack_share: float = 0.03  # of the frame's diagonal
    n_confirm: int = 2  # frames in a row that agree, before a line is tracked
    n_jump: int = 5  # frames in a row that agree on another place, before the track moves there
    lost_after_s: float = 1.0
    hold_presence: float = 0.65  # of a frame that goes on with the track, in place of the 1 that a line needs by itself
    hold_s: float = 1.0  # at most for so long


class LineTracker:
    """Judges one frame after the other, in the order of their capture times. `diagonal_px` is the frame's."""

    def __init__(self, settings: TrackSettings) -> None:
        self._settings = settings
        self._tracked: LineEstimate | None = None
        self._candidate: LineEstimate | None = None
        self._n_agreeing = 0
        self._has_tracked = False
        self._last_frame_ns = 0
        self._last_present_ns = 0

    def update(
        self, estimate: LineEstimate | None, t_capture_ns: int, diagonal_px: float
    ) -> tuple[Track, LineEstimate | None]:
        """How the frame taken at `t_capture_ns` continues the track, and its estimate where that counts, else None."""
        settings, tracked = self._settings, self._tracked
        # A camera that is slower than the gap still tracks from each frame to the next.
        was_in_last_frame = tracked is not None and tracked.t_capture_ns == self._last_frame_ns
        self._last_frame_ns = t_capture_ns
        if tracked is not None and not was_in_last_frame and elapsed_s(tracked, t_capture_ns) > settings.lost_after_s:
            self._tracked = tracked = None
        is_recent = tracked is not None and (
            was_in_last_frame or elapsed_s(tracked, t_capture_ns) <= settings.max_gap_s
        )
        goes_on = (
            estimate is not None
            and tracked is not None
            and is_recent
            and self._agrees(tracked, estimate, diagonal_px)
            and (estimate.presence >= 1.0 or self._may_hold(estimate))
        )
        if estimate is not None and goes_on:
            return self._accept(estimate)
        if estimate is None or estimate.presence < 1.0:
            self._candidate, self._n_agreeing = None, 0
            return self._without(), None
        is_again = self._candidate is not None and self._agrees(self._candidate, estimate, diagonal_px)
        self._candidate = estimate
        self._n_agreeing = self._n_agreeing + 1 if is_again else 1
        if self._n_agreeing >= (settings.n_jump if is_recent else settings.n_confirm):
            return self._accept(estimate)
        return self._without(), None

    def _may_hold(self, estimate: LineEstimate) -> bool:
        """Whether an estimate is sure enough to go on with what is tracked."""
        held_s = max(0, estimate.t_capture_ns - self._last_present_ns) / NS_PER_S
        return estimate.presence >= self._settings.hold_presence and held_s <= self._settings.hold_s

    def _accept(self, estimate: LineEstimate) -> tuple[Track, LineEstimate]:
        if estimate.presence >= 1.0:
            self._last_present_ns = estimate.t_capture_ns
        self._tracked, self._has_tracked = estimate, True
        self._candidate, self._n_agreeing = None, 0
        return Track.TRACKING, estimate

    def _without(self) -> Track:
        if self._tracked is not None:
            return Track.DOUBTFUL
        return Track.LOST if self._has_tracked else Track.SEARCHING

    def _agrees(self, before: LineEstimate, now: LineEstimate, diagonal_px: float) -> bool:
        """Whether the line may have moved from the one place to the other in that time."""
        if before.next_span is not None:
            # The span beyond a bend is the same line: the vehicle may be over it now.
            beyond = replace(before, angle_rad=before.next_span.angle_rad, offset_px=before.next_span.offset_px)
            if self._agrees(replace(beyond, next_span=None), now, diagonal_px):
                return True
        settings = self._settings
        moving_s = elapsed_s(before, now.t_capture_ns)
        now = seen_along(now, before.angle_rad)
        turn_rad = abs(now.angle_rad - before.angle_rad)
        allowed_px = (settings.drift_slack_share + settings.max_drift_s * moving_s) * diagonal_px
        spacing_px = now.spacing_px or before.spacing_px or 0.0
        allowed_px += 0.5 * spacing_px * abs(now.n_lines - before.n_lines)
        return (
            turn_rad <= settings.turn_slack_rad + settings.max_turn_rad_s * moving_s
            and abs(now.offset_px - before.offset_px) <= allowed_px
        )


def elapsed_s(since: LineEstimate, t_ns: int) -> float:
    """Flight time [s] from an estimate's capture to `t_ns`."""
    return max(0, t_ns - since.t_capture_ns) / NS_PER_S


def seen_along(estimate: LineEstimate, angle_rad: float) -> LineEstimate:
    """The same line with its angle within pi / 2 of `angle_rad`, unwrapped; its offset changes sign with its normal."""
    turn_rad = wrap_line_angle_rad(estimate.angle_rad - angle_rad)
    is_turned_over = math.cos(angle_rad + turn_rad - estimate.angle_rad) < 0
    offset_px = -estimate.offset_px if is_turned_over else estimate.offset_px
    return replace(estimate, angle_rad=angle_rad + turn_rad, offset_px=offset_px)
