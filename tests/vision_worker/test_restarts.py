"""When a new worker is started, when one is given up, and what is said meanwhile: with scripted workers, by hand."""

import pytest

from drivers.clock import NS_PER_S
from mission.worker_eyes import SILENCE_LIMIT_S, WorkerEyes
from tests.support.geometric_eyes import bare_report
from vision.records import Track, Trouble, VisionReport
from vision.worker import CameraBack, CameraGone, WorkerEvent, WorkerFailed, WorkerReady

News = VisionReport | WorkerEvent
READY = WorkerReady(0)


def report(trouble: Trouble | None = None) -> VisionReport:
    plain = bare_report(0, 0, None)
    return VisionReport(0, 0, None, Track.SEARCHING, trouble, plain.power_lines, 0, 0, 0, None)


class FakeWorker:
    """A vision worker that says what a test lets it say."""

    def __init__(self) -> None:
        self.news: list[News] = []
        self.is_alive = False
        self.n_stopped = 0

    def start(self) -> None:
        self.is_alive = True

    def poll(self) -> list[News]:
        news, self.news = self.news, []
        return news

    def kill(self) -> None:
        self.is_alive = False

    def stop(self, timeout_s: float = 3.0) -> None:
        self.is_alive = False
        self.n_stopped += 1


class Bench:
    """Eyes over scripted workers, in a time that the test turns on."""

    def __init__(self, frame_period_s: float = 1 / 30) -> None:
        self.t_s = 100.0
        self.workers: list[FakeWorker] = []
        self.can_start = True
        self.eyes = WorkerEyes(self._make, self, frame_period_s, lambda: self.t_s)  # type: ignore[arg-type]
        self.eyes.start()

    def _make(self) -> FakeWorker:
        if not self.can_start:
            raise OSError(24, "Too many open files")
        self.workers.append(FakeWorker())
        return self.workers[-1]

    def now_ns(self) -> int:
        return round(self.t_s * NS_PER_S)

    def wall_s(self, flight_s: float) -> float:
        return flight_s

    def say(self, *news: News) -> None:
        self.workers[-1].news += news
        self.eyes.take()

    def wait(self, duration_s: float, *, is_seeing: bool = False) -> None:
        """Let time pass as the control loop does."""
        for _ in range(round(duration_s / 0.05)):
            self.t_s += 0.05
            if is_seeing:
                self.workers[-1].news.append(report())
            self.eyes.take()

    def names(self) -> list[str]:
        return [notice.name for notice in self.eyes.take_notices()]


@pytest.fixture
def bench() -> Bench:
    bench = Bench()
    bench.say(READY, report())
    assert bench.eyes.missing is None
    return bench


def test_a_worker_that_ends_is_replaced_and_reaped(bench: Bench) -> None:
    bench.say(WorkerFailed("It fell over."))
    bench.wait(1.0)
    assert [worker.is_alive for worker in bench.workers] == [False, True]
    bench.say(READY, report())
    assert bench.names() == ["vision_restarted"]
    assert bench.eyes.failure is None
    bench.wait(40.0, is_seeing=True)
    bench.say(WorkerFailed("It fell over."))
    bench.wait(1.0)
    assert bench.workers[0].n_stopped == 1  # nothing of it is left while the flight goes on


def test_a_worker_that_fails_again_and_again_is_given_up_with_its_reason(bench: Bench) -> None:
    for _ in range(4):
        assert bench.eyes.failure is None
        bench.say(WorkerFailed("It fell over."))
        bench.wait(1.0)
        bench.workers[-1].news += [READY, report()]
    assert bench.eyes.failure == "the vision worker failed again after 3 restarts: It fell over."
    n_workers = len(bench.workers)
    bench.wait(60.0)
    assert len(bench.workers) == n_workers == 4


def test_failures_far_apart_are_not_again_and_again(bench: Bench) -> None:
    for _ in range(6):
        bench.say(WorkerFailed("It fell over."))
        bench.wait(1.0)
        bench.say(READY, report())
        bench.wait(31.0, is_seeing=True)
        assert bench.eyes.failure is None


def test_a_worker_that_cannot_be_started_is_tried_again_and_then_given_up(bench: Bench) -> None:
    bench.can_start = False
    bench.say(WorkerFailed("It fell over."))
    bench.wait(1.0)
    assert bench.eyes.failure is None
    bench.wait(2.0)
    assert "no vision worker can be started: Too many open files" in (bench.eyes.failure or "")


def test_a_silent_worker_hangs_and_a_slow_camera_does_not(bench: Bench) -> None:
    bench.wait(1.2)
    assert bench.names() == ["vision_restarted"]
    slow = Bench(frame_period_s=1.5)
    slow.say(READY, report())
    slow.wait(4.0)
    assert slow.names() == []
    slow.wait(1.0)
    assert slow.names() == ["vision_restarted"]


def test_a_worker_that_starts_has_more_time(bench: Bench) -> None:
    bench.say(WorkerFailed("It fell over."))
    bench.wait(20.0)
    assert len(bench.workers) == 2
    bench.wait(20.0)
    assert len(bench.workers) == 3


def test_a_camera_that_is_gone_is_no_hang_and_its_frames_say_that_it_is_back(bench: Bench) -> None:
    bench.say(CameraGone("Unplugged."))
    bench.wait(60.0)
    assert len(bench.workers) == 1
    assert "nothing for 60.0 s: the camera is gone" in (bench.eyes.failure or "")
    bench.say(report())  # the word that it is back was lost
    assert bench.eyes.failure is None
    bench.wait(1.2)
    assert bench.names() == ["camera_gone", "vision_restarted"]
    bench.wait(0.6)
    bench.say(CameraGone("Unplugged."), CameraBack(0), READY, report())
    assert bench.names() == ["camera_gone", "camera_back"]


@pytest.mark.parametrize("news", [CameraGone("Unplugged."), WorkerFailed("It fell over."), report(Trouble.DARK)])
def test_nothing_takes_off_while_vision_is_away(bench: Bench, news: News) -> None:
    bench.say(news)
    assert bench.eyes.failure is None
    assert bench.eyes.missing is not None
    bench.wait(1.0)
    assert bench.eyes.missing is not None


def test_a_worker_that_is_silent_is_missing_before_it_is_dead(bench: Bench) -> None:
    bench.wait(1.05)
    assert bench.eyes.missing is not None


@pytest.mark.parametrize("trouble", [Trouble.FROZEN, Trouble.DARK, Trouble.UNREADABLE])
def test_frames_that_nothing_can_be_seen_in_are_no_sight(bench: Bench, trouble: Trouble) -> None:
    for _ in range(round(SILENCE_LIMIT_S / 0.1) + 2):
        bench.t_s += 0.1
        bench.say(report(trouble))
    assert bench.eyes.failure is not None
    assert f"its frames are {trouble}" in bench.eyes.failure
    assert bench.names() == ["camera_blind"]
    assert len(bench.workers) == 1
    bench.say(report())
    assert bench.eyes.failure is None


@pytest.mark.parametrize("trouble", [Trouble.FLAT, Trouble.OVEREXPOSED, None])
def test_other_frames_are_sight_although_they_show_no_line(bench: Bench, trouble: Trouble | None) -> None:
    for _ in range(60):
        bench.t_s += 0.1
        bench.say(report(trouble))
    assert bench.eyes.failure is None
    assert bench.eyes.missing is None
