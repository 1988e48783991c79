"""The line finder: angle, offset, number and presence on drawn nadir frames; honest on whatever else it is shown."""

import itertools
import math
import subprocess
import sys
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from tests.vision.nadir_frames import draw_line, expose, ground, nadir_frame
from vision.edge_lines import ProjectionSettings
from vision.finders import CbsSettings, EdgeSettings, SteerableSettings
from vision.orientation import line_angle_distance_rad
from vision.pipeline import Detector, LineFinder, VisionSettings
from vision.records import Detection, wrap_line_angle_rad


@pytest.fixture(scope="module")
def finder() -> LineFinder:
    made = LineFinder(VisionSettings())
    made.warm_up()
    return made


def angle_error_deg(detection: Detection, angle_rad: float) -> float:
    assert detection.angle_rad is not None
    return math.degrees(float(line_angle_distance_rad(np.array([detection.angle_rad]), angle_rad)[0]))


def is_honest(detection: Detection) -> bool:
    """What holds of every detection, whatever the image shows."""
    return (
        all(
            s.ndim == 2 and s.shape[1] == 4 and not s.flags.writeable
            for s in (detection.segments, detection.power_lines)
        )
        and bool(np.isfinite(detection.segments).all() and np.isfinite(detection.power_lines).all())
        and math.isfinite(detection.offset_px)
        and 0.0 <= detection.confidence <= 1.0
        and (detection.angle_rad is None) == (len(detection.segments) == 0)
        and (detection.angle_rad is None or -math.pi / 2 < detection.angle_rad <= math.pi / 2)
        and (not detection.is_present or detection.n_lines >= 1)
    )


@settings(max_examples=40)
@given(
    seed=st.integers(0, 10_000),
    angle_deg=st.floats(-90, 90),
    offset_px=st.floats(-120, 120),
    line_width_px=st.floats(0.8, 1.5),
    level=st.sampled_from([35.0, 200.0, 230.0]),
)
def test_three_conductors_are_found_at_any_angle(
    finder: LineFinder, seed: int, angle_deg: float, offset_px: float, line_width_px: float, level: float
) -> None:
    angle_rad = math.radians(angle_deg)
    detection = finder.find(nadir_frame(seed, angle_rad, offset_px, 70.0, 3, line_width_px, level, contrast=10.0))
    assert is_honest(detection)
    assert detection.is_present
    assert detection.n_lines == 3
    assert detection.angle_rad is not None
    assert angle_error_deg(detection, angle_rad) < 0.5
    # Near horizontal the angle's sign, and with it the normal, may turn over.
    is_turned = abs(detection.angle_rad - angle_rad) > math.pi / 2
    assert (-detection.offset_px if is_turned else detection.offset_px) == pytest.approx(offset_px, abs=1.5)


@pytest.mark.parametrize(
    ("angle_deg", "offset_px", "centre_x", "centre_y"),
    [
        (0.0, 80.0, 400, None),  # right of the centre
        (0.0, -80.0, 240, None),
        (90.0, 80.0, None, 320),  # below the centre
        (90.0, -80.0, None, 160),
        (30.0, 60.0, None, None),  # its top leans to the right
        (-30.0, 60.0, None, None),
    ],
)
def test_the_convention_of_angle_and_offset(
    finder: LineFinder, angle_deg: float, offset_px: float, centre_x: int | None, centre_y: int | None
) -> None:
    angle_rad = math.radians(angle_deg)
    levels = np.full((480, 640), 90.0)
    y, x = np.mgrid[:480, :640]
    if centre_x is not None:
        levels[:, centre_x - 1 : centre_x + 1] = 220.0
    elif centre_y is not None:
        levels[centre_y - 1 : centre_y + 1] = 220.0
    else:
        # From the definition: all points c + offset n + t d.
        across = (x - 319.5) * math.cos(angle_rad) + (y - 239.5) * math.sin(angle_rad)
        levels[np.abs(across - offset_px) < 1.0] = 220.0
    detection = finder.find(expose(levels, 1))
    assert detection.is_present
    assert detection.n_lines == 1
    assert angle_error_deg(detection, angle_rad) < 0.3
    assert detection.angle_rad is not None
    # A hair's breadth beyond +90 degrees is -90 degrees, and the normal looks the other way.
    is_turned = abs(detection.angle_rad - angle_rad) > math.pi / 2
    assert (-detection.offset_px if is_turned else detection.offset_px) == pytest.approx(offset_px, abs=1.0)


@pytest.mark.parametrize("offset_px", [-230.0, -200.0, 200.0, 230.0])
def test_a_line_entering_at_the_edge_is_present(finder: LineFinder, offset_px: float) -> None:
    levels = draw_line(ground(21, 10.0), math.pi / 2, offset_px, 1.2, 215.0)
    detection = finder.find(expose(levels, 22))
    assert detection.is_present
    assert detection.n_lines == 1
    assert angle_error_deg(detection, math.pi / 2) < 0.5
    assert abs(detection.offset_px) == pytest.approx(230.0 if abs(offset_px) == 230.0 else 200.0, abs=1.5)


@pytest.mark.parametrize("contrast", [0.0, 3.0, 8.0, 14.0, 25.0])
def test_bare_ground_shows_no_line(finder: LineFinder, contrast: float) -> None:
    for seed in range(12):
        detection = finder.find(expose(ground(seed, contrast), seed))
        assert is_honest(detection)
        assert not detection.is_present
        assert detection.estimate(1) is None


def test_a_road_is_no_conductor(finder: LineFinder) -> None:
    # Wider than any conductor: two steps, 90 px apart.
    detection = finder.find(expose(draw_line(ground(3, 8.0), 0.3, 20.0, 90.0, 160.0), 4))
    assert angle_error_deg(detection, 0.3) < 0.5
    assert not detection.is_present


def test_a_short_fence_is_no_conductor(finder: LineFinder) -> None:
    levels = ground(5, 8.0)
    levels[200:203, 100:260] = 220.0
    assert not finder.find(expose(levels, 6)).is_present


def test_noise_shows_no_line(finder: LineFinder) -> None:
    for seed in range(10):
        noise = np.random.default_rng(seed).integers(0, 256, (480, 640), dtype=np.uint8)
        assert not finder.find(noise).is_present


@pytest.mark.parametrize("level", [0, 255])
def test_a_plain_image_holds_nothing(finder: LineFinder, level: int) -> None:
    detection = finder.find(np.full((480, 640, 3), level, dtype=np.uint8))
    assert is_honest(detection)
    assert detection.angle_rad is None
    assert not detection.is_present
    assert detection.n_lines == 0


@settings(max_examples=60)
@given(
    st.one_of(
        arrays(np.uint8, st.tuples(st.integers(1, 40), st.integers(1, 40))),
        arrays(np.uint8, st.tuples(st.integers(1, 12), st.integers(1, 12), st.just(3))),
        st.builds(
            lambda h, w, seed: np.random.default_rng(seed).integers(0, 256, (h, w), dtype=np.uint8),
            st.integers(1, 90),
            st.integers(1, 90),
            st.integers(0, 99),
        ),
    )
)
def test_any_image_is_answered(finder: LineFinder, image: NDArray[np.uint8]) -> None:
    image.setflags(write=False)
    assert is_honest(finder.find(image))


@pytest.mark.parametrize("size", [(1, 640), (480, 1), (2, 2), (23, 23)])
def test_tiny_images_are_answered(finder: LineFinder, size: tuple[int, int]) -> None:
    for image in (np.zeros(size, dtype=np.uint8), np.random.default_rng(1).integers(0, 256, size, dtype=np.uint8)):
        assert is_honest(finder.find(image))


def test_what_is_no_image_is_refused(finder: LineFinder) -> None:
    with pytest.raises(ValueError, match="float64"):
        finder.find(np.zeros((10, 10)))  # type: ignore[arg-type]


@settings(max_examples=15)
@given(seed=st.integers(0, 999), angle_deg=st.floats(-85, 85), offset_px=st.floats(-90, 90))
def test_a_turned_frame_has_a_turned_answer(finder: LineFinder, seed: int, angle_deg: float, offset_px: float) -> None:
    frame = nadir_frame(seed, math.radians(angle_deg), offset_px)
    before, after = finder.find(frame), finder.find(np.rot90(frame))
    assert before.angle_rad is not None
    turned_rad = wrap_line_angle_rad(before.angle_rad - math.pi / 2)
    assert angle_error_deg(after, turned_rad) < 0.3
    assert after.n_lines == before.n_lines
    # Wrapping the angle turns the normal over.
    assert after.angle_rad is not None
    sign = 1.0 if abs(after.angle_rad - (before.angle_rad - math.pi / 2)) < math.pi / 2 else -1.0
    assert after.offset_px == pytest.approx(sign * before.offset_px, abs=1.0)


@settings(max_examples=15)
@given(shift_x=st.integers(0, 60), shift_y=st.integers(0, 60), angle_deg=st.floats(-80, 80))
def test_a_shifted_frame_has_a_shifted_answer(finder: LineFinder, shift_x: int, shift_y: int, angle_deg: float) -> None:
    frame = nadir_frame(7, math.radians(angle_deg), 0.0, spacing_px=50.0)
    before = finder.find(frame[:420, :580])
    after = finder.find(frame[shift_y : shift_y + 420, shift_x : shift_x + 580])
    assert before.angle_rad is not None
    assert angle_error_deg(after, before.angle_rad) < 0.3
    moved_px = -shift_x * math.cos(before.angle_rad) - shift_y * math.sin(before.angle_rad)
    assert after.offset_px - before.offset_px == pytest.approx(moved_px, abs=1.0)


@settings(max_examples=15)
@given(seed=st.integers(0, 999), angle_deg=st.floats(-85, 85), offset_px=st.floats(-90, 90))
def test_a_mirrored_frame_has_a_mirrored_answer(
    finder: LineFinder, seed: int, angle_deg: float, offset_px: float
) -> None:
    frame = nadir_frame(seed, math.radians(angle_deg), offset_px)
    before, after = finder.find(frame), finder.find(np.ascontiguousarray(frame[:, ::-1]))
    assert before.angle_rad is not None
    assert angle_error_deg(after, -before.angle_rad) < 0.3
    assert after.n_lines == before.n_lines
    # Mirroring turns right to left: the right-hand normal of the mirrored line points the other way along the row.
    assert after.offset_px == pytest.approx(-before.offset_px, abs=1.0)


@settings(max_examples=15)
@given(seed=st.integers(0, 999), angle_deg=st.floats(-85, 85), gain=st.floats(0.6, 1.5), lift=st.floats(-20, 40))
def test_a_brighter_or_darker_frame_has_the_same_answer(
    finder: LineFinder, seed: int, angle_deg: float, gain: float, lift: float
) -> None:
    frame = nadir_frame(seed, math.radians(angle_deg), 20.0)
    changed = np.clip(np.rint(frame * gain + lift), 0, 255).astype(np.uint8)
    before, after = finder.find(frame), finder.find(changed)
    assert before.angle_rad is not None
    assert angle_error_deg(after, before.angle_rad) < 0.3
    assert after.n_lines == before.n_lines
    assert after.offset_px == pytest.approx(before.offset_px, abs=1.0)


@settings(max_examples=15)
@given(seed=st.integers(0, 999), angle_deg=st.floats(-85, 85), sigma=st.floats(0.5, 8.0))
def test_a_noisier_frame_has_the_same_answer(finder: LineFinder, seed: int, angle_deg: float, sigma: float) -> None:
    frame = nadir_frame(seed, math.radians(angle_deg), 20.0)
    noise = np.random.default_rng(seed).normal(0.0, sigma, frame.shape)
    before, after = finder.find(frame), finder.find(np.clip(np.rint(frame + noise), 0, 255).astype(np.uint8))
    assert before.angle_rad is not None
    assert after.is_present
    assert angle_error_deg(after, before.angle_rad) < 0.5
    assert after.offset_px == pytest.approx(before.offset_px, abs=1.5)


def test_the_same_frame_has_the_same_answer(finder: LineFinder) -> None:
    frame = nadir_frame(9, 0.7, -40.0)
    first, second = finder.find(frame), LineFinder(VisionSettings()).find(frame.copy())
    np.testing.assert_array_equal(first.segments, second.segments)
    np.testing.assert_array_equal(first.power_lines, second.power_lines)
    assert first.estimate(5) == second.estimate(5)


def test_colour_and_grey_agree(finder: LineFinder) -> None:
    frame = nadir_frame(9, 0.7, -40.0)
    assert finder.find(frame).estimate(5) == finder.find(np.repeat(frame[:, :, None], 3, axis=2)).estimate(5)


@pytest.mark.parametrize("detector", ["projection", "cbs", "steerable", "hough", "lsd", "edlines"])
def test_every_detector_finds_a_plain_line_and_answers_anything(detector: Detector) -> None:
    finder = LineFinder(VisionSettings(detector=detector))
    frame = expose(draw_line(draw_line(np.full((480, 640), 90.0), 0.4, 40.0, 5.0, 220.0), 0.4, 90.0, 5.0, 220.0), 1)
    detection = finder.find(frame)
    assert is_honest(detection)
    assert detection.is_present
    assert detection.n_lines == 2
    assert angle_error_deg(detection, 0.4) < 0.3
    assert detection.offset_px == pytest.approx(65.0, abs=1.5)
    for size in ((1, 1), (7, 90), (40, 30)):
        assert is_honest(finder.find(np.random.default_rng(1).integers(0, 256, size, dtype=np.uint8)))


@pytest.mark.parametrize(
    ("detector", "lens"),
    [*itertools.product(["projection", "cbs", "steerable"], ["none"]),
     *itertools.product(["projection"], ["mild", "wide", "fisheye"])],
)  # fmt: skip
def test_no_frame_waits_for_the_compiler(detector: Detector, lens: str) -> None:
    # In a process of its own: in this one other tests have compiled the kernels for every kind of image.
    command = [sys.executable, "-m", "tests.vision.count_compilations", detector, lens]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    n_warm, n_late = (int(word) for word in done.stdout.split())
    assert n_warm > 5
    assert n_late == 0


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: EdgeSettings(quantile=1.5), "quantile is 1.5"),
        (lambda: EdgeSettings(low_ratio=0.0), "low_ratio is 0.0"),
        (lambda: ProjectionSettings(min_coherence=2.0), "min_coherence is 2.0"),
        (lambda: SteerableSettings(quantile=0.0), "quantile is 0.0"),
        (lambda: SteerableSettings(sigma_px=0.5), "sigma_px is 0.5"),
        (lambda: VisionSettings(presence_min_support=0.0), "presence_min_support is 0.0"),
    ],
)
def test_what_is_no_share_is_refused(make: Callable[[], object], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        make()


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"radius_px": 5, "radius_step_px": 4}, "radius_px 5"),
        ({"skip_px": 0}, "skip_px"),
        ({"seed_grid_px": 0}, "seed_grid_px"),
        ({"min_fill": 0.0}, "min_fill is 0.0"),
        ({"min_walk_fill": 1.5}, "min_walk_fill is 1.5"),
    ],
)
def test_settings_that_cannot_work_are_refused(wrong: dict[str, int], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        CbsSettings(**wrong)
