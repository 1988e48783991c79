"""What the executive asks of vision, and how a report is put on the map."""

from collections import deque
from dataclasses import dataclass, replace
from typing import Protocol

from drivers.camera.camera import Intrinsics
from drivers.clock import NS_PER_S
from mission.autopilot import VehicleState
from mission.guidance import GuidanceSettings, height_over_m, locate_line, wrap_angle_rad
from mission.known_line import KnownLine
from mission.records import Event, Severity
from mission.reporting import FlightLog
from mission.tasks.task import Sight
from vision.records import BLINDING, VisionReport


@dataclass(frozen=True, slots=True)
class Notice:
    """Something that happened to the eyes: `name` is one of the events in docs/safety.md, `message` a sentence."""

    name: str
    message: str


class Eyes(Protocol):
    """The source of vision reports: the vision worker, or a test's."""

    @property
    def failure(self) -> str | None:
        """Why there is nothing to be seen, in one sentence; None while all is well."""
        ...

    @property
    def missing(self) -> str | None:
        """What a flight would still have to wait for; None where the eyes see."""
        ...

    @property
    def impairment(self) -> Notice | None:
        """What keeps the eyes from seeing at the moment: camera_gone or camera_blind; None while they see."""
        ...

    def take(self) -> list[VisionReport]:
        """The reports since the last call, oldest first."""
        ...

    def take_notices(self) -> list[Notice]:
        """What happened since the last call, oldest first."""
        ...


class StateHistory:
    """The vehicle's states of the last seconds: a frame is matched with where the vehicle was when it was taken."""

    def __init__(self, span_s: float = 2.0) -> None:
        self._span_ns = round(span_s * NS_PER_S)
        self._states: deque[VehicleState] = deque()

    def add(self, state: VehicleState) -> None:
        """Keep a state; one that is not newer than the last is ignored."""
        if self._states and state.t_ns <= self._states[-1].t_ns:
            return
        self._states.append(state)
        while self._states[0].t_ns < state.t_ns - self._span_ns:
            self._states.popleft()

    def at(self, t_ns: int) -> VehicleState | None:
        """The state at a time, interpolated linearly; the nearest one outside the history. None while empty."""
        if not self._states:
            return None
        later = None
        for earlier in reversed(self._states):
            if earlier.t_ns <= t_ns:
                return earlier if later is None else _interpolate(earlier, later, t_ns)
            later = earlier
        return later


class GroupSize:
    """How many conductors the line has, from what was counted lately.

    A tilted camera may show a part of the group only; its middle is then not the line's. The size is the largest count
    that a tenth of the last frames, and three at least, have shown: one wrong count does not make the line larger.
    """

    def __init__(self, window: int = 200) -> None:
        self._counts: deque[int] = deque(maxlen=window)

    def is_whole(self, n_lines: int) -> bool:
        """Take one more count, and say whether it is the whole group as far as known."""
        self._counts.append(n_lines)
        enough = max(3, len(self._counts) // 10)
        sizes = [size for size in set(self._counts) if self._counts.count(size) >= enough]
        return n_lines >= max(sizes, default=0)


def _interpolate(earlier: VehicleState, later: VehicleState, t_ns: int) -> VehicleState:
    share = (t_ns - earlier.t_ns) / (later.t_ns - earlier.t_ns)

    def between(a: float, b: float) -> float:
        return a + share * (b - a)

    def between_angles(a_rad: float, b_rad: float) -> float:
        return wrap_angle_rad(a_rad + share * wrap_angle_rad(b_rad - a_rad))

    return VehicleState(
        t_ns=t_ns,
        north_m=between(earlier.north_m, later.north_m),
        east_m=between(earlier.east_m, later.east_m),
        down_m=between(earlier.down_m, later.down_m),
        v_north_m_s=between(earlier.v_north_m_s, later.v_north_m_s),
        v_east_m_s=between(earlier.v_east_m_s, later.v_east_m_s),
        v_down_m_s=between(earlier.v_down_m_s, later.v_down_m_s),
        roll_rad=between_angles(earlier.roll_rad, later.roll_rad),
        pitch_rad=between_angles(earlier.pitch_rad, later.pitch_rad),
        yaw_rad=between_angles(earlier.yaw_rad, later.yaw_rad),
        mode=later.mode,
        is_armed=later.is_armed,
        landed=later.landed,
        battery=later.battery,
        is_connected=later.is_connected,
        is_failsafe=later.is_failsafe,
        is_position_ok=later.is_position_ok,
    )


def sight_of(
    report: VisionReport,
    history: StateHistory,
    group: GroupSize,
    camera: Intrinsics,
    guidance: GuidanceSettings,
    now_ns: int,
) -> Sight | None:
    """What a report means on the map.

    None when it is too old to steer, when nothing is known of that time, or when nothing can be seen in its frame.

    This is the one place where the age of an estimate is judged.
    """
    if report.trouble in BLINDING or now_ns - report.t_capture_ns > guidance.max_estimate_age_s * NS_PER_S:
        return None
    state = history.at(report.t_capture_ns)
    if state is None:
        return None
    line, next_line, height_m, is_whole = None, None, None, False
    estimate = report.estimate
    if estimate is not None:
        is_whole = group.is_whole(estimate.n_lines)
        height_m = None
        if is_whole:
            height_m = height_over_m(estimate, camera, guidance.conductor_spacing_m, guidance.height_over_line_m)
        line = locate_line(estimate, state, camera, height_m or guidance.height_over_line_m)
        if estimate.next_span is not None:
            span = estimate.next_span
            beyond = replace(estimate, angle_rad=span.angle_rad, offset_px=span.offset_px)
            next_line = locate_line(beyond, state, camera, height_m or guidance.height_over_line_m)
    return Sight(
        report.t_capture_ns,
        state.yaw_rad,
        estimate,
        line,
        is_whole,
        state.north_m,
        state.east_m,
        state.down_m,
        next_line,
        height_m,
    )


class Lookout:
    """Keeps what is needed to make a sight of each report.

    `sight_ns` is when the newest frame that can be looked at was taken, `line_seen_ns` when the newest line was seen.
    """

    def __init__(self, eyes: Eyes, log: FlightLog, camera: Intrinsics, guidance: GuidanceSettings) -> None:
        self._eyes = eyes
        self._log = log
        self._camera = camera
        self._guidance = guidance
        self._history = StateHistory()
        self._group = GroupSize()
        self.sight_ns = 0
        self.line_seen_ns = 0

    def expect(self, now_ns: int) -> None:
        """Something that needs eyes begins now: both times are at least this one."""
        self.sight_ns = max(self.sight_ns, now_ns)
        self.line_seen_ns = max(self.line_seen_ns, now_ns)

    def look(self, now_ns: int, state: VehicleState, known: KnownLine) -> Sight | None:
        """The newest report since the last look, on the map; the older ones are kept in the log alone.

        A line that cannot be the known one is none: it neither steers nor keeps the flight from missing its line.
        """
        self._history.add(state)
        self.keep_notices(now_ns)
        reports = self._eyes.take()
        for report in reports:
            self._log.record(report)
        if not reports:
            return None
        sight = sight_of(reports[-1], self._history, self._group, self._camera, self._guidance, now_ns)
        if sight is not None:
            sight = self._recognise(sight, known)
            self.sight_ns = max(self.sight_ns, sight.t_capture_ns)
            if sight.line is not None:
                self.line_seen_ns = max(self.line_seen_ns, sight.t_capture_ns)
        return sight

    def _recognise(self, sight: Sight, known: KnownLine) -> Sight:
        """Take the line out of a sight that shows another one than is known; else know it better."""
        if sight.line is None or sight.estimate is None or known.line is None:
            return sight
        now_s, north_m, east_m, span = sight.t_capture_ns / NS_PER_S, sight.north_m, sight.east_m, sight.next_line
        is_here = known.is_it(sight.line, north_m, east_m, now_s, is_whole=sight.is_whole)
        if not is_here and span is not None and known.is_it(span, north_m, east_m, now_s, is_whole=sight.is_whole):
            return replace(sight, line=span, next_line=None, height_m=None)
        if not is_here:
            return replace(sight, estimate=None, line=None, next_line=None, height_m=None, is_whole=False)
        if sight.is_whole:
            known.follow(sight.line, now_s)
            known.measure(sight.estimate, self._guidance.height_over_line_m / self._camera.fx_px)
        return sight

    def keep_notices(self, now_ns: int) -> None:
        """Put into the log what happened to the eyes."""
        for notice in self._eyes.take_notices():
            self._log.record(Event(now_ns, notice.name, Severity.WARNING, notice.message))
