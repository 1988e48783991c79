"""Recordings as cameras, the scripted camera, and the specs that name a camera."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from drivers.camera.camera import CameraError, CameraSettings, Frame
from drivers.camera.recorded import ImageFiles, LoggedImages, RecordedCamera, open_recording
from drivers.camera.scripted import ScriptedCamera
from drivers.camera.spec import open_camera
from drivers.clock import NS_PER_S, ScaledClock
from drivers.mcap_stream import MAGIC
from mission.log.reader import read_flight
from tests.log.synthetic_flight import HEIGHT_PX, WIDTH_PX, fly, write_log

SETTINGS = CameraSettings(width_px=64, height_px=48, rate_hz=10.0)
PERIOD_NS = NS_PER_S // 10


class VirtualClock:
    """Time that passes only by sleeping, or when a test says so."""

    def __init__(self) -> None:
        self.t_ns = 1_000

    def now_ns(self) -> int:
        return self.t_ns

    def wall_s(self, flight_s: float) -> float:
        return max(0.0, flight_s)

    def sleep(self, duration_s: float) -> None:
        self.t_ns += round(duration_s * NS_PER_S)


def grey_level(frame: Frame | None) -> int:
    assert frame is not None
    return round(float(frame.image.mean()))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for level in (50, 10, 40, 30, 20):
        cv2.imwrite(str(tmp_path / f"frame_{level:03d}.png"), np.full((48, 64, 3), level, np.uint8))
    (tmp_path / "notes.txt").write_text("not an image")
    return tmp_path


def test_a_folder_plays_in_name_order_at_the_settings_rate_and_ends(folder: Path) -> None:
    clock = VirtualClock()
    camera = RecordedCamera(ImageFiles(sorted(folder.glob("*.png"))), SETTINGS, clock, clock.sleep)
    frames = [camera.read(1.0) for _ in range(5)]
    assert [grey_level(frame) for frame in frames] == [10, 20, 30, 40, 50]
    assert [frame.seq for frame in frames if frame] == [0, 1, 2, 3, 4]
    assert [frame.t_capture_ns for frame in frames if frame] == [1_000 + i * PERIOD_NS for i in range(5)]
    with pytest.raises(EOFError):
        camera.read(1.0)


def test_frames_are_read_only(folder: Path) -> None:
    with open_recording(folder, SETTINGS, VirtualClock()) as camera:
        frame = camera.read(0.0)
    assert frame is not None
    assert not frame.image.flags.writeable


def test_a_slow_reader_gets_the_newest_frame_and_sees_the_gap(folder: Path) -> None:
    clock = VirtualClock()
    camera = RecordedCamera(ImageFiles(sorted(folder.glob("*.png"))), SETTINGS, clock, clock.sleep)
    camera.read(1.0)
    clock.sleep(0.35)
    frame = camera.read(1.0)
    assert grey_level(frame) == 40
    assert frame is not None
    assert frame.seq == 3


def test_a_read_gives_up_after_its_timeout(folder: Path) -> None:
    clock = VirtualClock()
    camera = RecordedCamera(ImageFiles(sorted(folder.glob("*.png"))), SETTINGS, clock, clock.sleep)
    camera.read(0.0)
    assert camera.read(0.03) is None
    assert clock.t_ns == 1_000 + round(0.03 * NS_PER_S)
    assert grey_level(camera.read(0.08)) == 20


def test_a_reader_later_than_the_end_gets_the_end(folder: Path) -> None:
    clock = VirtualClock()
    camera = RecordedCamera(ImageFiles(sorted(folder.glob("*.png"))), SETTINGS, clock, clock.sleep)
    camera.read(0.0)
    clock.sleep(60.0)
    with pytest.raises(EOFError):
        camera.read(0.0)


def test_one_image_is_one_frame(folder: Path) -> None:
    with open_camera(f"file:{folder / 'frame_030.png'}", SETTINGS, ScaledClock()) as camera:
        assert grey_level(camera.read(1.0)) == 30
        with pytest.raises(EOFError):
            camera.read(1.0)


def test_a_video_plays_at_its_own_rate(tmp_path: Path) -> None:
    path = tmp_path / "flight.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 25.0, (64, 48))
    for level in (20, 120, 220):
        writer.write(np.full((48, 64, 3), level, np.uint8))
    writer.release()
    with open_recording(path, SETTINGS, VirtualClock()) as camera:
        frames = [camera.read(1.0) for _ in range(3)]
        with pytest.raises(EOFError):
            camera.read(1.0)
    assert [grey_level(frame) for frame in frames] == pytest.approx([20, 120, 220], abs=2)
    assert np.diff([frame.t_capture_ns for frame in frames if frame]).tolist() == [NS_PER_S // 25] * 2


def test_an_image_of_another_size_is_refused_when_opened_and_when_it_comes_later(folder: Path) -> None:
    with pytest.raises(CameraError, match="64 x 48 px but the camera settings ask for 32 x 24 px"):
        open_recording(folder, CameraSettings(32, 24, 10.0), VirtualClock())
    cv2.imwrite(str(folder / "frame_015.png"), np.zeros((10, 10, 3), np.uint8))
    clock = VirtualClock()
    camera = RecordedCamera(ImageFiles(sorted(folder.glob("*.png"))), SETTINGS, clock, clock.sleep)
    camera.read(1.0)
    with pytest.raises(CameraError, match="10 x 10 px"):
        camera.read(1.0)


def test_a_damaged_image_is_named(folder: Path) -> None:
    (folder / "frame_000.png").write_bytes(b"\x89PNG but no more")
    with pytest.raises(CameraError, match=r"frame_000\.png cannot be decoded"):
        open_recording(folder, SETTINGS, VirtualClock())


@pytest.mark.parametrize(
    ("spec", "words"),
    [
        ("usb:0", r"'usb:0' is not of a kind we know; .*v4l2:DEVICE.*file:PATH"),
        ("/dev/video0", "not of a kind we know"),
        ("file:", "not of a kind we know"),
        ("file:/nowhere/at/all.mp4", "There is no recording at /nowhere/at/all.mp4"),
        ("v4l2:/dev/video_of_nobody", "There is no camera at /dev/video_of_nobody"),
    ],
)
def test_a_camera_that_cannot_be_opened_says_why(spec: str, words: str) -> None:
    with pytest.raises(CameraError, match=words):
        open_camera(spec, SETTINGS, ScaledClock())


def test_an_empty_folder_and_a_file_that_is_no_video_are_refused(tmp_path: Path) -> None:
    with pytest.raises(CameraError, match="holds no images"):
        open_camera(f"file:{tmp_path}", SETTINGS, ScaledClock())
    (tmp_path / "flight.mp4").write_text("no video")
    with pytest.raises(CameraError, match="neither an image nor a video"):
        open_camera(f"file:{tmp_path / 'flight.mp4'}", SETTINGS, ScaledClock())


def test_a_scripted_camera_plays_its_script_and_ends() -> None:
    frame = Frame(0, 5, np.zeros((2, 2), np.uint8))
    with ScriptedCamera([None, frame, CameraError("unplugged")]) as camera:
        assert camera.is_open
        assert camera.read(9.0) is None
        assert camera.read(9.0) is frame
        with pytest.raises(CameraError, match="unplugged"):
            camera.read(9.0)
        with pytest.raises(EOFError):
            camera.read(9.0)
    assert not camera.is_open


@pytest.fixture(scope="module")
def flight_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("logs") / "flight.mcap"
    write_log(path, list(fly()))
    return path


LOG_SETTINGS = CameraSettings(WIDTH_PX, HEIGHT_PX, 30.0)


def test_a_flight_log_plays_the_frames_it_kept(flight_log: Path) -> None:
    kept = [report for report in read_flight(flight_log, with_images=True).reports if report.jpeg is not None]
    clock = VirtualClock()
    with RecordedCamera(LoggedImages(flight_log), LOG_SETTINGS, clock, clock.sleep) as camera:
        for report in kept:
            frame = camera.read(1.0)
            assert frame is not None
            expected = cv2.imdecode(np.frombuffer(report.jpeg or b"", np.uint8), cv2.IMREAD_COLOR)
            np.testing.assert_array_equal(frame.image, expected)
        with pytest.raises(EOFError):
            camera.read(1.0)


def test_a_flight_log_plays_at_the_rate_it_was_kept_at(flight_log: Path) -> None:
    kept = [report for report in read_flight(flight_log, with_images=True).reports if report.jpeg is not None]
    period_ns = np.median(np.diff([report.t_capture_ns for report in kept]))
    clock = VirtualClock()
    with open_recording(flight_log, LOG_SETTINGS, clock) as camera:
        camera._sleep = clock.sleep
        first, second = camera.read(10.0), camera.read(10.0)
    assert first is not None
    assert second is not None
    assert second.t_capture_ns - first.t_capture_ns == pytest.approx(period_ns, rel=0.01)


def test_a_log_that_was_cut_off_plays_as_far_as_it_goes(flight_log: Path, tmp_path: Path) -> None:
    whole = flight_log.read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole[: len(whole) * 2 // 3])
    clock = VirtualClock()
    with RecordedCamera(LoggedImages(cut), LOG_SETTINGS, clock, clock.sleep) as camera:
        assert camera.read(1.0) is not None
        with pytest.raises(EOFError):
            read_to_the_end(camera)


def read_to_the_end(camera: RecordedCamera) -> None:
    while True:
        camera.read(1.0)


@pytest.mark.parametrize(
    ("body", "words"), [(b"", "not an MCAP file"), (b"not a log", "not an MCAP file"), (MAGIC, "holds no frames")]
)
def test_what_is_no_log_with_frames_is_refused(tmp_path: Path, body: bytes, words: str) -> None:
    file = tmp_path / "flight.mcap"
    file.write_bytes(body)
    with pytest.raises(CameraError, match=words):
        open_recording(file, LOG_SETTINGS, VirtualClock())
