"""Measure the vision worker: from a frame's capture to its estimate in the flight's process, and how soon it starts.

python -m benchmarks.worker [--data FOLDER] [--seconds S] [--starts N]
"""

import argparse
import statistics
import time
from pathlib import Path
from select import select
from types import TracebackType
from typing import Self

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks import scoring
from drivers.camera.camera import Frame
from drivers.clock import ScaledClock
from vision.pipeline import VisionSettings
from vision.records import VisionReport
from vision.worker import VisionWorker, WorkerReady

RATE_HZ = 30.0
SIZE_PX = (640, 480)
LOG_RATE_HZ = 4.0  # as in a mission by default: a frame that the log keeps is compressed on the way
_N_SKIPPED = 30  # the first second: caches and the clock of the processor are cold
_START_LIMIT_S = 120.0


class PhotographCamera:
    """Gives photographs from memory 30 times a second, each as if it had just been captured."""

    def __init__(self, paths: tuple[str, ...]) -> None:
        self._paths = paths
        self._images: list[NDArray[np.uint8]] = []
        self._seq = 0
        self._start_s = 0.0

    def read(self, timeout_s: float) -> Frame | None:
        """Wait for the next frame's time; those that were missed are dropped."""
        now_s = time.monotonic()
        self._seq = max(self._seq + 1, int((now_s - self._start_s) * RATE_HZ))
        time.sleep(max(0.0, self._start_s + self._seq / RATE_HZ - now_s))
        image = self._images[self._seq % len(self._images)]
        return Frame(self._seq, time.monotonic_ns(), image)

    def __enter__(self) -> Self:
        for path in self._paths:
            image = scoring.read_image(Path(path))
            image = image if image.shape[1] > image.shape[0] else np.rot90(image)
            self._images.append(np.asarray(cv2.resize(image, SIZE_PX), dtype=np.uint8))
        if not self._images:
            noise = np.random.default_rng(1).normal(110, 25, (*SIZE_PX[::-1], 3)).clip(0, 255)
            self._images.append(np.asarray(cv2.line(noise.astype(np.uint8), (100, 0), (300, 479), (230,) * 3, 2)))
        self._start_s = time.monotonic()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._images.clear()


class _Opener:
    """Opens the camera in the worker; picklable."""

    def __init__(self, paths: tuple[str, ...]) -> None:
        self._paths = paths

    def __call__(self) -> PhotographCamera:
        return PhotographCamera(self._paths)


def start_s(paths: tuple[str, ...]) -> float:
    """How long [s] a worker takes from its start to WorkerReady."""
    worker = VisionWorker(_Opener(paths), VisionSettings(), ScaledClock(), LOG_RATE_HZ)
    begin_s = time.monotonic()
    worker.start()
    try:
        while time.monotonic() < begin_s + _START_LIMIT_S:
            select([worker.fileno()], [], [], 1.0)
            if any(isinstance(news, WorkerReady) for news in worker.poll()):
                return time.monotonic() - begin_s
    finally:
        worker.stop()
    raise RuntimeError("the vision worker did not get ready")


def latencies_ms(paths: tuple[str, ...], seconds: float) -> NDArray[np.float64]:
    """From each frame's capture until its report was read in this process [ms], at 30 frames a second."""
    clock = ScaledClock()
    worker = VisionWorker(_Opener(paths), VisionSettings(), clock, LOG_RATE_HZ)
    worker.start()
    found_ms: list[float] = []
    try:
        while len(found_ms) < _N_SKIPPED + seconds * RATE_HZ:
            select([worker.fileno()], [], [], 1.0)
            for news in worker.poll():
                if isinstance(news, VisionReport):
                    found_ms.append((clock.now_ns() - news.t_capture_ns) / 1e6)
                elif not isinstance(news, WorkerReady):
                    raise RuntimeError(str(news))
    finally:
        worker.stop()
    return np.array(found_ms[_N_SKIPPED:])


def worker_text(data: Path | None, seconds: float, n_starts: int) -> str:
    """What was measured, as Markdown."""
    paths = tuple(str(path) for path in sorted(data.glob("pld/*/*.jpg"))) if data else ()
    start_s(())  # kernels and files are cached from here on, as they are after the first flight
    starts_s = [start_s(()) for _ in range(n_starts)]
    found_ms = latencies_ms(paths, seconds)
    p50, p95, p99 = np.percentile(found_ms, (50, 95, 99))
    return (
        f"A 640 x 480 frame's way from its capture to its estimate in the flight's process, at 30 frames a second with "
        f"the log keeping 4 of them, {len(found_ms)} frames: {p50:.1f} ms in the median, {p95:.1f} ms p95, "
        f"**{p99:.1f} ms p99**, {found_ms.max():.1f} ms at most. A warmed worker is ready "
        f"**{statistics.median(starts_s):.2f} s** after its start ({min(starts_s):.2f} to {max(starts_s):.2f} s)."
    )


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--data", type=Path, help="folder that holds the photographs")
    parser.add_argument("--seconds", type=float, default=40.0)
    parser.add_argument("--starts", type=int, default=5)
    options = parser.parse_args()
    print(worker_text(options.data, options.seconds, options.starts))


if __name__ == "__main__":
    main()
