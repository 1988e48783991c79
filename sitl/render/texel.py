"""Laying one colour over another in a painted texel."""

import numpy as np
from numba import njit
from numpy.typing import NDArray


@njit(nogil=True, cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def blend(
    texel: NDArray[np.uint8], part: float, palette: NDArray[np.float64], which: int, shade: float, cover: float
) -> None:
    """Lay colour `which` of the `palette` (n, 3), times `shade`, over a texel (4,) uint8, `part` opaque.

    `cover` 0 to 255 is what the texel's fourth channel tells (GroundTexture): soil, grass, leaves.
    """
    if part <= 0.0:
        return
    for c in range(3):
        value = texel[c] + part * (255.0 * palette[which, c] * shade - texel[c])
        texel[c] = int(min(255.0, max(0.0, value + 0.5)))
    texel[3] = int(texel[3] + part * (cover - texel[3]) + 0.5)
