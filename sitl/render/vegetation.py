"""Paints bushes and trees, seen from above, with the shadows they cast on the ground."""

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from sitl.world.records import Light

_HEIGHT_PER_RADIUS = 1.5
_N_SHAPES = 4
_LEAF_BGR = np.array([0.175, 0.345, 0.275])  # as the texture stores colour: square roots of linear light


@dataclass(frozen=True, slots=True)
class Plant:
    """A bush or a tree: place [m] from the texture's corner, crown radius [m]."""

    north_m: float
    east_m: float
    radius_m: float


def paint_plants(
    picture: NDArray[np.uint8], plants: list[Plant], texel_m: float, sun: Light, rng: np.random.Generator
) -> None:
    """Paint plants into `picture` (side, side, 4) uint8 (GroundTexture.surface), over all of whose edges they wrap."""
    # A few shapes of each size do for all; growing one takes longer than painting it.
    stock: dict[tuple[int, int], NDArray[np.float32]] = {}
    crowns = []
    for k, plant in enumerate(plants):
        shape = (round(10.0 * plant.radius_m), k % _N_SHAPES)
        if shape not in stock:
            stock[shape] = _crown(shape[0] / 10.0, texel_m, rng)
        crowns.append(stock[shape])
    for plant, crown in zip(plants, crowns, strict=True):
        _paint_shadow(picture, plant, crown, texel_m, sun)
    for plant, crown in zip(plants, crowns, strict=True):
        _paint_crown(picture, plant, crown, texel_m, sun, rng)


def _crown(radius_m: float, texel_m: float, rng: np.random.Generator) -> NDArray[np.float32]:
    """Heap clumps of leaves into a dome: the height of a crown above its lower edge [m], (n, n) float32; 0 outside."""
    half = math.ceil(1.25 * radius_m / texel_m) + 2
    steps = (np.arange(-half, half + 1) * texel_m).astype(np.float32)
    height = np.zeros((len(steps), len(steps)), dtype=np.float32)
    n_clumps = int(14 + 26 * radius_m)
    for _ in range(n_clumps):
        out = radius_m * math.sqrt(rng.uniform(0.0, 0.8))
        turn = rng.uniform(0.0, 2.0 * math.pi)
        size = radius_m * rng.uniform(0.14, 0.30) + 0.05
        top = radius_m * math.sqrt(1.0 - (out / (1.15 * radius_m)) ** 2)
        dn, de = steps - out * math.cos(turn), steps - out * math.sin(turn)
        i, j = np.flatnonzero(np.abs(dn) < size), np.flatnonzero(np.abs(de) < size)
        if len(i) == 0 or len(j) == 0:
            continue
        inside = size**2 - dn[i, None] ** 2 - de[None, j] ** 2
        clump = np.where(inside > 0.0, top - size + np.sqrt(np.maximum(inside, 0.0)) * 1.2, 0.0)
        window = height[i[0] : i[-1] + 1, j[0] : j[-1] + 1]
        np.maximum(window, clump, out=window)
    rough = rng.standard_normal(height.shape, dtype=np.float32)
    bumps = cv2.GaussianBlur(rough, (0, 0), 1.2)
    return np.where(height > 0.0, np.maximum(0.02, height + 0.16 * bumps * (0.5 + 0.5 * radius_m)), 0.0).astype(
        np.float32
    )


def _window(
    picture: NDArray[np.uint8], plant: Plant, shape: tuple[int, ...], texel_m: float, shift_m: tuple[float, float]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows and columns of the picture under a patch of that shape, centred at the plant and shifted."""
    side = picture.shape[0]
    row = round((plant.north_m + shift_m[0]) / texel_m) - shape[0] // 2
    column = round((plant.east_m + shift_m[1]) / texel_m) - shape[1] // 2
    return (row + np.arange(shape[0]))[:, None] % side, (column + np.arange(shape[1]))[None, :] % side


def _paint_shadow(
    picture: NDArray[np.uint8], plant: Plant, crown: NDArray[np.float32], texel_m: float, sun: Light
) -> None:
    """Darken the ground where the crown, swept from its lower edge to its top, stands before the sun."""
    reach_m = _HEIGHT_PER_RADIUS * plant.radius_m / math.tan(sun.elevation_rad)
    pad = math.ceil(reach_m / texel_m) + 4
    mask = np.pad((crown > 0.0).astype(np.float32), pad)
    north, east = -math.cos(sun.azimuth_rad), -math.sin(sun.azimuth_rad)
    shadow = np.zeros_like(mask)
    for part in (0.0, 0.35, 0.7, 1.0):
        shift_px = (0.35 + 0.65 * part) * reach_m / texel_m
        # The crown narrows to its top.
        size = math.sqrt(1.0 - 0.8 * part**2)
        centre = (mask.shape[1] - 1) / 2.0
        move = np.array(
            [
                [size, 0.0, centre * (1.0 - size) + east * shift_px],
                [0.0, size, centre * (1.0 - size) + north * shift_px],
            ]
        )
        np.maximum(shadow, cv2.warpAffine(mask, move, mask.shape[::-1], flags=cv2.INTER_LINEAR), out=shadow)
    soft = cv2.GaussianBlur(shadow, (0, 0), 1.0 + 0.4 * plant.radius_m)
    where = _window(picture, plant, soft.shape, texel_m, (0.0, 0.0))
    light = 1.0 - soft[..., None] * np.array([0.36, 0.42, 0.46], dtype=np.float32)
    below = picture[where]
    below[..., :3] = (below[..., :3] * light + 0.5).astype(np.uint8)
    picture[where] = below


def _paint_crown(
    picture: NDArray[np.uint8],
    plant: Plant,
    crown: NDArray[np.float32],
    texel_m: float,
    sun: Light,
    rng: np.random.Generator,
) -> None:
    """Paint a crown, lit by the sun and darker in the hollows between its clumps."""
    slope_north, slope_east = np.gradient(crown, texel_m)
    toward = sun.direction_ned
    norm = np.sqrt(1.0 + slope_north**2 + slope_east**2)
    lit = np.maximum(0.0, (-slope_north * toward[0] - slope_east * toward[1] - toward[2]) / norm)
    hollow = crown - cv2.GaussianBlur(crown, (0, 0), 0.25 / texel_m)
    light = (0.42 + 0.62 * lit) * np.clip(1.0 + 0.9 * hollow / (0.2 + 0.25 * plant.radius_m), 0.45, 1.25)
    light *= 0.82 + 0.18 * np.minimum(1.0, crown / (0.7 * plant.radius_m))
    colour = _LEAF_BGR * rng.uniform(0.85, 1.15) * (1.0 + rng.normal(0.0, [0.03, 0.03, 0.08]))
    paint = 255.0 * np.sqrt(light)[..., None] * colour * 1.15
    alpha = cv2.GaussianBlur((crown > 0.0).astype(np.float32), (0, 0), 0.7)[..., None]
    where = _window(picture, plant, crown.shape, texel_m, (0.0, 0.0))
    below = picture[where].astype(np.float32)
    below[..., :3] += alpha * (paint - below[..., :3])
    below[..., 3:] += alpha * (255.0 - below[..., 3:])
    picture[where] = np.clip(below + 0.5, 0.0, 255.0).astype(np.uint8)
