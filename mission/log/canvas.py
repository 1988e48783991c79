"""Draw text, lines and panels on a picture, all antialiased; the picture's colours and type sizes live here."""

from dataclasses import dataclass
from enum import IntEnum

import cv2
import numpy as np
from numpy.typing import NDArray

Color = tuple[int, int, int]
"""Blue, green, red; 0 to 255."""

Image = NDArray[np.uint8]

BACKGROUND: Color = (28, 22, 17)
PANEL: Color = (41, 33, 27)
RULE: Color = (74, 62, 54)
INK: Color = (240, 236, 232)
DIM_INK: Color = (168, 156, 146)
SHADOW: Color = (18, 14, 10)
ACCENT: Color = (48, 176, 255)
GOOD: Color = (140, 205, 112)
BAD: Color = (92, 92, 240)

_SUBPIXEL_BITS = 4
_REGULAR, _BOLD = 400, 650


class Align(IntEnum):
    """Which point of a text stands where it was put."""

    LEFT = 0
    MIDDLE = 1
    RIGHT = 2


@dataclass(frozen=True, slots=True)
class Box:
    """A rectangle on the picture [px]."""

    x: int
    y: int
    width: int
    height: int

    @property
    def right(self) -> int:
        """The first column right of it."""
        return self.x + self.width

    @property
    def bottom(self) -> int:
        """The first row below it."""
        return self.y + self.height


class Canvas:
    """A picture under way. Places are x right, y down [px]; texts stand on their baseline."""

    def __init__(self, width_px: int, height_px: int) -> None:
        self.image: Image = np.full((height_px, width_px, 3), BACKGROUND, dtype=np.uint8)
        self._font = cv2.FontFace("sans")

    def text(
        self,
        place: tuple[float, float],
        words: str,
        size_px: int,
        color: Color = INK,
        *,
        align: Align = Align.LEFT,
        is_bold: bool = False,
    ) -> int:
        """Write a line of text; returns its width [px]."""
        weight = _BOLD if is_bold else _REGULAR
        width_px = self.text_width(words, size_px, is_bold=is_bold)
        x = round(place[0] - width_px * align / 2)
        cv2.putText(self.image, words, (x, round(place[1])), color, self._font, size_px, weight)
        return width_px

    def text_width(self, words: str, size_px: int, *, is_bold: bool = False) -> int:
        """How wide a text would be [px]."""
        area = (self.image.shape[1], self.image.shape[0])
        return cv2.getTextSize(area, words, (0, 0), self._font, size_px, _BOLD if is_bold else _REGULAR)[2]

    def polyline(self, points_px: NDArray[np.float64], color: Color, width_px: int, clip: Box | None = None) -> None:
        """Draw a line through points (n, 2), cut off at `clip`'s border."""
        box = clip or Box(0, 0, self.image.shape[1], self.image.shape[0])
        area = self.image[box.y : box.bottom, box.x : box.right]
        fixed = np.round((points_px - np.array([box.x, box.y])) * (1 << _SUBPIXEL_BITS)).astype(np.int32)
        cv2.polylines(area, [fixed.reshape(-1, 1, 2)], False, color, width_px, cv2.LINE_AA, _SUBPIXEL_BITS)

    def dot(self, place: tuple[float, float], radius_px: float, color: Color, width_px: int = cv2.FILLED) -> None:
        """Draw a disc, or a ring of `width_px`."""
        scale = 1 << _SUBPIXEL_BITS
        centre = (round(place[0] * scale), round(place[1] * scale))
        cv2.circle(self.image, centre, round(radius_px * scale), color, width_px, cv2.LINE_AA, _SUBPIXEL_BITS)

    def panel(self, box: Box, color: Color = PANEL, *, opacity: float = 1.0, radius_px: int = 10) -> None:
        """Fill a rectangle with rounded corners."""
        mask = rounded_mask(box.width, box.height, radius_px) * np.float32(opacity)
        area = self.image[box.y : box.bottom, box.x : box.right]
        area[:] = _blend(area, np.full_like(area, color), mask)

    def paste(self, box: Box, image: Image, *, radius_px: int = 10) -> None:
        """Put an image into a box of its size, its corners rounded."""
        area = self.image[box.y : box.bottom, box.x : box.right]
        area[:] = _blend(area, image, rounded_mask(box.width, box.height, radius_px))


def rounded_mask(width_px: int, height_px: int, radius_px: int) -> NDArray[np.float32]:
    """Make the coverage, (h, w) 0 to 1, of a rectangle with rounded corners."""
    x = np.abs(np.arange(width_px) - (width_px - 1) / 2) - (width_px / 2 - radius_px)
    y = np.abs(np.arange(height_px) - (height_px - 1) / 2) - (height_px / 2 - radius_px)
    distance = np.hypot(np.maximum(x[None, :], 0), np.maximum(y[:, None], 0))
    return np.asarray(np.clip(radius_px - distance + 0.5, 0.0, 1.0), dtype=np.float32)


def _blend(below: Image, above: Image, mask: NDArray[np.float32]) -> Image:
    share = mask[..., None]
    return np.asarray(below * (1 - share) + above * share + 0.5, dtype=np.uint8)
