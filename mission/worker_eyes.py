"""The vision worker as the executive's eyes: a worker that dies or hangs is started again."""

import time
from collections import deque
from collections.abc import Callable

from drivers.clock import NS_PER_S, Clock
from mission.eyes import Notice
from vision.records import BLINDING, Trouble, VisionReport
from vision.worker import CameraBack, CameraGone, VisionWorker, WorkerFailed, WorkerReady

SILENCE_LIMIT_S = 3.0
"""When nothing was seen for so long [s, flight], vision counts as dead, whatever is being done about it."""

_HANG_LIMIT_S = 1.0  # wall: a worker that gets frames is not silent for so long, at 3 a second or more
_HANG_LIMIT_PERIODS = 3.0  # slower cameras may be
_START_LIMIT_S = 30.0  # wall: even a slow computer has started Python and opened a camera by then
_RESTART_PAUSE_S = 0.5  # wall
_MAX_RESTARTS = 3
_RESTARTS_WINDOW_S = 30.0  # wall


class WorkerEyes:
    """Collects the worker's reports, and starts a new worker in place of one that failed or hangs.

    `make_worker` makes a worker that was not started, `frame_period_s` [s, wall] is its camera's. Until the first frame
    went through vision a failure is final: on the ground a person should hear of it. After that the worker may die and
    come back; `failure` speaks once nothing was seen for SILENCE_LIMIT_S, and is silent again when something is. A
    worker that has failed _MAX_RESTARTS times in half a minute is given up. Call `start` first, `stop` at the end.
    """

    def __init__(
        self,
        make_worker: Callable[[], VisionWorker],
        clock: Clock,
        frame_period_s: float,
        monotonic_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._make_worker = make_worker
        self._clock = clock
        self._hang_limit_s = max(_HANG_LIMIT_S, _HANG_LIMIT_PERIODS * frame_period_s)
        self._monotonic_s = monotonic_s
        self._worker = make_worker()
        self._retired: list[VisionWorker] = []
        self._reports: list[VisionReport] = []
        self._notices: list[Notice] = []
        self._is_running = False  # this worker has got ready
        self._is_camera_gone = False
        self._trouble: Trouble | None = None
        self._news_s = 0.0  # when this worker spoke last, or was started
        self._restart_at_s: float | None = None
        self._restarts_s: deque[float] = deque(maxlen=_MAX_RESTARTS)
        self._seen_ns: int | None = None
        self._failed: str | None = None

    def start(self) -> None:
        """Start the first worker."""
        self._news_s = self._monotonic_s()
        self._worker.start()

    def stop(self) -> None:
        """End every worker that was started. Waits for them, some seconds at most."""
        for worker in (*self._retired, self._worker):
            worker.stop()
        self._retired.clear()

    @property
    def failure(self) -> str | None:
        """Why there is nothing to be seen, in one sentence; None while all is well."""
        self._collect()
        if self._failed is not None:
            return self._failed
        if self._seen_ns is None:
            return None
        silence_s = (self._clock.now_ns() - self._seen_ns) / NS_PER_S
        return f"vision has seen nothing for {silence_s:.1f} s{self._cause()}" if silence_s > SILENCE_LIMIT_S else None

    @property
    def missing(self) -> str | None:
        """What a flight would still have to wait for; None where vision sees now."""
        self._collect()
        if self._trouble in BLINDING:
            return f"a camera whose frames are not {self._trouble}"
        if self._seen_ns is None or not self._is_running or self._restart_at_s is not None:
            return "the first frame through vision"
        if self._is_camera_gone:
            return "the camera, which gives no frames any more"
        is_silent = self._monotonic_s() - self._news_s > self._hang_limit_s
        return "a frame through vision" if is_silent else None

    @property
    def impairment(self) -> Notice | None:
        """What keeps the eyes from seeing at the moment; None while they see."""
        if self._is_camera_gone:
            return Notice("camera_gone", "the camera gives no frames any more")
        if self._trouble in BLINDING:
            return Notice("camera_blind", f"the camera's frames are {self._trouble}")
        return None

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

    def _cause(self) -> str:
        if self._is_camera_gone:
            return ": the camera is gone"
        if self._trouble in BLINDING:
            return f": its frames are {self._trouble}"
        return ": the vision worker is being started again" if self._restarts_s or self._restart_at_s else ""

    def _collect(self) -> None:
        now_s = self._monotonic_s()
        for news in self._worker.poll():
            self._news_s = now_s
            if isinstance(news, VisionReport):
                self._on_report(news)
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

    def _on_report(self, report: VisionReport) -> None:
        # A report is a sign of all that comes before it, should that have been lost on the way.
        self._is_running, self._is_camera_gone = True, False
        self._reports.append(report)
        if report.trouble != self._trouble and report.trouble in BLINDING:
            self._notices.append(Notice("camera_blind", f"the camera's frames are {report.trouble}"))
        self._trouble = report.trouble
        if report.trouble not in BLINDING:
            self._seen_ns = self._clock.now_ns()

    def _on_failure(self, news: WorkerFailed, now_s: float) -> None:
        if news.is_final or self._seen_ns is None:
            self._failed = news.message
        else:
            self._restart_soon(news.message, now_s)

    def _restart_soon(self, why: str, now_s: float) -> None:
        """Plan a new worker; give up when new ones have failed too often lately."""
        is_often = len(self._restarts_s) == _MAX_RESTARTS and now_s - self._restarts_s[0] < _RESTARTS_WINDOW_S
        if is_often:
            self._failed = f"the vision worker failed again after {_MAX_RESTARTS} restarts: {why}"
            return
        self._notices.append(Notice("vision_restarted", why))
        self._restart_at_s = now_s + _RESTART_PAUSE_S

    def _watch(self, now_s: float) -> None:
        """Start a new worker when it is time to; plan one when this one hangs."""
        if self._failed is not None or self._seen_ns is None:
            return
        if self._restart_at_s is not None:
            if now_s >= self._restart_at_s:
                self._replace(now_s)
            return
        limit_s = self._hang_limit_s if self._is_running else _START_LIMIT_S
        # A camera that stays away is no hang: its worker says nothing and tries again and again.
        if not self._is_camera_gone and now_s - self._news_s > limit_s:
            self._restart_soon(f"the vision worker was silent for {limit_s:g} s", now_s)

    def _replace(self, now_s: float) -> None:
        """Start a new worker in place of this one, which is killed and not waited for: the control loop has no time."""
        self._restart_at_s, self._is_running, self._is_camera_gone, self._trouble = None, False, False, None
        self._restarts_s.append(now_s)
        self._news_s = now_s
        self._worker.kill()
        for dead in [worker for worker in self._retired if not worker.is_alive]:
            dead.stop(0.0)
            self._retired.remove(dead)
        try:
            worker = self._make_worker()
            worker.start()
        except OSError as error:  # no memory, no more processes or files
            self._restart_soon(f"no vision worker can be started: {error.strerror}", now_s)
            return
        self._retired.append(self._worker)
        self._worker = worker
