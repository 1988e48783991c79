"""The worker as the executive's eyes: whatever happens to worker or camera is said, and sight comes back."""

import functools
import os
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from select import select

import pytest

from drivers.camera.camera import Camera
from drivers.camera.scripted import ScriptedCamera
from drivers.clock import ScaledClock
from mission.eyes import Notice
from mission.worker_eyes import WorkerEyes
from tests.vision_worker import worker_cameras
from tests.vision_worker.worker_cameras import EndlessCamera, FaultyOnce, make_frame
from vision.pipeline import VisionSettings
from vision.worker import VisionWorker

TIMEOUT_S = 120.0  # kernels may have to be compiled


class Watch:
    """Eyes, and every worker that they made."""

    def __init__(self, open_camera: Callable[[], Camera], clock: ScaledClock) -> None:
        self.workers: list[VisionWorker] = []
        self._make = functools.partial(VisionWorker, open_camera, VisionSettings(), clock, 0.0)
        self.notices: list[Notice] = []
        self.eyes = WorkerEyes(self._make_worker, clock, frame_period_s=0.01)
        self.eyes.start()

    def _make_worker(self) -> VisionWorker:
        self.workers.append(self._make())
        return self.workers[-1]

    def wait_until(self, is_so: Callable[[], object]) -> None:
        """Poll as the control loop does, until it is so."""
        limit_s = time.monotonic() + TIMEOUT_S
        while not is_so():
            self.notices += self.eyes.take_notices()
            assert time.monotonic() < limit_s, self.notices
            select([self.workers[-1].fileno()], [], [], 0.02)
        self.notices += self.eyes.take_notices()

    def names(self) -> list[str]:
        return [notice.name for notice in self.notices]


@pytest.fixture
def watch() -> Iterator[Callable[[Callable[[], Camera]], Watch]]:
    watches: list[Watch] = []

    def start(open_camera: Callable[[], Camera], clock: ScaledClock | None = None) -> Watch:
        watches.append(Watch(open_camera, clock or ScaledClock()))
        return watches[-1]

    yield start
    for each in watches:
        each.eyes.stop()
        assert not any(worker.is_alive for worker in each.workers)


def test_a_killed_worker_is_replaced_and_sees_again(watch) -> None:
    seen = watch(EndlessCamera)
    seen.wait_until(lambda: seen.eyes.missing is None)
    os.kill(seen.workers[0].pid, signal.SIGKILL)
    seen.wait_until(lambda: seen.notices)
    seen.eyes.take()
    seen.wait_until(lambda: seen.eyes.take())
    assert seen.names() == ["vision_restarted"]
    assert "ended without a word" in seen.notices[0].message
    assert len(seen.workers) == 2
    assert seen.eyes.failure is None


@pytest.mark.parametrize(
    ("fault", "names", "words", "n_workers"),
    [
        ("hang", ["vision_restarted"], "silent for 1 s", 2),
        ("crash", ["vision_restarted"], "a driver's bug", 2),
        ("lose", ["camera_gone", "camera_back"], "check its cable", 1),
    ],
)
def test_a_fault_in_flight_is_said_and_sight_comes_back(
    watch, tmp_path: Path, fault: str, names: list[str], words: str, n_workers: int
) -> None:
    seen = watch(FaultyOnce(fault, str(tmp_path / "first")))
    seen.wait_until(lambda: len(seen.notices) == len(names))
    seen.eyes.take()
    seen.wait_until(lambda: seen.eyes.take())
    assert seen.names() == names, seen.notices
    assert words in seen.notices[0].message
    assert len(seen.workers) == n_workers


@pytest.mark.parametrize(
    ("open_camera", "words"),
    [
        (worker_cameras.no_camera, "There is no camera at /dev/video9"),
        (functools.partial(ScriptedCamera, [make_frame(0)] * 3), "recording has ended"),
    ],
)
def test_what_cannot_come_back_is_a_failure_at_once(watch, open_camera, words: str) -> None:
    seen = watch(open_camera)
    seen.wait_until(lambda: seen.eyes.failure)
    assert words in seen.eyes.failure
    assert len(seen.workers) == 1


def test_eyes_that_see_nothing_for_too_long_have_failed_until_they_see_again(watch, tmp_path: Path) -> None:
    # Flight time runs a hundred times faster here: the worker is back long after the silence was too long.
    seen = watch(FaultyOnce("hang", str(tmp_path / "first")), ScaledClock(100.0, time.monotonic_ns()))
    seen.wait_until(lambda: seen.eyes.missing is None)
    seen.wait_until(lambda: seen.eyes.failure is not None)
    assert "seen nothing for" in seen.eyes.failure
    seen.wait_until(lambda: len(seen.workers) == 2 and seen.eyes.failure is None)
