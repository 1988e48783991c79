"""The V4L2 camera on a real driver: sizes, stamps, newest frame, loss. Runs in the guest (`make test-v4l2`).

The guest may be slow, so rates are low and what is said of time is said of the kernel's stamps.
"""

import statistics
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from drivers.camera.camera import CameraError, CameraLost, CameraSettings, Frame
from drivers.camera.v4l2 import V4l2Camera, open_v4l2
from drivers.camera.v4l2_device import list_devices, read_controls
from drivers.clock import NS_PER_S, ScaledClock
from tests.v4l2_guest import vivid
from tests.v4l2_guest.vivid import DEVICE, Control

SETTINGS = CameraSettings(width_px=320, height_px=180, rate_hz=10.0)
PERIOD_NS = round(NS_PER_S / SETTINGS.rate_hz)
TIMEOUT_S = 20.0


class StampsOnly(ScaledClock):
    """A clock that is not for looking at: every capture time must be the kernel's stamp."""

    def now_ns(self) -> int:
        raise AssertionError("the frame has no usable stamp")


@pytest.fixture(autouse=True)
def fresh_camera() -> Iterator[None]:
    """Each test finds the camera newly plugged in, and stamps that lie in the past."""
    vivid.unplug()
    vivid.plug_in()
    vivid.set_control(Control.TIMESTAMP_SOURCE, 1)
    yield
    vivid.unplug()


def open_camera(settings: CameraSettings = SETTINGS, clock: ScaledClock | None = None) -> V4l2Camera:
    return open_v4l2(DEVICE, settings, clock or ScaledClock())


def read(camera: V4l2Camera) -> Frame:
    frame = camera.read(TIMEOUT_S)
    assert frame is not None
    return frame


def read_to_the_end(camera: V4l2Camera) -> None:
    """Read what was still on its way; after that the camera must raise."""
    for _ in range(5):
        read(camera)


@pytest.mark.parametrize(
    "settings",
    [
        CameraSettings(320, 180, 30.0),
        CameraSettings(640, 360, 30.0),
        CameraSettings(640, 480, 25.0),
        CameraSettings(1280, 720, 10.0),
    ],
    ids=lambda settings: f"{settings.width_px}x{settings.height_px}",
)
def test_frames_are_read_only_colour_images_of_the_size_asked_for(settings: CameraSettings) -> None:
    with open_camera(settings) as camera:
        image = read(camera).image
    assert image.shape == (settings.height_px, settings.width_px, 3)
    assert image.dtype == np.uint8
    assert not image.flags.writeable


@pytest.mark.parametrize(
    ("pattern", "channel"), [(vivid.BLUE, 0), (vivid.GREEN, 1), (vivid.RED, 2)], ids=["blue", "green", "red"]
)
def test_colours_come_in_the_order_blue_green_red(pattern: int, channel: int) -> None:
    vivid.set_control(Control.TEST_PATTERN, pattern)
    vivid.set_control(Control.OSD_TEXT, 2)
    with open_camera() as camera:
        colour = np.median(read(camera).image, axis=(0, 1))
    assert colour[channel] > 200
    assert np.delete(colour, channel).max() < 60


def test_capture_times_are_the_kernels_stamps_a_period_apart() -> None:
    with open_camera(clock=StampsOnly()) as camera:
        frames = [read(camera) for _ in range(12)]
        age_ns = time.monotonic_ns() - frames[-1].t_capture_ns
    assert 0 <= age_ns < NS_PER_S
    steps_ns = [(b.t_capture_ns - a.t_capture_ns) / (b.seq - a.seq) for a, b in pairwise(frames)]
    assert min(steps_ns) > 0
    assert statistics.median(steps_ns) == pytest.approx(PERIOD_NS, rel=0.3)


@pytest.mark.parametrize(
    ("control", "value"),
    [(Control.WRAP_TIMESTAMP, 2), (Control.TIMESTAMP_SOURCE, 0)],
    ids=["another clock", "future"],
)
def test_a_stamp_of_another_clock_or_of_the_future_gives_way_to_the_arrival(control: Control, value: int) -> None:
    vivid.set_control(control, value)
    before_ns = time.monotonic_ns()
    with open_camera() as camera:
        times_ns = [read(camera).t_capture_ns for _ in range(3)]
        assert before_ns <= times_ns[0] < times_ns[1] < times_ns[2] <= time.monotonic_ns()


def test_frames_are_counted_from_zero() -> None:
    with open_camera() as camera:
        seqs = [read(camera).seq for _ in range(5)]
    assert seqs[0] == 0
    assert all(a < b for a, b in pairwise(seqs))


def test_a_slow_reader_gets_the_newest_frame_and_sees_the_gap() -> None:
    pause_s = 2.0
    with open_camera() as camera:
        first = read(camera)
        time.sleep(pause_s)
        second = read(camera)
        age_ns = time.monotonic_ns() - second.t_capture_ns
    assert second.seq > first.seq + 1
    assert age_ns < pause_s / 2 * NS_PER_S


def test_a_camera_that_stalls_gives_nothing_in_time_and_then_goes_on() -> None:
    with open_camera() as camera:
        seq = read(camera).seq
        vivid.set_control(Control.DROPPED_PERCENT, 100)
        while (frame := camera.read(1.0)) is not None:  # those that were on their way
            seq = frame.seq
        vivid.set_control(Control.DROPPED_PERCENT, 0)
        assert read(camera).seq > seq


@pytest.mark.parametrize(
    ("settings", "answer"),
    [
        (CameraSettings(800, 600, 10.0), "asked for 800 x 600 px at 10 Hz but gives 640 x 480 px at 10 Hz as YUYV"),
        (
            CameraSettings(640, 480, 60.0),
            "asked for 640 x 480 px at 60 Hz but gives 640 x 480 px at 25 Hz as YUYV and .* as BGR3",
        ),
    ],
    ids=["size", "rate"],
)
def test_what_the_camera_does_not_have_is_refused_with_what_it_gives(settings: CameraSettings, answer: str) -> None:
    with pytest.raises(CameraError, match=answer):
        open_camera(settings)
    with open_camera() as camera:  # the refused one was let go
        read(camera)


def test_a_camera_in_use_is_refused_until_it_is_let_go() -> None:
    with open_camera() as camera:
        read(camera)
        with pytest.raises(CameraError, match="end the program that uses it"):
            open_camera()
        read(camera)
    with open_camera() as camera:
        read(camera)


def test_a_missing_camera_is_refused() -> None:
    vivid.unplug()
    with pytest.raises(CameraError, match=f"no camera at {DEVICE}; plug it in"):
        open_camera()


def test_a_device_that_is_no_camera_is_refused() -> None:
    with pytest.raises(CameraError, match="/dev/null cannot be opened"):
        open_v4l2(Path("/dev/null"), SETTINGS, ScaledClock())


@pytest.mark.parametrize(
    "lose",
    [
        vivid.unplug,
        lambda: vivid.set_control(Control.DISCONNECT),
        lambda: vivid.set_control(Control.FATAL_STREAMING_ERROR),
    ],
    ids=["unplugged", "disconnected", "broken"],
)
def test_a_lost_camera_raises_after_its_last_frame(lose: Callable[[], None]) -> None:
    with open_camera() as camera:
        read(camera)
        lose()
        with pytest.raises(CameraLost, match="stopped giving frames; check its cable"):
            read_to_the_end(camera)


def test_a_camera_that_was_unplugged_can_be_opened_anew() -> None:
    with open_camera() as camera:
        read(camera)
        vivid.unplug()
    vivid.plug_in()
    with open_camera() as camera:
        assert read(camera).seq == 0


def test_the_camera_is_listed_with_its_modes() -> None:
    (device,) = list_devices()
    assert (device.path, device.driver) == (DEVICE, "vivid")
    mode = next(mode for mode in device.modes if (mode.pixel_format, mode.width_px) == ("YUYV", 640))
    assert max(mode.rates_hz) >= 25.0
    assert list_devices(Path("/nowhere")) == []


def test_controls_are_set_in_order_and_change_the_image() -> None:
    levels = []
    for brightness in (20, 230):
        settings = replace(SETTINGS, controls=(("gain_automatic", 0), ("brightness", brightness)))
        with open_camera(settings) as camera:
            levels.append(float(read(camera).image.mean()))
            assert value_of("brightness") == brightness
    assert levels[1] > levels[0] + 30


def value_of(name: str) -> int | None:
    return next(control.value for control in read_controls(DEVICE) if control.name == name)


def test_a_control_out_of_its_range_and_an_unknown_one_are_refused() -> None:
    for controls, words in (
        ((("brightness", 9999),), "brightness of /dev/video0 takes 0 to 255, not 9999"),
        ((("brightnes", 10),), "no control 'brightnes'; it has .*brightness"),
    ):
        with pytest.raises(CameraError, match=words):
            open_camera(replace(SETTINGS, controls=controls))
    with open_camera() as camera:  # the refused ones were let go
        read(camera)


def test_a_pixel_format_that_is_asked_for_is_given_or_refused() -> None:
    with open_camera(replace(SETTINGS, pixel_format="UYVY")) as camera:
        assert read(camera).image.shape == (180, 320, 3)
    with pytest.raises(CameraError, match="as MJPG but gives 320 x 180 px at 10 Hz as "):
        open_camera(replace(SETTINGS, pixel_format="MJPG"))
