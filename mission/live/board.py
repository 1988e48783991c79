"""What the page shows, brought together from the records as they come. No I/O, and time is what it is told."""

import math
from collections import deque
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

from drivers.camera.camera import Intrinsics
from drivers.clock import NS_PER_S
from mission.autopilot import VehicleState
from mission.live.settings import Batch, Briefing
from mission.log.records import StatusText
from mission.log.wording import line_of, times_since
from mission.records import (
    Event,
    LineFix,
    MissionEnded,
    PreflightCheck,
    TaskEnded,
    TaskStarted,
    TrueLine,
)
from mission.reporting import Progress
from vision.records import VisionReport

_MAX_EVENTS = 100
_MAX_POINTS = 2000
_STEP_M = 0.3
_CHATTER = "mavsdk "  # the library talks to developers: its words are in the log, and what matters becomes an event


@dataclass(frozen=True, slots=True)
class Frame:
    """A camera frame as JPEG, and the lines found on it: x1, y1, x2, y2 [px]."""

    seq: int
    jpeg: bytes
    lines_px: tuple[tuple[float, ...], ...]


class Board:
    """Takes records with `add`; `state` and `map` are what the page asks for, ready for JSON, `frame` the newest."""

    def __init__(self) -> None:
        self.frame: Frame | None = None
        self.ended: MissionEnded | None = None
        self._n_dropped = 0
        self._briefing = Briefing("", ())
        self._start_ns: int | None = None  # of the first task, from which inspect counts, too
        self._newest_ns = 0
        self._progress: Progress | None = None
        self._vehicle: VehicleState | None = None
        self._vehicle_came_s = -math.inf
        self._sight: VisionReport | None = None
        self._camera: Intrinsics | None = None
        self._fix: LineFix | None = None
        self._true_axis_ne_m: tuple[tuple[float, float], ...] = ()
        self._track = _Track()
        self._fixes = _Track()
        self._times_since = "take-off"
        self._events: deque[tuple[int, dict[str, Any]]] = deque(maxlen=_MAX_EVENTS)
        self._checks: dict[str, dict[str, Any]] = {}

    def add(self, batch: Batch, now_s: float) -> None:
        """Take in records that came at `now_s` [s, any clock]; what the page does not show is passed over."""
        self._n_dropped = batch.n_dropped
        for record in batch.records:
            self._newest_ns = max(self._newest_ns, getattr(record, "t_ns", 0))
            if isinstance(record, VehicleState):
                self._vehicle_came_s = now_s
            take = _TAKE.get(type(record))
            if take is not None:
                take(self, record)

    def state(self, now_s: float) -> dict[str, Any]:
        """Where the flight stands, at `now_s` [s, the clock of `add`]; angles in degrees, for people.

        `t_s` [s] counts from the start of the first task, as a report's times do: None before it, negative for what
        came before it. It stands still when the mission has ended.
        """
        return {
            "mission": self._briefing.mission,
            "tasks": self._briefing.tasks,
            "t_s": self._flight_s(self._newest_ns if self.ended is None else self.ended.t_ns),
            "times_since": self._times_since,
            "progress": None if self._progress is None else _progress_words(self._progress),
            "vehicle": None if self._vehicle is None else _vehicle_words(self._vehicle),
            "vehicle_age_s": _rounded(now_s - self._vehicle_came_s),
            "vision": None if self._sight is None else _sight_words(self._sight),
            "frame": None if self.frame is None else {"seq": self.frame.seq, "lines_px": self.frame.lines_px},
            "camera_px": None if self._camera is None else (self._camera.width_px, self._camera.height_px),
            "line": None if self._fix is None else _fix_words(self._fix),
            "events": [{"t_s": self._flight_s(t_ns)} | words for t_ns, words in self._events],
            "checks": list(self._checks.values()),
            "ended": None
            if self.ended is None
            else {"result": self.ended.result.replace("_", " "), "reason": self.ended.reason},
            "n_dropped": self._n_dropped,
        }

    def map(self) -> dict[str, Any]:
        """The flight from above: north, east [m] in the autopilot's local frame."""
        return {"track": self._track.points, "fixes": self._fixes.points, "true_line": self._true_axis_ne_m}

    def take_briefing(self, briefing: Briefing) -> None:
        """A flight begins."""
        self._briefing = briefing

    def take_progress(self, progress: Progress) -> None:
        """Where the executive stands."""
        self._progress = progress

    def take_vehicle(self, state: VehicleState) -> None:
        """Telemetry came."""
        self._vehicle = state
        self._track.add(state.north_m, state.east_m)

    def take_sight(self, report: VisionReport) -> None:
        """Vision looked at a frame."""
        self._sight = report
        if report.jpeg is not None:
            lines = tuple(tuple(round(value, 1) for value in line) for line in report.power_lines.tolist())
            self.frame = Frame(report.seq, report.jpeg, lines)

    def take_camera(self, camera: Intrinsics) -> None:
        """The camera's size."""
        self._camera = camera

    def take_fix(self, fix: LineFix) -> None:
        """The line is known better."""
        self._fix = fix
        if fix.is_placed:
            self._fixes.add(fix.north_m, fix.east_m)

    def take_true_line(self, line: TrueLine) -> None:
        """The simulated line."""
        self._true_axis_ne_m = line.axis_ne_m

    def take_check(self, check: PreflightCheck) -> None:
        """A pre-flight check was made."""
        self._checks[check.name] = {"name": check.name, "result": check.result, "reason": check.reason}

    def take_words(self, record: Event | TaskStarted | TaskEnded | MissionEnded | StatusText) -> None:
        """Something happened."""
        if isinstance(record, StatusText) and record.text.startswith(_CHATTER):
            return
        who, severity, text = line_of(record)
        self._events.append((record.t_ns, {"who": who, "severity": severity, "text": text}))
        if isinstance(record, TaskStarted) and self._start_ns is None:
            self._start_ns = record.t_ns
            self._times_since = times_since(record.task)
        if isinstance(record, MissionEnded):
            self.ended = record

    def _flight_s(self, t_ns: int) -> float | None:
        return None if self._start_ns is None else round((t_ns - self._start_ns) / NS_PER_S, 2)


_TAKE: dict[type, Callable[[Board, Any], None]] = {
    Briefing: Board.take_briefing,
    Progress: Board.take_progress,
    VehicleState: Board.take_vehicle,
    VisionReport: Board.take_sight,
    Intrinsics: Board.take_camera,
    LineFix: Board.take_fix,
    TrueLine: Board.take_true_line,
    PreflightCheck: Board.take_check,
    Event: Board.take_words,
    TaskStarted: Board.take_words,
    TaskEnded: Board.take_words,
    MissionEnded: Board.take_words,
    StatusText: Board.take_words,
}


class _Track:
    """Points that lie apart; when there are too many, every second one goes."""

    def __init__(self) -> None:
        self.points: list[tuple[float, float]] = []
        self._step_m = _STEP_M

    def add(self, north_m: float, east_m: float) -> None:
        point = (round(north_m, 2), round(east_m, 2))
        if not math.isfinite(point[0] + point[1]):
            return
        if self.points and math.dist(point, self.points[-1]) < self._step_m:
            return
        self.points.append(point)
        if len(self.points) > _MAX_POINTS:
            self.points = self.points[::2]
            self._step_m *= 2.0


def _progress_words(progress: Progress) -> dict[str, Any]:
    words = asdict(progress)
    heading_rad = words.pop("heading_rad")
    for name in ("height_m", "distance_m"):
        words[name] = _rounded(words[name])
    return words | {"heading_deg": None if heading_rad is None else _degrees(heading_rad)}


def _vehicle_words(state: VehicleState) -> dict[str, Any]:
    return {
        "north_m": _rounded(state.north_m),
        "east_m": _rounded(state.east_m),
        "down_m": _rounded(state.down_m),
        "speed_m_s": _rounded(math.hypot(state.v_north_m_s, state.v_east_m_s)),
        "climb_m_s": _rounded(-state.v_down_m_s),
        "heading_deg": _degrees(state.yaw_rad),
        "mode": state.mode,
        "is_armed": state.is_armed,
        "landed": state.landed,
        "battery": state.battery,
        "is_connected": state.is_connected,
        "is_failsafe": state.is_failsafe,
        "is_position_ok": state.is_position_ok,
    }


def _sight_words(report: VisionReport) -> dict[str, Any]:
    return {"track": report.track, "trouble": report.trouble, "n_lines": len(report.power_lines)}


def _fix_words(fix: LineFix) -> dict[str, Any]:
    return {
        "north_m": _rounded(fix.north_m),
        "east_m": _rounded(fix.east_m),
        "heading_deg": _degrees(fix.heading_rad),
        "is_placed": fix.is_placed,
        "n_conductors": fix.n_conductors,
        "depth_m": _rounded(fix.depth_m),
    }


def _rounded(value: float | None) -> float | None:
    """JSON knows no infinity, and a page no more than two digits."""
    return None if value is None or not math.isfinite(value) else round(value, 2)


def _degrees(angle_rad: float) -> float | None:
    return None if not math.isfinite(angle_rad) else round(math.degrees(angle_rad) % 360.0, 1)
