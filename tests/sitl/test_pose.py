"""The shared pose: the newest is read, and a writer that dies does not hang its readers."""

from collections.abc import Iterator
from multiprocessing import shared_memory

import numpy as np
import pytest

from sitl.pose import Pose, PoseBlock

POSE = Pose(5, 1.0, 2.0, -3.0, (1.0, 0.0, 0.0, 0.0))


@pytest.fixture
def block() -> Iterator[PoseBlock]:
    block = PoseBlock.create()
    yield block
    block.close()


def die_within_a_write(name: str) -> None:
    """Leave the counter as a writer does that was killed between its two increments."""
    memory = shared_memory.SharedMemory(name=name)
    np.ndarray((1,), dtype=np.int64, buffer=memory.buf)[0] += 1
    memory.close()


def test_there_is_none_before_the_first() -> None:
    block = PoseBlock.create()
    assert block.read() is None
    block.close()


def test_the_newest_is_read(block: PoseBlock) -> None:
    block.write(Pose(4, 0.0, 0.0, 0.0, POSE.quaternion))
    block.write(POSE)
    assert block.read() == POSE


def test_a_dead_writer_leaves_the_last_pose_read(block: PoseBlock) -> None:
    block.write(POSE)
    assert block.read() == POSE
    die_within_a_write(block.name)
    assert block.read() == POSE


def test_a_writer_that_died_at_once_leaves_none(block: PoseBlock) -> None:
    die_within_a_write(block.name)
    assert block.read() is None
