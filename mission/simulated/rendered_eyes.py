"""Eyes in virtual time: the simulated camera and the vision worker's own steps, in threads of this process.

Frames are taken at their exact times along the simulated vehicle's way. Rendering and vision go on in two threads while
the flight goes on, and a report is handed over when its latency has passed, so that the same flight gives the same
reports, to the bit, on a fast computer and on a slow one.
"""

from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from drivers.camera.camera import Frame
from drivers.clock import NS_PER_S
from mission.eyes import Notice
from mission.simulated.in_process import InProcessAutopilot
from sitl.pose import Pose
from sitl.render.motion import Motion
from vision.pipeline import LineFinder, VisionSettings
from vision.records import BLINDING, VisionReport
from vision.worker_process import Reporter

LATENCY_S = 0.06
"""From capture to the estimate: what a companion computer needs, at a camera's exposure and transfer included."""

IDLE_RATE_HZ = 5.0
"""Frames a second in tasks that need no eyes, as a take-off: rendering takes nearly all of a flight's time."""

Photograph = Callable[[Motion, int], NDArray[np.uint8]]
"""The image (height, width, 3) uint8 BGR at a pose in motion; the second argument is the frame's number."""


@dataclass(slots=True)
class _StoppedClock:
    """Shows the time at which a frame's report will be there."""

    t_ns: int = 0

    def now_ns(self) -> int:
        """That time [ns]."""
        return self.t_ns

    def wall_s(self, flight_s: float) -> float:
        """Nobody waits by this clock."""
        return 0.0


class RenderedEyes:
    """mission.eyes.Eyes on the vehicle of `autopilot`; a context manager, which warms up and ends the threads.

    `photograph` renders in a thread of its own. `log_rate_hz` [1/s] says how often a report carries its frame. While
    `is_needed` says that nobody steers by what is seen, only IDLE_RATE_HZ frames a second are taken, and the others
    count as dropped.
    """

    failure: str | None = None

    def __init__(
        self,
        autopilot: InProcessAutopilot,
        photograph: Photograph,
        settings: VisionSettings,
        rate_hz: float,
        log_rate_hz: float,
        is_needed: Callable[[], bool] = lambda: True,
    ) -> None:
        self._is_needed = is_needed
        self._autopilot = autopilot
        self._photograph = photograph
        self._finder = LineFinder(settings)
        self._clock = _StoppedClock()
        self._reporter = Reporter(self._finder, self._clock, log_rate_hz)
        self._period_ns = NS_PER_S / rate_hz
        self._n_frames = 0
        self._last_ns = 0
        self._waiting: deque[tuple[int, Future[VisionReport]]] = deque()
        self._last: VisionReport | None = None
        self._notices: list[Notice] = []
        self._camera_thread = ThreadPoolExecutor(1, "camera")
        self._vision_thread = ThreadPoolExecutor(1, "vision")

    def __enter__(self) -> Self:
        self._finder.warm_up()
        self._autopilot.after_step.append(self._expose)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._autopilot.after_step.remove(self._expose)
        for executor in (self._camera_thread, self._vision_thread):
            executor.shutdown(cancel_futures=True)

    @property
    def missing(self) -> str | None:
        """What a flight would still have to wait for."""
        if self._last is None:
            return "the first frame through vision"
        return f"a camera whose frames are not {self._last.trouble}" if self._last.trouble in BLINDING else None

    @property
    def impairment(self) -> Notice | None:
        """What keeps the eyes from seeing at the moment."""
        if self._last is None or self._last.trouble not in BLINDING:
            return None
        return Notice("camera_blind", f"the camera's frames are {self._last.trouble}")

    def take(self) -> list[VisionReport]:
        """The reports that are due, oldest first; waits for the threads where the flight is ahead of them."""
        self._autopilot.catch_up()
        now_ns = self._now_ns
        reports = []
        while self._waiting and self._waiting[0][0] <= now_ns:
            reports.append(self._waiting.popleft()[1].result())
        for report in reports:
            was_blind = self.impairment is not None
            self._last = report
            if not was_blind and self.impairment is not None:
                self._notices.append(self.impairment)
        return reports

    def take_notices(self) -> list[Notice]:
        """What happened since the last call."""
        notices, self._notices = self._notices, []
        return notices

    @property
    def _now_ns(self) -> int:
        return round(self._autopilot.sim.boot_s * NS_PER_S)

    def _expose(self) -> None:
        """Take a frame when it is time to; called after each step of the vehicle."""
        now_ns = self._now_ns
        if now_ns < self._n_frames * self._period_ns:
            return
        seq = self._n_frames
        self._n_frames += 1
        if not self._is_needed() and now_ns < self._last_ns + NS_PER_S / IDLE_RATE_HZ:
            return
        self._last_ns = now_ns
        vehicle = self._autopilot.sim.vehicle
        pose = Pose(now_ns, *vehicle.position_m, vehicle.quaternion)
        motion = Motion(pose, vehicle.velocity_m_s, vehicle.rates_rad_s)
        due_ns = now_ns + round(LATENCY_S * NS_PER_S)
        image = self._camera_thread.submit(self._photograph, motion, seq)
        self._waiting.append((due_ns, self._vision_thread.submit(self._look, seq, now_ns, due_ns, image)))

    def _look(self, seq: int, t_capture_ns: int, due_ns: int, image: Future[NDArray[np.uint8]]) -> VisionReport:
        self._clock.t_ns = due_ns
        report = self._reporter.report(Frame(seq, t_capture_ns, image.result()))
        return replace(report, work_ns=0)  # wall time would make two flights differ
