"""Colours as the ground's textures store them."""

import math

COVER_SMOOTH, COVER_SOIL, COVER_GRASS, COVER_LEAVES = 0, 85, 170, 255
"""What a surface's fourth channel says of its grain."""


def stored(red: int, green: int, blue: int) -> tuple[float, float, float]:
    """An sRGB colour as a texture stores it: BGR, square root of linear light."""

    def root(value: int) -> float:
        v = value / 255.0
        return math.sqrt(v / 12.92 if v <= 0.04045 else ((v + 0.055) / 1.055) ** 2.4)

    return root(blue), root(green), root(red)
