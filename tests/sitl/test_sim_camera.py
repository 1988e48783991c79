"""The simulated camera keeps the camera protocol: newest frame wins, gaps show in `seq`, errors are sentences."""

import itertools
import math
from collections.abc import Iterator

import numpy as np
import pytest

from drivers.camera.camera import Camera, CameraError, Frame, Intrinsics
from drivers.clock import ScaledClock
from sitl.camera import SimCamera
from sitl.pose import Pose, PoseBlock
from sitl.render.lens import pinhole

INTRINSICS = pinhole(160, 120, math.radians(70.0))
RATE_HZ = 200.0
LEVEL = (1.0, 0.0, 0.0, 0.0)
WAIT_S = 30.0


@pytest.fixture
def poses() -> Iterator[PoseBlock]:
    block = PoseBlock.create()
    yield block
    block.close()


def camera_on(poses: PoseBlock, intrinsics: Intrinsics = INTRINSICS, rate_hz: float = RATE_HZ) -> SimCamera:
    return SimCamera(None, poses.name, ScaledClock(), intrinsics, rate_hz, seed=1)


def next_frame(camera: Camera) -> Frame:
    frame = camera.read(WAIT_S)
    assert frame is not None
    return frame


def drain(camera: Camera) -> None:
    """Read on until the camera refuses; a last frame may still lie in the box of a closed one."""
    while camera.read(WAIT_S) is not None:
        pass


def test_frames_show_the_newest_pose(poses: PoseBlock) -> None:
    poses.write(Pose(111, 0.0, 0.0, -5.0, LEVEL))
    with camera_on(poses) as camera:
        low = next_frame(camera)
        assert low.t_capture_ns == 111
        assert low.image.shape == (120, 160, 3)
        assert low.image.dtype == np.uint8
        assert not low.image.flags.writeable

        poses.write(Pose(222, 11.3, 4.1, -16.0, LEVEL))
        while (high := next_frame(camera)).t_capture_ns == 111:
            pass
        assert high.t_capture_ns == 222
        assert high.seq > low.seq
        assert np.abs(high.image.astype(int) - low.image.astype(int)).mean() > 5.0


def test_frames_are_smeared_by_the_way_between_their_poses(poses: PoseBlock) -> None:
    """So fast that a noon's exposure smears, the ground loses its grain along the flight; standing still, not."""
    grains = []
    for step_m in (0.0, 150.0):
        poses.write(Pose(1_000_000_000, 9.0 - step_m, 4.1, -8.0, LEVEL))
        with camera_on(poses) as camera:
            next_frame(camera)
            poses.write(Pose(1_100_000_000, 9.0, 4.1, -8.0, LEVEL))
            frame = next_frame(camera)
            while frame.t_capture_ns != 1_100_000_000:
                frame = next_frame(camera)
        green = frame.image[:, :, 1].astype(float)
        grains.append(np.abs(np.diff(green, axis=0)).mean())
    assert 0.0 < grains[1] < 0.8 * grains[0]


def test_frames_missed_by_the_reader_and_by_the_renderer_count(poses: PoseBlock) -> None:
    """At 100 kHz no renderer keeps up: the numbers must tell of the frames that were never made."""
    poses.write(Pose(1, 0.0, 0.0, -5.0, LEVEL))
    with camera_on(poses, pinhole(64, 48, math.radians(70.0)), 100_000.0) as camera:
        seqs = [next_frame(camera).seq for _ in range(4)]
    assert all(later - earlier > 1 for earlier, later in itertools.pairwise(seqs))


def test_there_is_no_frame_before_the_vehicle_is_there(poses: PoseBlock) -> None:
    with camera_on(poses) as camera:
        assert camera.read(0.05) is None
        poses.write(Pose(5, 0.0, 0.0, -1.0, LEVEL))
        assert next_frame(camera).t_capture_ns == 5


def test_it_can_be_entered_again_and_ends_when_left(poses: PoseBlock) -> None:
    poses.write(Pose(1, 0.0, 0.0, -5.0, LEVEL))
    camera = camera_on(poses)
    for _ in range(2):
        with camera:
            next_frame(camera)
        with pytest.raises(EOFError):
            drain(camera)


def test_a_missing_vehicle_is_a_sentence() -> None:
    camera = SimCamera(None, "no_such_block", ScaledClock(), INTRINSICS, RATE_HZ, seed=1)
    with pytest.raises(CameraError, match="no_such_block") as caught, camera:
        pass
    assert str(caught.value).endswith(".")


def test_a_missing_world_is_a_sentence(poses: PoseBlock) -> None:
    with (
        pytest.raises(CameraError, match="atlantis"),
        SimCamera("atlantis", poses.name, ScaledClock(), INTRINSICS, RATE_HZ, 1),
    ):
        pass
