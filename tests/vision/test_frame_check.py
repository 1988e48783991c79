"""What is said about a frame that shows nothing."""

import numpy as np
import pytest
from numpy.typing import NDArray

from drivers.clock import NS_PER_S
from vision.frame_check import FrameCheck, FrameCheckSettings
from vision.records import Trouble

SHAPE = (120, 160, 3)


def noise(seed: int, level: float, spread: float) -> NDArray[np.uint8]:
    values = np.random.default_rng(seed).normal(level, spread, SHAPE)
    return np.clip(np.rint(values), 0, 255).astype(np.uint8)


@pytest.mark.parametrize(
    ("image", "trouble"),
    [
        (noise(1, 90, 20), None),
        (noise(1, 3, 3), Trouble.DARK),
        (np.zeros(SHAPE, np.uint8), Trouble.DARK),
        (noise(1, 255, 10), Trouble.OVEREXPOSED),
        (noise(1, 120, 0.5), Trouble.FLAT),
        (np.full((1, 1), 120, np.uint8), Trouble.FLAT),
        (np.full(SHAPE, 120, np.uint16), Trouble.UNREADABLE),
        (np.full(SHAPE, 0.5), Trouble.UNREADABLE),
        (np.zeros((0, 5), np.uint8), Trouble.UNREADABLE),
        (np.zeros((5, 5, 4, 2), np.uint8), Trouble.UNREADABLE),
    ],
)
def test_a_frame_by_itself(image: NDArray[np.uint8], trouble: Trouble | None) -> None:
    assert FrameCheck(FrameCheckSettings()).trouble(image, 0) is trouble


def test_an_image_that_never_changes_is_frozen_until_it_does() -> None:
    check = FrameCheck(FrameCheckSettings(frozen_after_s=0.5))
    still = noise(1, 90, 20)
    answers = [check.trouble(still, seq * NS_PER_S // 10) for seq in range(8)]
    assert answers == [None] * 6 + [Trouble.FROZEN] * 2
    assert check.trouble(noise(2, 90, 20), NS_PER_S) is None
    assert check.trouble(still, NS_PER_S) is None


def test_two_equal_frames_far_apart_are_not_frozen() -> None:
    check = FrameCheck(FrameCheckSettings(frozen_after_s=0.5, n_frozen=5))
    still = noise(1, 90, 20)
    assert [check.trouble(still, seq * NS_PER_S) for seq in range(6)] == [None] * 4 + [Trouble.FROZEN] * 2
