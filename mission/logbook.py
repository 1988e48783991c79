"""The logbook: what the executive tells the journal, with places on Earth instead of the autopilot's local frame."""

import math
import time
from dataclasses import dataclass

from drivers.clock import NS_PER_S
from mission.autopilot import GlobalPoint, Setpoint
from mission.geodesy import point_at
from mission.journal import Begin, Journal, Place, Standing, Transition
from mission.resumption import Resumption
from mission.tasks.task import FlightMemory

_NOTE_PERIOD_S = 1.0


@dataclass(frozen=True, slots=True)
class FlightPapers:
    """What a journal must say about its flight, so that a resumed one is known to be the same."""

    mission: str
    mission_path: str
    mission_sha256: str
    connection: str
    camera: str
    log: str


class Logbook:
    """Keeps the journal of one flight; a local frame without an origin on Earth gives entries without places."""

    def __init__(self, journal: Journal, papers: FlightPapers) -> None:
        self._journal = journal
        self._papers = papers
        self._origin: GlobalPoint | None = None
        self._memory = FlightMemory(Setpoint(0.0, 0.0, 0.0, 0.0), 0.0)
        self._resumption: Resumption | None = None
        self._noted_ns: int | None = None

    async def begin(
        self, origin: GlobalPoint | None, memory: FlightMemory, vehicle_uid: str, resumption: Resumption | None
    ) -> None:
        """The flight begins; `origin` is the local frame's. A `resumption` has done a part of its first task before."""
        self._origin, self._memory, self._resumption = origin, memory, resumption
        papers = self._papers
        await self._journal.write(
            Begin(
                unix_s=time.time(),
                mission=papers.mission,
                mission_path=papers.mission_path,
                mission_sha256=papers.mission_sha256,
                vehicle_uid=vehicle_uid,
                connection=papers.connection,
                camera=papers.camera,
                log=papers.log,
                start=self._place(memory.start),
                origin=self._place(Setpoint(0.0, 0.0, 0.0, 0.0)),
                theta_0_rad=memory.theta_0_rad,
                resumed=None if resumption is None else resumption.standing,
            )
        )

    async def transition(
        self, source: str, target: str, task_index: int | None, progress: float, stand: Setpoint | None
    ) -> None:
        """The flight is about to go from one state to another; `stand` is where its task is to be taken up again."""
        await self._journal.write(
            Transition(
                unix_s=time.time(),
                source=source,
                target=target,
                task_index=task_index,
                progress=self._done_before(task_index) + progress,
                move_until_m=self._memory.move_until_m,
                place=None if stand is None else self._place(stand),
            )
        )

    def note(self, now_ns: int, task_index: int | None, progress: float, stand: Setpoint) -> None:
        """Say about once a second how far the task has come; called in every tick of a task that is not paused."""
        is_due = self._noted_ns is None or now_ns - self._noted_ns >= _NOTE_PERIOD_S * NS_PER_S
        if task_index is None or not is_due:
            return
        self._noted_ns = now_ns
        self._journal.note(
            Standing(
                unix_s=time.time(),
                task_index=task_index,
                progress=self._done_before(task_index) + progress,
                move_until_m=self._memory.move_until_m,
                place=self._place(stand),
            )
        )

    def _done_before(self, task_index: int | None) -> float:
        resumption = self._resumption
        return resumption.standing.progress if resumption is not None and resumption.index == task_index else 0.0

    def _place(self, at: Setpoint) -> Place | None:
        is_known = all(map(math.isfinite, (at.north_m, at.east_m, at.down_m, at.yaw_rad)))
        if self._origin is None or not is_known:
            return None
        point = point_at(at, self._origin)
        return Place(
            latitude_rad=point.latitude_rad,
            longitude_rad=point.longitude_rad,
            altitude_m=point.altitude_m,
            height_m=self._memory.start.down_m - at.down_m,
            yaw_rad=at.yaw_rad,
        )
