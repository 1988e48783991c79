"""The vision worker as the executive's eyes: a worker that dies or hangs is started again."""

import time
from collections.abc import Callable

from drivers.clock import NS_PER_S, Clock
from mission.eyes import Notice
from vision.records import VisionReport
from vision.worker import CameraBack, CameraGone, VisionWorker, WorkerFailed, WorkerReady

SILENCE_LIMIT_S = 3.0
"""Without a report for so long [s, flight], vision counts as dead, whatever is being done about it."""

_HANG_LIMIT_S = 1.0  # wall: a worker that works on frames is never silent for so long
_START_LIMIT_S = 30.0  # wall: even a slow computer has started Python and opened a camera by then
_RESTART_PAUSE_S = 0.5  # wall


class WorkerEyes:
    """Collects the worker's reports, and starts a new worker in place of one that failed or hangs.

    `make_worker` makes a worker that was not started. Until the first frame went through vision, a failure is final:
    on the ground a person should hear of it. After that the worker may die and come back: `failure` speaks only once
    nothing was seen for SILENCE_LIMIT_S, and is silent again when the reports come again. Call `start` first and `stop`
    at the end.
    """

    def __init__(self, make_worker: Callable[[], VisionWorker], clock: Clock) -> None:
        self._make_worker = make_worker
        self._clock = clock
        self._worker = make_worker()
        self._retired: list[VisionWorker] = []
        self._reports: list[VisionReport] = []
        self._notices: list[Notice] = []
        self._is_running = False  # this worker has got ready
        self._is_camera_gone = False
        self._news_s = time.monotonic()  # when this worker spoke last, or was started
        self._restart_at_s: float | None = None
        self._last_report_ns: int | None = None
        self._failed: str | None = None

    def start(self) -> None:
        """Start the first worker."""
        self._news_s = time.monotonic()
        self._worker.start()

    def stop(self) -> None:
        """End every worker that was started. Waits for them, some seconds at most."""
        for worker in (*self._retired, self._worker):
            worker.stop()

    @property
    def failure(self) -> str | None:
        """Why there is nothing to be seen, in one sentence; None while all is well."""
        self._collect()
        if self._failed is not None:
            return self._failed
        if self._last_report_ns is None:
            return None
        silence_s = (self._clock.now_ns() - self._last_report_ns) / NS_PER_S
        return f"vision has seen nothing for {silence_s:.1f} s" if silence_s > SILENCE_LIMIT_S else None

    @property
    def is_ready(self) -> bool:
        """Whether the kernels are compiled and the camera has given a frame."""
        self._collect()
        return self._last_report_ns is not None

    def take(self) -> list[VisionReport]:
        """The reports since the last call, oldest first."""
        self._collect()
        reports, self._reports = self._reports, []
        return reports

    def take_notices(self) -> list[Notice]:
        """What happened to worker and camera since the last call, oldest first."""
        self._collect()
        notices, self._notices = self._notices, []
        return notices

    def _collect(self) -> None:
        now_s = time.monotonic()
        for news in self._worker.poll():
            self._news_s = now_s
            if isinstance(news, VisionReport):
                self._reports.append(news)
                self._last_report_ns = self._clock.now_ns()
            elif isinstance(news, WorkerReady):
                self._is_running = True
            elif isinstance(news, CameraGone):
                self._is_camera_gone = True
                self._notices.append(Notice("camera_gone", news.message))
            elif isinstance(news, CameraBack):
                self._is_camera_gone = False
                self._notices.append(Notice("camera_back", "the camera gives frames again"))
            elif isinstance(news, WorkerFailed):
                self._on_failure(news, now_s)
        self._watch(now_s)

    def _on_failure(self, news: WorkerFailed, now_s: float) -> None:
        if news.is_final or self._last_report_ns is None:
            self._failed = news.message
        else:
            self._notices.append(Notice("vision_restarted", news.message))
            self._restart_at_s = now_s + _RESTART_PAUSE_S

    def _watch(self, now_s: float) -> None:
        """Start a new worker when it is time to, or when this one hangs."""
        if self._failed is not None or self._last_report_ns is None:
            return
        if self._restart_at_s is None:
            limit_s = _HANG_LIMIT_S if self._is_running else _START_LIMIT_S
            if self._is_camera_gone or now_s - self._news_s <= limit_s:
                return
            self._notices.append(Notice("vision_restarted", f"the vision worker was silent for {limit_s:g} s"))
        elif now_s < self._restart_at_s:
            return
        # Killed, not stopped: the control loop has no time to wait for a process that hangs.
        self._worker.kill()
        self._retired.append(self._worker)
        self._worker = self._make_worker()
        self._restart_at_s, self._is_running, self._is_camera_gone = None, False, False
        self._news_s = now_s
        self._worker.start()
