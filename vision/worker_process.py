"""What runs inside the vision worker's process: camera in, reports out, until the flight hangs up."""

import contextlib
import math
import os
import signal
import tempfile
import threading
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from drivers.camera.camera import Camera, CameraError, CameraLost, Frame
from drivers.clock import NS_PER_S, Clock, ScaledClock
from vision.frame_check import FrameCheck, FrameCheckSettings
from vision.outbox import Outbox
from vision.pipeline import LineFinder, VisionSettings
from vision.records import BLINDING, NO_LINES, Trouble, VisionReport
from vision.tracking import LineTracker, TrackSettings

_READ_TIMEOUT_S = 0.1
_OUTBOX_DEPTH = 8
_FLUSH_TIMEOUT_S = 0.5
_HANG_TIMEOUT_S = 2.0
_REOPEN_PERIOD_S = 0.5
_JPEG_QUALITY = 80


@dataclass(frozen=True, slots=True)
class WorkerReady:
    """The camera is open and the kernels are compiled: reports follow."""

    t_ns: int


@dataclass(frozen=True, slots=True)
class WorkerFailed:
    """The worker ended; `message` says why in one sentence for a person.

    `is_final` where a new worker would meet the same end, such as that of a recording.
    """

    message: str
    is_final: bool = False


@dataclass(frozen=True, slots=True)
class CameraGone:
    """The camera stopped giving frames, as `message` says; the worker tries to open it again until it can."""

    message: str


@dataclass(frozen=True, slots=True)
class CameraBack:
    """The camera that was gone gives frames again."""

    t_ns: int


WorkerEvent = WorkerReady | WorkerFailed | CameraGone | CameraBack


def run_worker(
    open_camera: Callable[[], Camera],
    settings: VisionSettings,
    clock: ScaledClock,
    log_rate_hz: float,
    reports: Connection,
    lifeline: Connection,
) -> None:
    """Work on the camera's newest frame, again and again, until `lifeline` is closed; then return.

    Sends WorkerReady, a VisionReport for each frame, CameraGone and CameraBack, and WorkerFailed when the camera cannot
    be used or the pipeline fails.
    """
    # Ctrl-C and a service manager's stop reach every process of the group; only the parent knows when to stop us.
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    cv2.setNumThreads(1)
    stop = threading.Event()
    threading.Thread(target=_watch_lifeline, args=(lifeline, stop), name="lifeline", daemon=True).start()
    outbox: Outbox[VisionReport | WorkerEvent] = Outbox(reports.fileno(), _OUTBOX_DEPTH)
    try:
        _work(open_camera, LineFinder(settings), clock, log_rate_hz, outbox, stop)
    except CameraError as error:
        outbox.put(WorkerFailed(str(error)))
    except EOFError:
        outbox.put(WorkerFailed("The camera's recording has ended.", is_final=True))
    except Exception as error:
        trace = Path(tempfile.gettempdir()) / "lineflight-vision-fault.txt"
        trace.write_text(traceback.format_exc(), encoding="utf-8")
        words = f"The vision worker met a fault of its own ({type(error).__name__}: {error}); send {trace} to us."
        outbox.put(WorkerFailed(words))
    finally:
        outbox.close(_FLUSH_TIMEOUT_S)


def _work(
    open_camera: Callable[[], Camera],
    finder: LineFinder,
    clock: ScaledClock,
    log_rate_hz: float,
    outbox: Outbox[VisionReport | WorkerEvent],
    stop: threading.Event,
) -> None:
    """Report on frames until told to stop. A camera that is lost is opened again; raises what else goes wrong."""
    reporter = Reporter(finder, clock, log_rate_hz)
    camera = open_camera()
    finder.warm_up()
    is_lost = is_ready = False
    while True:
        try:
            with camera:
                if not is_ready:
                    is_ready = True
                    outbox.put(WorkerReady(clock.now_ns()))
                while not stop.is_set():
                    frame = camera.read(_READ_TIMEOUT_S)
                    if frame is None:
                        continue
                    if is_lost:
                        is_lost = False
                        outbox.put(CameraBack(clock.now_ns()))
                    outbox.put(reporter.report(frame))
            return
        except CameraLost as error:
            if not is_lost:
                is_lost = True
                outbox.put(CameraGone(str(error)))
        reopened = _reopen(open_camera, stop)
        if reopened is None:
            return
        camera = reopened


def _reopen(open_camera: Callable[[], Camera], stop: threading.Event) -> Camera | None:
    """Try until the camera opens; None when told to stop."""
    while not stop.wait(_REOPEN_PERIOD_S):
        with contextlib.suppress(CameraError):
            return open_camera()
    return None


class Reporter:
    """Turns frames into reports, and decides which of them carry their image."""

    def __init__(self, finder: LineFinder, clock: Clock, log_rate_hz: float) -> None:
        self._finder = finder
        self._tracker = LineTracker(TrackSettings())
        self._check = FrameCheck(FrameCheckSettings())
        self._clock = clock
        self._log_period_ns = round(NS_PER_S / log_rate_hz) if log_rate_hz > 0 else None
        self._next_log_ns: int | None = None
        self._last_seq: int | None = None

    def report(self, frame: Frame) -> VisionReport:
        """Find the power lines in a frame and say so; times are taken at the end of the work."""
        work_start_ns = time.perf_counter_ns()
        if self._last_seq is not None and frame.seq <= self._last_seq:
            # A camera that was opened again counts from 0 again, and cannot have been frozen while it was away.
            self._last_seq, self._check = None, FrameCheck(FrameCheckSettings())
        trouble = self._check.trouble(frame.image, frame.t_capture_ns)
        estimate, power_lines = None, NO_LINES
        if trouble is not Trouble.UNREADABLE:
            detection = self._finder.find(frame.image)
            power_lines = detection.power_lines
            if trouble not in BLINDING:
                estimate = detection.estimate(frame.t_capture_ns)
        track, estimate = self._tracker.update(estimate, frame.t_capture_ns, math.hypot(*frame.image.shape[:2]))
        work_ns = time.perf_counter_ns() - work_start_ns
        is_kept = trouble is not Trouble.UNREADABLE and self._is_logged(frame.t_capture_ns)
        jpeg = encode_jpeg(frame.image) if is_kept else None
        n_dropped = 0 if self._last_seq is None else frame.seq - self._last_seq - 1
        self._last_seq = frame.seq
        return VisionReport(
            seq=frame.seq,
            t_capture_ns=frame.t_capture_ns,
            estimate=estimate,
            track=track,
            trouble=trouble,
            power_lines=power_lines,
            latency_ns=self._clock.now_ns() - frame.t_capture_ns,
            work_ns=work_ns,
            n_dropped=n_dropped,
            jpeg=jpeg,
        )

    def _is_logged(self, t_capture_ns: int) -> bool:
        if self._log_period_ns is None:
            return False
        if self._next_log_ns is not None and t_capture_ns < self._next_log_ns:
            return False
        # On the grid of the first frame's time, so that the rate holds although frames do not meet the due times.
        due_ns = t_capture_ns if self._next_log_ns is None else self._next_log_ns
        self._next_log_ns = due_ns + self._log_period_ns * (1 + (t_capture_ns - due_ns) // self._log_period_ns)
        return True


def encode_jpeg(image: NDArray[np.uint8]) -> bytes:
    """Encode a grey or BGR image, (h, w) or (h, w, 3) uint8, as a JPEG for the log."""
    _, encoded = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
    return encoded.tobytes()


def _watch_lifeline(lifeline: Connection, stop: threading.Event) -> None:
    lifeline.poll(None)  # nobody writes: it is readable when the other end is closed
    stop.set()
    time.sleep(_HANG_TIMEOUT_S)
    # The main thread hangs in the camera or the pipeline, and there is nobody left to tell.
    os._exit(1)
