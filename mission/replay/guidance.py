"""Run today's guidance on the states that a log kept, and on what vision says today."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from drivers.camera.camera import Intrinsics
from drivers.clock import NS_PER_S
from mission.autopilot import Setpoint
from mission.build import build_task, guidance_settings, setpoint_limits
from mission.eyes import Lookout, Notice
from mission.guidance import GuidanceSettings, leash
from mission.log.reader import Flight
from mission.log.records import SentSetpoint
from mission.plan import MissionPlan
from mission.records import Event, LineFix
from mission.replay.pairing import Moment
from mission.safety import PAUSES
from mission.tasks.task import FlightMemory, Observation, Task
from vision.records import VisionReport

_PHASE_NS = round(0.3 * NS_PER_S)  # a setpoint older than this belongs to an earlier phase of offboard control
_CARRIED_ON = "carried_on"


@dataclass(frozen=True, slots=True)
class ReplayedTick:
    """A control tick at which a setpoint was sent: the one of the flight, and today's from the same situation."""

    t_ns: int
    task: str
    flown: Setpoint
    replayed: Setpoint


@dataclass(slots=True)
class _ReplayedEyes:
    """mission.eyes.Eyes on reports that are there already: those of the tick."""

    reports: Sequence[VisionReport] = ()
    failure: str | None = None
    missing: str | None = None
    impairment: Notice | None = None

    def take(self) -> list[VisionReport]:
        """The reports that the tick took."""
        return list(self.reports)

    def take_notices(self) -> list[Notice]:
        """Nothing happens to these eyes."""
        return []


@dataclass(slots=True)
class _Fixes:
    """A mission.reporting.FlightLog that keeps where the line was found."""

    fixes: list[LineFix] = field(default_factory=list)

    def record(self, item: object) -> None:
        """Keep a fix."""
        if isinstance(item, LineFix):
            self.fixes.append(item)

    def record_setpoint(self, t_ns: int, setpoint: Setpoint) -> None:
        """Nobody steers."""

    def record_status_text(self, t_ns: int, text: str) -> None:
        """Nobody speaks."""


def replay_guidance(
    flight: Flight, plan: MissionPlan, camera: Intrinsics, moments: Sequence[Moment]
) -> Iterator[ReplayedTick]:
    """What today's task would have sent at each tick that sent a setpoint.

    It starts from the flight's setpoint before the tick, and sees what the flight's `moments` hold. Since each tick
    starts from where the flight was, a difference does not grow from tick to tick. Tasks that the flight did not reach
    are not flown, searches and pauses are passed over. `plan` is what was flown.
    """
    if not flight.states:
        return
    guidance, leash_m = guidance_settings(plan.guidance), setpoint_limits(plan).leash_m
    memory = _memory(flight, guidance)
    start = memory.start
    eyes = _ReplayedEyes()
    lookout = Lookout(eyes, _Fixes(), camera, guidance)
    timeline = _Timeline(flight)
    task: Task | None = None
    index: int | None = None
    for moment in moments:
        tick, state = moment.tick, moment.state
        if state is None:
            continue
        eyes.reports = moment.reports
        flown_index = timeline.task_at(tick.t_ns)
        if flown_index != index:
            index = flown_index
            is_known = index is not None and index < len(plan.tasks)
            task = build_task(plan.tasks[index], guidance, memory) if is_known and index is not None else None
        if not state.is_position_ok:
            memory.known_line.forget()
        memory.trail.add(state)
        sight = lookout.look(tick.t_ns, state, memory.known_line, start.down_m - state.down_m)
        if sight is not None and sight.found is not None:
            memory.line_seen_at = Setpoint(state.north_m, state.east_m, state.down_m, state.yaw_rad)
        before, sent = timeline.setpoints_at(tick.t_ns)
        if task is None or before is None or timeline.is_paused_at(tick.t_ns):
            continue
        step = task.step(before, Observation(tick.dt_s, state, sight))
        if step.setpoint is not None and sent is not None and index is not None:
            yield ReplayedTick(tick.t_ns, plan.tasks[index].task, sent, leash(step.setpoint, state, leash_m))


class _Timeline:
    """What a flight's records say of a tick; asked for ticks in their order."""

    def __init__(self, flight: Flight) -> None:
        self._setpoints = flight.setpoints
        # A task that ends at the time at which the next one starts comes first.
        ends: list[tuple[int, int | None]] = [(ended.t_ns, None) for ended in flight.tasks_ended]
        starts: list[tuple[int, int | None]] = [(started.t_ns, started.index) for started in flight.tasks_started]
        self._changes = sorted([*ends, *starts], key=lambda change: (change[0], change[1] is not None))
        self._pauses = _pauses(flight.events)
        self._ticks = [tick.t_ns for tick in flight.ticks] + [flight.end_ns + 1]
        self._setpoint = self._tick = -1

    def task_at(self, t_ns: int) -> int | None:
        """The task that ran when the tick began; one that started in a tick is flown from the next one on."""
        running = None
        for change_ns, index in self._changes:
            if change_ns < t_ns:
                running = index
        return running

    def setpoints_at(self, t_ns: int) -> tuple[Setpoint | None, Setpoint | None]:
        """The setpoint before the tick, and the one that it sent; None where there was none of this phase."""
        self._tick += 1
        while self._ticks[self._tick] != t_ns:
            self._tick += 1
        while self._setpoint + 1 < len(self._setpoints) and self._setpoints[self._setpoint + 1].t_ns < t_ns:
            self._setpoint += 1
        before = self._setpoints[self._setpoint] if self._setpoint >= 0 else None
        after = self._setpoints[self._setpoint + 1] if self._setpoint + 1 < len(self._setpoints) else None
        is_of_phase = before is not None and t_ns - before.t_ns < _PHASE_NS
        is_sent = after is not None and after.t_ns < self._ticks[self._tick + 1]
        return (
            _plain(before) if is_of_phase and before is not None else None,
            _plain(after) if is_sent and after is not None else None,
        )

    def is_paused_at(self, t_ns: int) -> bool:
        """Whether a pause or a search was flown then instead of the task."""
        return any(start_ns <= t_ns <= end_ns for start_ns, end_ns in self._pauses)


def _pauses(events: Sequence[Event]) -> list[tuple[int, int]]:
    """From each reaction that pauses a task to where it was carried on."""
    pauses: list[tuple[int, int]] = []
    since_ns: int | None = None
    for event in events:
        if event.name == _CARRIED_ON and since_ns is not None:
            pauses.append((since_ns, event.t_ns))
            since_ns = None
        elif event.reaction in PAUSES and since_ns is None:
            since_ns = event.t_ns
    return pauses if since_ns is None else [*pauses, (since_ns, math.inf)]  # type: ignore[list-item]


def _plain(sent: SentSetpoint) -> Setpoint:
    return Setpoint(sent.north_m, sent.east_m, sent.down_m, sent.yaw_rad)


def _memory(flight: Flight, guidance: GuidanceSettings) -> FlightMemory:
    """What tasks knew of the flight's beginning; older logs do not tell, and begin where the first state was."""
    began = flight.start
    if began is None:
        first = flight.states[0]
        start = Setpoint(first.north_m, first.east_m, first.down_m, first.yaw_rad)
        return FlightMemory(start, first.yaw_rad if guidance.theta_0_rad is None else guidance.theta_0_rad)
    start = Setpoint(began.north_m, began.east_m, began.down_m, began.yaw_rad)
    return FlightMemory(start, began.theta_0_rad, began.move_until_m)
