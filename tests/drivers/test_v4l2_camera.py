"""The V4L2 camera against a fake device: settings, stamps, newest frame, loss."""

import queue
import threading
import time
from pathlib import Path

import cv2
import numpy as np
import pytest

from drivers.camera.camera import CameraError, CameraSettings, Frame
from drivers.camera.v4l2 import V4l2Camera, open_v4l2
from drivers.clock import NS_PER_S, ScaledClock

SETTINGS = CameraSettings(width_px=64, height_px=48, rate_hz=30.0)
TIMEOUT_S = 30.0


class FakeCapture:
    """A USB camera's side of cv2.VideoCapture: modes by pixel format, and frames when the test gives them."""

    def __init__(self, modes: dict[str, tuple[int, int, float]], *, is_busy: bool = False) -> None:
        self.modes = modes
        self.is_busy = is_busy
        self.pixel_format = ""
        self.frames: queue.Queue[np.ndarray | None] = queue.Queue()
        self.is_waiting = threading.Semaphore(0)
        self.is_released = threading.Event()
        self.stamp_ms = 0.0
        self._image: np.ndarray | None = None

    def isOpened(self) -> bool:  # noqa: N802
        return not self.is_busy

    def set(self, propId: int, value: float) -> bool:  # noqa: N803
        if propId == cv2.CAP_PROP_FOURCC:
            self.pixel_format = int(value).to_bytes(4, "little").decode()
        return True

    def get(self, propId: int) -> float:  # noqa: N803
        if propId == cv2.CAP_PROP_POS_MSEC:
            return self.stamp_ms
        width_px, height_px, rate_hz = self.modes[self.pixel_format]
        return {
            cv2.CAP_PROP_FRAME_WIDTH: width_px,
            cv2.CAP_PROP_FRAME_HEIGHT: height_px,
            cv2.CAP_PROP_FPS: rate_hz,
            cv2.CAP_PROP_FOURCC: cv2.VideoWriter.fourcc(*self.pixel_format),
        }[propId]

    def grab(self) -> bool:
        self.is_waiting.release()
        self._image = self.frames.get(timeout=TIMEOUT_S)
        return self._image is not None

    def retrieve(self) -> tuple[bool, np.ndarray]:
        assert self._image is not None
        return True, self._image

    def release(self) -> None:
        self.is_released.set()

    def give(self, level: int) -> None:
        self.frames.put(np.full((48, 64, 3), level, np.uint8))

    def unplug(self) -> None:
        self.frames.put(None)


@pytest.fixture
def device(tmp_path: Path) -> Path:
    path = tmp_path / "video0"
    path.touch()
    return path


def open_fake(capture: FakeCapture, device: Path, clock: ScaledClock | None = None) -> V4l2Camera:
    return open_v4l2(device, SETTINGS, clock or ScaledClock(), connect=lambda _: capture)


def read(camera: V4l2Camera) -> Frame:
    frame = camera.read(TIMEOUT_S)
    assert frame is not None
    return frame


def test_the_newest_frame_wins_and_dropped_ones_show_in_seq(device: Path) -> None:
    capture = FakeCapture({"YUYV": (64, 48, 30.0)})
    with open_fake(capture, device) as camera:
        for level in (10, 20, 30):
            capture.give(level)
        for _ in range(4):  # three frames taken, and waiting for a fourth
            assert capture.is_waiting.acquire(timeout=TIMEOUT_S)
        frame = read(camera)
        assert (frame.seq, int(frame.image[0, 0, 0])) == (2, 30)
        assert not frame.image.flags.writeable
        assert camera.read(0.0) is None
        capture.give(40)
        assert read(camera).seq == 3
        capture.unplug()


def test_capture_time_is_the_drivers_stamp_in_flight_time(device: Path) -> None:
    capture = FakeCapture({"YUYV": (64, 48, 30.0)})
    capture.stamp_ms = time.monotonic_ns() / 1e6
    with open_fake(capture, device) as camera:
        capture.give(1)
        assert abs(read(camera).t_capture_ns - capture.stamp_ms * 1e6) < 1e3
        capture.unplug()


def test_capture_time_is_scaled_with_the_clock(device: Path) -> None:
    stamp_ns = time.monotonic_ns()
    clock = ScaledClock(speed=4.0, epoch_ns=stamp_ns - NS_PER_S)
    capture = FakeCapture({"YUYV": (64, 48, 30.0)})
    capture.stamp_ms = stamp_ns / 1e6
    with open_fake(capture, device, clock) as camera:
        capture.give(1)
        # The stamp lies a second after the epoch, and flight time runs at four times the speed from there.
        assert read(camera).t_capture_ns == pytest.approx(stamp_ns + 3 * NS_PER_S, abs=1e4)
        capture.unplug()


def test_a_driver_without_stamps_gets_the_time_of_arrival(device: Path) -> None:
    capture = FakeCapture({"YUYV": (64, 48, 30.0)})
    before_ns = time.monotonic_ns()
    with open_fake(capture, device) as camera:
        capture.give(1)
        assert before_ns <= read(camera).t_capture_ns <= time.monotonic_ns()
        capture.unplug()


def test_a_camera_too_slow_in_raw_is_asked_for_mjpg(device: Path) -> None:
    capture = FakeCapture({"YUYV": (64, 48, 10.0), "MJPG": (64, 48, 30.0)})
    open_fake(capture, device)
    assert capture.pixel_format == "MJPG"


def test_a_camera_of_another_size_is_refused_with_what_it_has(device: Path) -> None:
    capture = FakeCapture({"YUYV": (640, 480, 30.0), "MJPG": (640, 480, 60.0)})
    with pytest.raises(CameraError, match="asked for 64 x 48 px at 30 Hz but gives 640 x 480 px at 30 Hz as YUYV and"):
        open_fake(capture, device)
    assert capture.is_released.is_set()


def test_a_busy_camera_is_refused(device: Path) -> None:
    with pytest.raises(CameraError, match="end the program that uses it"):
        open_fake(FakeCapture({}, is_busy=True), device)


def test_an_unplugged_camera_raises_after_its_last_frame_and_is_released(device: Path) -> None:
    capture = FakeCapture({"YUYV": (64, 48, 30.0)})
    with open_fake(capture, device) as camera:
        capture.give(1)
        capture.unplug()
        assert capture.is_released.wait(TIMEOUT_S)
        assert read(camera).seq == 0
        with pytest.raises(CameraError, match="stopped giving frames; check its cable"):
            camera.read(TIMEOUT_S)


def test_leaving_the_camera_releases_it(device: Path) -> None:
    capture = FakeCapture({"YUYV": (64, 48, 30.0)})

    def give_on_and_on() -> None:
        while not capture.is_released.wait(0.001):
            capture.give(1)

    shutter = threading.Thread(target=give_on_and_on)
    with open_fake(capture, device) as camera:
        shutter.start()
        read(camera)
    assert capture.is_released.wait(TIMEOUT_S)
    shutter.join()
