"""The vision worker as the flight sees it: a process of its own that reports on frames until it is stopped."""

import multiprocessing
from collections.abc import Callable
from multiprocessing.util import Finalize

from drivers.camera.camera import Camera
from drivers.clock import ScaledClock
from vision.outbox import Inbox
from vision.pipeline import VisionSettings
from vision.records import VisionReport
from vision.worker_process import CameraBack, CameraGone, WorkerEvent, WorkerFailed, WorkerReady, run_worker

__all__ = ["CameraBack", "CameraGone", "VisionWorker", "WorkerEvent", "WorkerFailed", "WorkerReady"]

_KILL_TIMEOUT_S = 1.0


class VisionWorker:
    """A process that owns the camera and the pipeline, so that neither can make the control loop late.

    `open_camera` is called in the worker and must be picklable. `log_rate_hz` [1/s, flight] says how often a report
    carries its frame as JPEG; 0 never. Tell an event loop to watch `fileno()` and call `poll()` when it is readable;
    stop watching when a WorkerFailed came, after which nothing more will come.
    """

    def __init__(
        self,
        open_camera: Callable[[], Camera],
        settings: VisionSettings,
        clock: ScaledClock,
        log_rate_hz: float,
    ) -> None:
        context = multiprocessing.get_context("spawn")
        self._reports, self._child_reports = context.Pipe(duplex=False)
        # The worker waits for the end of this pipe, which comes when we close it or die, however suddenly.
        self._child_lifeline, self._lifeline = context.Pipe(duplex=False)
        # At exit multiprocessing waits for its children, and this one would wait for us: hang up before that.
        self._hang_up = Finalize(self, self._lifeline.close, exitpriority=10)
        self._process = context.Process(
            target=run_worker,
            args=(open_camera, settings, clock, log_rate_hz, self._child_reports, self._child_lifeline),
            name="lineflight-vision",
            daemon=True,
        )
        self._inbox = Inbox(self._reports.fileno())
        self._has_failed = False

    def start(self) -> None:
        """Start the process. It reports WorkerReady once camera and kernels are warm, which takes seconds."""
        self._process.start()
        self._child_reports.close()
        self._child_lifeline.close()

    def fileno(self) -> int:
        """Return the pipe's descriptor, readable when `poll` has something to give."""
        return self._reports.fileno()

    @property
    def is_alive(self) -> bool:
        """Whether the process runs."""
        return self._process.is_alive()

    @property
    def pid(self) -> int | None:
        """The process's id; None before the start."""
        return self._process.pid

    def poll(self) -> list[VisionReport | WorkerEvent]:
        """Return what the worker said since the last call, oldest first; never waits.

        A worker that ended without a word (it crashed, or was killed) gives one WorkerFailed.
        """
        news: list[VisionReport | WorkerEvent] = []
        for record in self._inbox.drain():
            if isinstance(record, VisionReport):
                record.power_lines.setflags(write=False)  # pickling forgets it
                news.append(record)
            elif isinstance(record, WorkerEvent):
                self._has_failed |= isinstance(record, WorkerFailed)
                news.append(record)
        if self._inbox.is_ended and not self._has_failed:
            self._has_failed = True
            news.append(WorkerFailed(f"The vision worker ended without a word{_exit_words(self._process.exitcode)}."))
        return news

    def kill(self) -> None:
        """End the worker at once, whatever it hangs in; waits for nothing. `poll` gives nothing any more."""
        self._hang_up()
        if self._process.pid is not None and self._process.is_alive():
            self._process.kill()
        self._inbox.is_ended = self._has_failed = True

    def stop(self, timeout_s: float = 3.0) -> None:
        """Ask the worker to end, wait at most `timeout_s` [s, wall], then kill it. Safe to call twice."""
        self._hang_up()
        if self._process.pid is not None:
            self._process.join(timeout_s)
            if self._process.is_alive():
                self._process.kill()
                self._process.join(_KILL_TIMEOUT_S)
        for end in (self._child_reports, self._child_lifeline, self._reports):
            end.close()
        self._inbox.is_ended = self._has_failed = True


def _exit_words(exit_code: int | None) -> str:
    return "" if exit_code is None else f" (exit code {exit_code})"
