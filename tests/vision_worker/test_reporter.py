"""What vision says about every kind of frame a camera may give: an estimate or an honest None, and it comes back."""

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from drivers.camera.camera import Frame
from drivers.clock import ScaledClock
from tests.vision.nadir_frames import nadir_frame
from vision.pipeline import LineFinder, VisionSettings
from vision.records import Track, Trouble, VisionReport
from vision.worker_process import Reporter

PERIOD_NS = 33_000_000
SIZE = (480, 640)


@pytest.fixture(scope="module")
def finder() -> LineFinder:
    finder = LineFinder(VisionSettings())
    finder.warm_up()
    return finder


class Eye:
    """A reporter that is shown one image after the other."""

    def __init__(self, finder: LineFinder) -> None:
        self._reporter = Reporter(finder, ScaledClock(), log_rate_hz=5.0)
        self._seq = 0

    def show(self, image: NDArray[np.generic]) -> VisionReport:
        frame = Frame(self._seq, self._seq * PERIOD_NS, image)  # type: ignore[arg-type]
        self._seq += 1
        return self._reporter.report(frame)


def line_frame(seed: int) -> NDArray[np.uint8]:
    return nadir_frame(seed, 0.2, 15.0)


def blurred(seed: int) -> NDArray[np.uint8]:
    return np.asarray(cv2.GaussianBlur(line_frame(seed), (0, 0), 12.0), dtype=np.uint8)


FAULTS = {
    "black": (lambda seed: np.zeros((*SIZE, 3), np.uint8), Trouble.DARK),
    "overexposed": (lambda seed: np.full((*SIZE, 3), 255, np.uint8), Trouble.OVEREXPOSED),
    "covered": (lambda seed: np.full((*SIZE, 3), 99, np.uint8), Trouble.FLAT),
    "blurred": (blurred, None),
    "tiny": (lambda seed: line_frame(seed)[:3, :3], None),
    "16 bit": (lambda seed: line_frame(seed).astype(np.uint16) * 256, Trouble.UNREADABLE),
    "float": (lambda seed: line_frame(seed) / 255.0, Trouble.UNREADABLE),
    "four channels": (lambda seed: np.zeros((*SIZE, 4), np.uint8), Trouble.UNREADABLE),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_bad_frame_is_an_honest_none_and_the_line_comes_back(finder: LineFinder, fault: str) -> None:
    make, trouble = FAULTS[fault]
    eye = Eye(finder)
    before = [eye.show(line_frame(seed)) for seed in range(3)]
    assert before[-1].estimate is not None
    during = [eye.show(make(seed)) for seed in range(10, 13)]
    assert [report.estimate for report in during] == [None] * 3
    assert {report.trouble for report in during} == {trouble}
    assert {report.track for report in during} == {Track.DOUBTFUL}
    after = eye.show(line_frame(20))
    assert after.track is Track.TRACKING
    assert after.estimate is not None


def test_a_frozen_camera_stops_steering_although_its_image_shows_a_line(finder: LineFinder) -> None:
    eye = Eye(finder)
    still = line_frame(1)
    reports = [eye.show(still) for _ in range(25)]
    assert reports[5].estimate is not None
    assert reports[-1].trouble is Trouble.FROZEN
    assert reports[-1].estimate is None
    assert [eye.show(line_frame(seed)).track for seed in (2, 3)] == [Track.DOUBTFUL, Track.TRACKING]


@pytest.mark.parametrize(
    ("level", "trouble"), [(250, Trouble.OVEREXPOSED), (170, Trouble.FLAT)], ids=["overexposed", "flat"]
)
def test_a_frozen_frame_of_any_kind_stops_steering(finder: LineFinder, level: int, trouble: Trouble) -> None:
    """A white sky or an even field behind the line is a normal view; the very same one for half a second is not."""

    def view(seed: int) -> NDArray[np.uint8]:
        image = np.random.default_rng(seed).normal(level, 1.0, SIZE)
        image[:, 301:303] -= 60.0 if trouble is Trouble.OVEREXPOSED else 14.0
        return np.clip(np.rint(image), 0, 255).astype(np.uint8)

    eye = Eye(finder)
    lively = [eye.show(view(seed)) for seed in range(20)]
    assert {report.trouble for report in lively} == {trouble}
    assert all(report.estimate is not None for report in lively[1:])
    still = [eye.show(view(99)) for _ in range(25)]
    assert still[-1].trouble is Trouble.FROZEN
    assert still[-1].estimate is None


@pytest.mark.parametrize(
    "image",
    [
        np.repeat(line_frame(3)[:, :, None], 3, axis=2),
        line_frame(3),
        np.asarray(cv2.resize(line_frame(3), (3840, 2880), interpolation=cv2.INTER_CUBIC), dtype=np.uint8),
    ],
    ids=["colour", "grey", "huge"],
)
def test_every_sound_kind_of_frame_shows_the_line(finder: LineFinder, image: NDArray[np.uint8]) -> None:
    eye = Eye(finder)
    eye.show(image)
    report = eye.show(image)
    assert report.trouble is None
    assert report.estimate is not None
    assert report.estimate.angle_rad == pytest.approx(0.2, abs=0.01)


def test_a_camera_that_counts_from_zero_again_has_dropped_nothing(finder: LineFinder) -> None:
    reporter = Reporter(finder, ScaledClock(), 0.0)
    image = line_frame(1)
    counts = [reporter.report(Frame(seq, t_ns, image)).n_dropped for t_ns, seq in enumerate((7, 9, 0, 1, 4))]
    assert counts == [0, 1, 0, 0, 2]
