"""The vision worker as a process: what it reports, how it ends, and that it never outlives or delays the flight."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from select import select

import cv2
import numpy as np
import pytest

from drivers.camera.camera import Camera, CameraError
from drivers.camera.scripted import ScriptedCamera
from drivers.clock import NS_PER_S, ScaledClock
from tests.vision_worker import worker_cameras
from tests.vision_worker.worker_cameras import FRAME_PERIOD_NS, EndlessCamera, HungCamera, make_frame
from vision.pipeline import LineFinder, VisionSettings
from vision.records import Track, VisionReport
from vision.worker import VisionWorker, WorkerEvent, WorkerFailed, WorkerReady
from vision.worker_process import Reporter

pytestmark = pytest.mark.real_time

TIMEOUT_S = 120.0  # kernels may have to be compiled
News = VisionReport | WorkerEvent


@pytest.fixture
def start() -> Iterator[Callable[[Callable[[], Camera]], VisionWorker]]:
    workers: list[VisionWorker] = []

    def start_worker(open_camera: Callable[[], Camera]) -> VisionWorker:
        workers.append(VisionWorker(open_camera, VisionSettings(), ScaledClock(), log_rate_hz=5.0))
        workers[-1].start()
        return workers[-1]

    yield start_worker
    for worker in workers:
        worker.stop()


def collect(worker: VisionWorker, is_enough: Callable[[list[News]], bool]) -> list[News]:
    news: list[News] = []
    while not is_enough(news):
        assert select([worker.fileno()], [], [], TIMEOUT_S)[0], f"only {news} came"
        news += worker.poll()
    return news


def has_failed(news: list[News]) -> bool:
    return any(isinstance(item, WorkerFailed) for item in news)


def has_report(news: list[News]) -> bool:
    return any(isinstance(item, VisionReport) for item in news)


def test_it_says_ready_then_what_the_line_finder_sees_then_why_it_ended(start) -> None:
    frames = [make_frame(0), make_frame(1), make_frame(4)]
    ready, *reports, failed = collect(start(partial(ScriptedCamera, [frames[0], None, *frames[1:]])), has_failed)
    assert isinstance(ready, WorkerReady)
    assert failed == WorkerFailed("The camera's recording has ended.", is_final=True)
    finder = LineFinder(VisionSettings())
    for frame, report in zip(frames, reports, strict=True):
        assert isinstance(report, VisionReport)
        detection = finder.find(frame.image)
        assert (report.seq, report.t_capture_ns) == (frame.seq, frame.t_capture_ns)
        assert detection.is_present
        # One frame alone is not believed yet.
        assert report.estimate == (None if frame.seq == 0 else detection.estimate(frame.t_capture_ns))
        assert report.track is (Track.SEARCHING if frame.seq == 0 else Track.TRACKING)
        np.testing.assert_array_equal(report.power_lines, detection.power_lines)
        assert not report.power_lines.flags.writeable
    assert [report.n_dropped for report in reports if isinstance(report, VisionReport)] == [0, 0, 2]


@pytest.mark.parametrize(
    ("open_camera", "message"),
    [
        (worker_cameras.no_camera, "There is no camera at /dev/video9; plug it in."),
        (partial(ScriptedCamera, [make_frame(0), CameraError("Unplugged.")]), "Unplugged."),
    ],
)
def test_a_camera_error_is_news_and_ends_the_worker(start, open_camera, message: str) -> None:
    worker = start(open_camera)
    news = collect(worker, has_failed)
    assert news[-1] == WorkerFailed(message)
    worker.stop()
    assert not worker.is_alive


def test_stop_ends_a_working_worker(start) -> None:
    worker = start(EndlessCamera)
    collect(worker, has_report)
    assert worker.is_alive
    worker.stop()
    assert not worker.is_alive
    assert worker.poll() == []


def test_stop_kills_a_worker_whose_camera_hangs(start) -> None:
    worker = start(HungCamera)
    collect(worker, has_report)
    worker.stop(timeout_s=0.1)
    assert not worker.is_alive


def test_ctrl_c_and_terminate_do_not_end_the_worker(start) -> None:
    worker = start(EndlessCamera)
    collect(worker, has_report)
    for stop_signal in (signal.SIGINT, signal.SIGTERM):
        os.kill(worker.pid, stop_signal)
        assert not has_failed(collect(worker, lambda news: len(news) > 20))
    assert worker.is_alive


def test_a_killed_worker_is_noticed_once(start) -> None:
    worker = start(EndlessCamera)
    collect(worker, has_report)
    os.kill(worker.pid, signal.SIGKILL)
    news = collect(worker, has_failed)
    assert isinstance(news[-1], WorkerFailed)
    assert "ended without a word" in news[-1].message
    assert worker.poll() == []


def start_owner(how_it_ends: str) -> subprocess.Popen[str]:
    root = Path(worker_cameras.__file__).parents[2]
    environment = {**os.environ, "PYTHONPATH": str(root)}
    command = [sys.executable, worker_cameras.__file__, how_it_ends]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)


def test_the_worker_dies_with_a_killed_parent() -> None:
    with start_owner("never") as owner:
        assert owner.stdout is not None
        worker = os.pidfd_open(int(owner.stdout.readline()))
        owner.kill()
        assert select([worker], [], [], TIMEOUT_S)[0], "the worker outlived its parent"
        os.close(worker)


def test_a_parent_that_forgets_the_worker_can_still_exit() -> None:
    with start_owner("at once") as owner:
        assert owner.wait(TIMEOUT_S) == 0


@pytest.mark.parametrize(
    ("log_rate_hz", "logged"), [(0.0, []), (5.0, [0, 4, 8]), (20.0, list(range(10))), (8.0, [0, 3, 5, 8])]
)
def test_frames_are_kept_at_the_log_rate(log_rate_hz: float, logged: list[int]) -> None:
    assert FRAME_PERIOD_NS == NS_PER_S // 20
    reporter = Reporter(LineFinder(VisionSettings()), ScaledClock(), log_rate_hz)
    reports = [reporter.report(make_frame(seq)) for seq in range(10)]
    assert [report.seq for report in reports if report.jpeg is not None] == logged


def test_a_kept_frame_is_the_image_that_was_worked_on() -> None:
    frame = make_frame(3)
    jpeg = Reporter(LineFinder(VisionSettings()), ScaledClock(), 5.0).report(frame).jpeg
    assert jpeg is not None
    kept = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)
    assert kept is not None
    assert kept.shape == frame.image.shape
    assert np.abs(kept.astype(int) - frame.image).mean() < 3


def test_latency_runs_from_capture_to_report() -> None:
    clock = ScaledClock()
    reporter = Reporter(LineFinder(VisionSettings()), clock, 0.0)
    captured_ns = clock.now_ns() - NS_PER_S
    report = reporter.report(make_frame(0, captured_ns))
    assert NS_PER_S < report.latency_ns < clock.now_ns() - captured_ns
    assert 0 < report.work_ns < report.latency_ns
