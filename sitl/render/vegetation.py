"""Paints crowns where they stand, and the litter and shade-loving growth below them."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from sitl.render.colour import stored
from sitl.render.fields import rise
from sitl.world.surface import bumps, crown_up_m, lattice

CROWN_PALETTE = np.array(
    [
        stored(84, 110, 48),  # broadleaf
        stored(52, 78, 46),  # conifer
        stored(100, 122, 58),  # poplar
        stored(88, 108, 52),  # bush
        stored(96, 84, 58),  # litter
        stored(140, 120, 62),  # leaves that turn
    ],
    dtype=np.float64,
)


@njit(nogil=True, cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def paint_litter(
    picture: NDArray[np.uint8],
    trees: NDArray[np.float64],
    palette: NDArray[np.float64],
    corner_m: NDArray[np.float64],
    texel_m: NDArray[np.float64],
) -> None:
    """Lay litter below and round the crowns of `trees` (tree_rows); the rest as for paint_crowns."""
    for k in range(trees.shape[0]):
        if trees[k, 4] == 3.0:
            continue
        reach = 1.5 * trees[k, 3]
        for i in range(
            max(0, int((trees[k, 0] - reach - corner_m[0]) / texel_m[0])),
            min(picture.shape[0], int((trees[k, 0] + reach - corner_m[0]) / texel_m[0]) + 1),
        ):
            north_m = corner_m[0] + (i + 0.5) * texel_m[0]
            for j in range(
                max(0, int((trees[k, 1] - reach - corner_m[1]) / texel_m[1])),
                min(picture.shape[1], int((trees[k, 1] + reach - corner_m[1]) / texel_m[1]) + 1),
            ):
                east_m = corner_m[1] + (j + 0.5) * texel_m[1]
                r = ((north_m - trees[k, 0]) ** 2 + (east_m - trees[k, 1]) ** 2) ** 0.5 / trees[k, 3]
                part = 0.6 * rise(1.45, 0.7, r + 0.5 * (bumps(north_m * 0.9, east_m * 0.9) - 0.5))
                if part <= 0.0:
                    continue
                shade = 0.85 + 0.3 * lattice(i, j)
                for c in range(3):
                    value = picture[i, j, c] + part * (255.0 * palette[4, c] * shade - picture[i, j, c])
                    picture[i, j, c] = int(min(255.0, value + 0.5))
                picture[i, j, 3] = int(picture[i, j, 3] + part * (120.0 - picture[i, j, 3]) + 0.5)


@njit(nogil=True, cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def paint_crowns(
    picture: NDArray[np.uint8],
    trees: NDArray[np.float64],
    palette: NDArray[np.float64],
    corner_m: NDArray[np.float64],
    texel_m: NDArray[np.float64],
) -> None:
    """Paint the crowns of `trees` (sitl.world.surface.tree_rows), the lowest first, into `picture` (rows, columns, 4).

    `palette` is CROWN_PALETTE, `corner_m` the picture's south and west, `texel_m` its texels' sides (north, east).
    """
    tint = np.empty(3)
    for k in range(trees.shape[0]):
        height_m, radius_m, kind = trees[k, 2], trees[k, 3], int(trees[k, 4])
        salt = 100.0 * lattice(int(8.0 * trees[k, 0]), int(8.0 * trees[k, 1]))
        age, turned = lattice(int(salt * 91.0), 3), lattice(int(salt * 57.0), 5)
        turned = 0.55 * rise(0.8, 1.0, turned) if kind != 1 else 0.0
        for c in range(3):
            tint[c] = palette[kind, c] + turned * (palette[5, c] - palette[kind, c])
            tint[c] *= 0.86 + 0.28 * age + 0.05 * (lattice(int(salt * 13.0), 7 + c) - 0.5)
        reach = 1.15 * radius_m + 0.2
        for i in range(
            max(0, int((trees[k, 0] - reach - corner_m[0]) / texel_m[0])),
            min(picture.shape[0], int((trees[k, 0] + reach - corner_m[0]) / texel_m[0]) + 1),
        ):
            dn = corner_m[0] + (i + 0.5) * texel_m[0] - trees[k, 0]
            for j in range(
                max(0, int((trees[k, 1] - reach - corner_m[1]) / texel_m[1])),
                min(picture.shape[1], int((trees[k, 1] + reach - corner_m[1]) / texel_m[1]) + 1),
            ):
                de = corner_m[1] + (j + 0.5) * texel_m[1] - trees[k, 1]
                # The surface's grid widens a crown by up to a cell: its steep side must not show the ground's colour.
                crown = crown_up_m(0.96 * dn, 0.96 * de, height_m, radius_m, kind, salt)
                if crown <= 0.0:
                    continue
                # Sprays of leaves catch light of their own; between them one looks into the dark.
                spray = bumps(dn * 3.1 + salt, de * 3.1) + 0.7 * bumps(dn * 7.3, de * 7.3 + salt) - 0.85
                gap = rise(0.15, -0.35, spray + 0.35 * (lattice(i, j) - 0.5))
                r = min(1.0, (dn * dn + de * de) ** 0.5 / radius_m)
                shade = (1.0 + 0.32 * spray + 0.16 * (lattice(i, j + 50) - 0.5)) * (1.0 - 0.42 * gap)
                shade *= 1.06 - 0.16 * r
                for c in range(3):
                    warm = 1.0 + 0.06 * spray * (1.0 if c == 2 else 0.0)
                    picture[i, j, c] = int(min(255.0, max(0.0, 255.0 * tint[c] * shade * warm + 0.5)))
                picture[i, j, 3] = 255
