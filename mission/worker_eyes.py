"""The vision worker as the executive's eyes."""

from drivers.clock import NS_PER_S, Clock
from vision.records import VisionReport
from vision.worker import VisionWorker, WorkerFailed, WorkerReady

SILENCE_LIMIT_S = 2.0


class WorkerEyes:
    """Collects the worker's reports; a worker that failed, or that has said nothing for 2 s, is a failure."""

    def __init__(self, worker: VisionWorker, clock: Clock) -> None:
        self._worker = worker
        self._clock = clock
        self._reports: list[VisionReport] = []
        self._has_started = False
        self._last_news_ns = 0
        self._failed: str | None = None

    @property
    def failure(self) -> str | None:
        """Why no more reports will come, in one sentence; None while all is well."""
        self._collect()
        if self._failed is not None:
            return self._failed
        silence_s = (self._clock.now_ns() - self._last_news_ns) / NS_PER_S
        if self.is_ready and silence_s > SILENCE_LIMIT_S:
            return f"the vision worker has been silent for {silence_s:.1f} s"
        return None

    @property
    def is_ready(self) -> bool:
        """Whether the kernels are compiled and the camera has given a frame."""
        self._collect()
        return self._has_started and self._last_news_ns > 0

    def take(self) -> list[VisionReport]:
        """The reports since the last call, oldest first."""
        self._collect()
        reports, self._reports = self._reports, []
        return reports

    def _collect(self) -> None:
        for news in self._worker.poll():
            if isinstance(news, VisionReport):
                self._reports.append(news)
                self._last_news_ns = self._clock.now_ns()
            elif isinstance(news, WorkerReady):
                self._has_started = True
            elif isinstance(news, WorkerFailed):
                self._failed = news.message
