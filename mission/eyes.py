"""What the executive asks of vision, and how a report is put on the map."""

import math
from collections import deque
from dataclasses import dataclass
from typing import Protocol

from drivers.camera.camera import Intrinsics
from drivers.clock import NS_PER_S
from mission.autopilot import VehicleState
from mission.guidance import GuidanceSettings, bearing_of, wrap_angle_rad
from mission.known_line import Found, KnownLine, View
from mission.records import Event, LineFix, Severity
from mission.reporting import FlightLog
from mission.tasks.task import Sight
from vision.records import BLINDING, ImageLine, LineEstimate, VisionReport

_IN_VIEW = 0.85  # share of the frame across the line: a conductor in its very corner is too short to be found


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
    known: KnownLine,
    camera: Intrinsics,
    guidance: GuidanceSettings,
    ground_m: float,
    now_ns: int,
) -> Sight | None:
    """What a report means on the map, by what is `known` of the line, which learns from it.

    None when it is too old to steer, when nothing is known of that time, or when nothing can be seen in its frame. A
    line that cannot be the known one is none: it neither steers nor keeps the flight from missing its line.

    This is the one place where the age of an estimate is judged.
    """
    if report.trouble in BLINDING or now_ns - report.t_capture_ns > guidance.max_estimate_age_s * NS_PER_S:
        return None
    state = history.at(report.t_capture_ns)
    if state is None:
        return None
    view = None if report.estimate is None else view_of(report.estimate, state, camera, ground_m)
    found = None if view is None else known.see(view, guidance)
    return Sight(report.t_capture_ns, state.yaw_rad, state.north_m, state.east_m, state.down_m, found)


def view_of(estimate: LineEstimate, state: VehicleState, camera: Intrinsics, ground_m: float) -> View | None:
    """The estimate as seen from where the vehicle was, `ground_m` above the take-off point; None above the horizon."""
    middle = bearing_of(estimate.middle, state, camera)
    if middle is None:
        return None
    seen = (bearing_of(conductor, state, camera) for conductor in estimate.conductors or (estimate.middle,))
    across_px = camera.width_px * abs(math.cos(estimate.angle_rad)) + camera.height_px * abs(
        math.sin(estimate.angle_rad)
    )
    edges = [
        bearing_of(ImageLine(estimate.angle_rad, side * 0.5 * _IN_VIEW * across_px), state, camera)
        for side in (-1.0, 1.0)
    ]
    slopes = sorted(edge.along(middle.heading_rad).slope for edge in edges if edge is not None)
    return View(
        t_ns=estimate.t_capture_ns,
        north_m=state.north_m,
        east_m=state.east_m,
        down_m=state.down_m,
        ground_m=ground_m,
        middle=middle,
        conductors=tuple(bearing for bearing in seen if bearing is not None) or (middle,),
        in_view=(slopes[0], slopes[-1]) if len(slopes) == 2 else (-math.inf, math.inf),
        next_span=None if estimate.next_span is None else bearing_of(estimate.next_span, state, camera),
    )


def fix_of(t_ns: int, found: Found) -> LineFix:
    """What was found, for the log."""
    line = found.line
    return LineFix(
        t_ns,
        line.heading_rad,
        line.north_m,
        line.east_m,
        found.is_placed,
        found.n_conductors,
        found.depth_m,
        found.height_m,
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
        self.sight_ns = 0
        self.line_seen_ns = 0

    def expect(self, now_ns: int) -> None:
        """Something that needs eyes begins now: both times are at least this one."""
        self.sight_ns = max(self.sight_ns, now_ns)
        self.line_seen_ns = max(self.line_seen_ns, now_ns)

    def look(self, now_ns: int, state: VehicleState, known: KnownLine, ground_m: float) -> Sight | None:
        """The newest report since the last look, on the map; those before it only make the line better known.

        The vehicle is `ground_m` above the take-off point.
        """
        self._history.add(state)
        self.keep_notices(now_ns)
        newest = None
        for report in self._eyes.take():
            self._log.record(report)
            sight = sight_of(report, self._history, known, self._camera, self._guidance, ground_m, now_ns)
            newest = sight or newest
            if sight is None:
                continue
            self.sight_ns = max(self.sight_ns, sight.t_capture_ns)
            if sight.found is not None:
                self.line_seen_ns = max(self.line_seen_ns, sight.t_capture_ns)
                self._log.record(fix_of(sight.t_capture_ns, sight.found))
        return newest

    def keep_notices(self, now_ns: int) -> None:
        """Put into the log what happened to the eyes."""
        for notice in self._eyes.take_notices():
            self._log.record(Event(now_ns, notice.name, Severity.WARNING, notice.message))
