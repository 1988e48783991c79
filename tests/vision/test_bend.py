"""A line that bends in view: both spans are found, and which of them is here."""

import math

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from vision.pipeline import LineFinder, VisionSettings
from vision.records import Detection
from vision.tracking import LineTracker, TrackSettings

SIZE = (640, 480)
FINDER = LineFinder(VisionSettings())


def ground(seed: int) -> NDArray[np.float32]:
    rng = np.random.default_rng(seed)
    rough = rng.normal(0.0, 1.0, (SIZE[1], SIZE[0])).astype(np.float32)
    return 90.0 + 30.0 * cv2.GaussianBlur(rough, (0, 0), 3.0) + 6.0 * rough


def bent_line(bend_xy: tuple[float, float], turn_deg: float, seed: int = 1, *, goes_on: bool = False) -> Detection:
    """Three conductors that come from below and turn at the bend; `goes_on`: they cross others instead."""
    image = ground(seed)
    turn = math.radians(turn_deg)
    half = math.tan(turn / 2)
    for aside in (-45, 0, 45):
        # Each conductor bends on the line that halves the bend.
        x, y = bend_xy[0] + aside, bend_xy[1] + aside * half
        ways = [((x, y), (x, y + 700)), ((x, y), (x + 700 * math.sin(turn), y - 700 * math.cos(turn)))]
        if goes_on:
            ways = [((2 * x - e[0], 2 * y - e[1]), e) for _, e in ways]
        for start, end in ways:
            mask = np.zeros_like(image)
            ends = [tuple(round(16 * v) for v in p) for p in (start, end)]
            cv2.line(mask, ends[0], ends[1], 1.0, 2, cv2.LINE_AA, 4)
            image += mask * (215.0 - image)
    return FINDER.find(np.clip(cv2.GaussianBlur(image, (0, 0), 0.6), 0, 255).astype(np.uint8))


@pytest.mark.parametrize("turn_deg", [-60.0, -30.0, 30.0, 60.0])
@pytest.mark.parametrize("bend_y", [170.0, 240.0, 310.0])
def test_both_spans_are_seen(turn_deg: float, bend_y: float) -> None:
    found = bent_line((320.0, bend_y), turn_deg)
    assert found.is_present
    assert found.next_span is not None
    assert found.angle_rad is not None
    angles_deg = sorted(math.degrees(angle) for angle in (found.angle_rad, found.next_span.angle_rad))
    assert angles_deg == pytest.approx(sorted([0.0, turn_deg]), abs=1.0)
    assert found.n_lines == 3
    if bend_y < 200.0:  # the bend is ahead: the span below it is the one here
        assert math.degrees(found.angle_rad) == pytest.approx(0.0, abs=1.0)
    if bend_y > 280.0:
        assert math.degrees(found.angle_rad) == pytest.approx(turn_deg, abs=1.0)


def test_lines_that_cross_are_no_bend() -> None:
    assert bent_line((320.0, 240.0), 40.0, goes_on=True).next_span is None


def test_a_straight_line_has_no_bend() -> None:
    found = bent_line((320.0, 240.0), 0.0)
    assert found.is_present
    assert found.next_span is None


def test_the_track_goes_over_to_the_span_beyond_the_bend_at_once() -> None:
    tracker = LineTracker(TrackSettings())
    period_ns = 33_000_000
    before, after = bent_line((320.0, 205.0), 30.0), bent_line((320.0, 280.0), 30.0)
    for k in range(3):
        _, tracked = tracker.update(before.estimate(k * period_ns), k * period_ns, 800.0)
    assert tracked is not None
    _, tracked = tracker.update(after.estimate(3 * period_ns), 3 * period_ns, 800.0)
    assert tracked is not None
    assert math.degrees(tracked.angle_rad) == pytest.approx(30.0, abs=1.0)
