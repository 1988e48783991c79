"""Lens distortion: points go to and fro, and a bent line is found as straight as it is."""

import math

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.camera.camera import Intrinsics
from tests.vision.nadir_frames import nadir_frame
from vision.lens import LensCorrection, bend_px, distort_points, undistort_points
from vision.pipeline import LineFinder, VisionSettings

MILD = Intrinsics(640, 480, 380.0, 381.0, 321.0, 238.0, (-0.005, 0.0, 0.0, 0.0, 0.0))
WIDE = Intrinsics(640, 480, 380.0, 381.0, 321.0, 238.0, (-0.24, 0.05, 0.0008, -0.0005, 0.0))
FISHEYE = Intrinsics(640, 480, 250.0, 251.0, 322.0, 238.0, (-0.03, 0.006, -0.004, 0.001), "fisheye")
LENSES = pytest.mark.parametrize("camera", [MILD, WIDE, FISHEYE], ids=["mild", "wide", "fisheye"])


def seen_through(camera: Intrinsics, straight: np.ndarray) -> np.ndarray:
    """The frame that the camera takes of what a straight camera would see as `straight`."""
    x, y = np.meshgrid(np.arange(640.0), np.arange(480.0))
    at = undistort_points(np.stack([x.ravel(), y.ravel()], axis=1), camera).reshape(480, 640, 2)
    at = np.nan_to_num(at, nan=-1e4).astype(np.float32)
    return cv2.remap(straight, at[..., 0], at[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT_101)


@LENSES
@given(x=st.floats(0, 639), y=st.floats(0, 479))
def test_points_go_to_and_fro(camera: Intrinsics, x: float, y: float) -> None:
    there = undistort_points(np.array([[x, y]]), camera)
    if math.hypot(x - camera.cx_px, y - camera.cy_px) > 1.4 * camera.fx_px:
        return  # more than 80 degrees off the axis of the fisheye: it may have no place in a straight image
    assert distort_points(there, camera) == pytest.approx(np.array([[x, y]]), abs=0.01)


def test_what_lies_behind_the_camera_has_no_place() -> None:
    assert np.isnan(undistort_points(np.array([[0.0, 0.0]]), FISHEYE)).all()


def test_no_points_no_work() -> None:
    assert undistort_points(np.empty((0, 2)), WIDE).shape == (0, 2)
    assert distort_points(np.empty((0, 2)), WIDE).shape == (0, 2)


def test_how_far_a_lens_bends_decides_what_is_moved() -> None:
    straight = Intrinsics(640, 480, 380.0, 380.0, 320.0, 240.0)
    assert bend_px(straight) == 0.0
    assert 0.1 < bend_px(MILD) < 1.0 < bend_px(WIDE) < bend_px(FISHEYE)
    assert not LensCorrection(MILD).straightens_frames
    assert LensCorrection(WIDE).straightens_frames


@LENSES
@pytest.mark.parametrize(("angle_rad", "offset_px"), [(0.0, 120.0), (0.5, -60.0), (1.4, 100.0)])
def test_the_estimate_is_that_of_a_straight_camera(camera: Intrinsics, angle_rad: float, offset_px: float) -> None:
    frame = seen_through(camera, nadir_frame(4, angle_rad, offset_px, spacing_px=40.0))
    detection = LineFinder(VisionSettings(camera=camera)).find(frame)
    assert detection.is_present
    assert detection.n_lines == 3
    assert detection.angle_rad == pytest.approx(angle_rad, abs=math.radians(0.4))
    assert detection.offset_px == pytest.approx(offset_px, abs=1.5)
    assert detection.spacing_px == pytest.approx(40.0, abs=1.0)


@LENSES
def test_what_is_drawn_lies_on_the_frame_itself(camera: Intrinsics) -> None:
    """Each end of a power line lies on a conductor of the frame, not of the straight image."""
    spacing_px = 40.0
    frame = seen_through(camera, nadir_frame(4, 0.3, 90.0, spacing_px=spacing_px))
    detection = LineFinder(VisionSettings(camera=camera)).find(frame)
    ends = undistort_points(detection.power_lines.reshape(-1, 2), camera)
    aside = (ends[:, 0] - 319.5) * math.cos(0.3) + (ends[:, 1] - 239.5) * math.sin(0.3) - 90.0
    nearest = aside - spacing_px * np.rint(aside / spacing_px)
    assert np.abs(aside).max() < 1.5 * spacing_px
    assert np.abs(nearest).max() < 4.0
    assert not detection.power_lines.flags.writeable


def test_a_bent_line_is_lost_without_the_correction() -> None:
    """What the correction is there for: without it this test's lens hides the line group."""
    frame = seen_through(WIDE, nadir_frame(4, 0.0, 180.0, spacing_px=40.0))
    plain, corrected = (LineFinder(VisionSettings(camera=camera)).find(frame) for camera in (None, WIDE))
    assert corrected.is_present
    assert corrected.n_lines == 3
    assert not plain.is_present or plain.n_lines < 3


def test_a_frame_of_another_size_is_refused() -> None:
    finder = LineFinder(VisionSettings(camera=WIDE))
    with pytest.raises(ValueError, match="320 x 240 px"):
        finder.find(np.zeros((240, 320), np.uint8))


def test_a_camera_that_cannot_be_is_refused() -> None:
    for arguments, words in (
        ((640, 480, 0.0, 1.0, 1.0, 1.0), "positive"),
        ((640, 480, 1.0, 1.0, 1.0, 1.0, (0.1,)), "5 distortion"),
        ((640, 480, 1.0, 1.0, 1.0, 1.0, (0.1,) * 5, "fisheye"), "4 distortion"),
        ((640, 480, 1.0, 1.0, math.nan, 1.0), "finite"),
    ):
        with pytest.raises(ValueError, match=words):
            Intrinsics(*arguments)  # type: ignore[arg-type]
