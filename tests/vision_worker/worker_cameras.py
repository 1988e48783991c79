"""Cameras for the worker's process, importable there, and a program that owns a worker."""

import sys
import threading
import time
from pathlib import Path
from types import TracebackType
from typing import Literal, Self

import cv2
import numpy as np

from drivers.camera.camera import CameraError, CameraLost, Frame
from drivers.clock import ScaledClock
from vision.pipeline import VisionSettings
from vision.worker import VisionWorker

FRAME_PERIOD_NS = 50_000_000


def make_frame(seq: int, t_capture_ns: int | None = None) -> Frame:
    """A conductor that wanders to the right, over a plain field."""
    image = np.full((120, 160, 3), 90, np.uint8)
    cv2.line(image, (40 + seq % 80, 0), (40 + seq % 80, 119), (230, 230, 230), 2)
    image.setflags(write=False)
    return Frame(seq, seq * FRAME_PERIOD_NS if t_capture_ns is None else t_capture_ns, image)


class EndlessCamera:
    """Gives a frame as often as it is asked."""

    def __init__(self) -> None:
        self._seq = 0

    def read(self, timeout_s: float) -> Frame | None:
        time.sleep(0.01)
        self._seq += 1
        return make_frame(self._seq, time.monotonic_ns())

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        return None


class HungCamera(EndlessCamera):
    """Gives one frame, then never comes back from a read."""

    def read(self, timeout_s: float) -> Frame | None:
        if self._seq == 1:
            threading.Event().wait()
        return super().read(timeout_s)


class FaultyOnce:
    """Opens cameras: the first one gives a frame and then meets `fault`, the later ones are sound.

    Processes share what is left at `trace`, an absolute path.
    """

    def __init__(self, fault: Literal["hang", "lose", "crash"], trace: str) -> None:
        self._fault = fault
        self._trace = Path(trace)

    def __call__(self) -> EndlessCamera:
        if self._trace.exists():
            return EndlessCamera()
        self._trace.touch()
        return _Faulty(self._fault)


class _Faulty(EndlessCamera):
    def __init__(self, fault: str) -> None:
        super().__init__()
        self._fault = fault

    def read(self, timeout_s: float) -> Frame | None:
        if self._seq < 3:
            return super().read(timeout_s)
        if self._fault == "hang":
            threading.Event().wait()
        if self._fault == "lose":
            raise CameraLost("The camera stopped giving frames; check its cable.")
        raise RuntimeError("a driver's bug")


def no_camera() -> EndlessCamera:
    raise CameraError("There is no camera at /dev/video9; plug it in.")


def own_a_worker(how_it_ends: str) -> None:
    """Start a worker, say its process id once it reports, then end as told: without stopping it, or not at all."""
    worker = VisionWorker(EndlessCamera, VisionSettings(), ScaledClock(), log_rate_hz=0.0)
    worker.start()
    while not worker.poll():
        time.sleep(0.01)
    sys.stdout.write(f"{worker.pid}\n")
    sys.stdout.flush()
    if how_it_ends == "never":
        threading.Event().wait()


if __name__ == "__main__":
    own_a_worker(sys.argv[1])
