"""The lee of trees and houses: less wind and more turbulence behind them.

How much less: Perera's law for wind-breaks (J. Wind Eng. Ind. Aerodyn. 8, 1981) in the form of the European Wind Atlas
(Troen and Petersen, 1989), for a break of height h and porosity P, at x downwind of it and z over the ground:

    du / u = 9.8 (z / h)^0.14 (x / h)^-0.89 (1 - P) eta exp(-0.67 eta^1.5),
    eta = z / h * (0.32 / ln(h / z0) * x / h)^-0.47

It holds from five heights on; nearer, the value there is taken. Behind a row of trees that is half of the wind at five
heights, a sixth at fifteen, and next to nothing above two and a half, as Heisler and DeWalle collect it (Agric.
Ecosyst. Environ. 22/23, 1988). By their figures the turbulence in the wake is up to half as strong again; here it grows
with what the mean wind loses.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from sitl.vehicle import Vector
from sitl.world.height_grid import HeightGrid

_POROSITY = 0.5  # the Wind Atlas' for trees; a house lets less through, and is narrow
_FULL_LEE = 5.0  # heights downwind: from there on the law holds
_EVEN_BELOW = 0.5  # heights over the ground: the law, made for higher up, would have more wind again below
_LEE_HEIGHTS = 20.0  # heights downwind, where the lee ends
_FAR_M = 300.0
_STEP_M = 2.0
_LOWEST_M = 1.5  # lower things are roughness
_MOST = 0.8  # of the mean wind
# A narrow thing shelters less: the way upwind is a fan of rays.
_FAN_RAD = np.radians([-8.0, -4.0, 0.0, 4.0, 8.0])
_FAN_WEIGHTS = np.array([1.0, 2.0, 3.0, 2.0, 1.0]) / 9.0
_LOOK_EACH_M = 1.0
_SETTLE_S = 0.5


@njit(nogil=True, cache=True)  # type: ignore[untyped-decorator]
def reduction_behind(x_m: float, z_m: float, break_m: float, roughness_m: float) -> float:
    """The share of the mean wind that a break of `break_m` height takes, `x_m` downwind, `z_m` over its foot."""
    x = max(x_m / break_m, _FULL_LEE)
    z = max(z_m / break_m, _EVEN_BELOW)
    eta = z * (0.32 / math.log(break_m / roughness_m) * x) ** -0.47
    share: float = 9.8 * z**0.14 * x**-0.89 * (1.0 - _POROSITY) * eta * math.exp(-0.67 * eta**1.5)
    return min(share, _MOST)


@njit(nogil=True, cache=True)  # type: ignore[untyped-decorator]
def height_at(up_m: NDArray[np.float32], grid: tuple[float, float, float], north_m: float, east_m: float) -> float:
    """A grid's height [m] at a place by interpolation, beyond the edges that of the edge; `grid`: south, west, cell."""
    rows, columns = up_m.shape
    row = min(max((north_m - grid[0]) / grid[2], 0.0), rows - 1.0)
    column = min(max((east_m - grid[1]) / grid[2], 0.0), columns - 1.0)
    i, j = min(int(row), rows - 2), min(int(column), columns - 2)
    a, b = row - i, column - j
    south: float = (1.0 - b) * up_m[i, j] + b * up_m[i, j + 1]
    north: float = (1.0 - b) * up_m[i + 1, j] + b * up_m[i + 1, j + 1]
    height_m: float = (1.0 - a) * south + a * north
    return height_m


@njit(nogil=True, cache=True)  # type: ignore[untyped-decorator]
def reduction_at(
    place: tuple[float, float, float],
    from_rad: float,
    surface_m: NDArray[np.float32],
    surface_grid: tuple[float, float, float],
    terrain_m: NDArray[np.float32],
    terrain_grid: tuple[float, float, float],
    roughness_m: float,
) -> float:
    """The share of the mean wind that is lost at a place (north, east, up) [m], when it blows from `from_rad`.

    What stands upwind is the surface over the terrain, (rows, columns) float32 [m] each. Along a ray the strongest
    shelter counts, since breaks in a row add little; the rays are averaged.
    """
    total = 0.0
    for ray in range(len(_FAN_RAD)):
        cos_to, sin_to = math.cos(from_rad + _FAN_RAD[ray]), math.sin(from_rad + _FAN_RAD[ray])
        strongest, x_m = 0.0, 0.0
        while x_m < _FAR_M:
            north_m, east_m = place[0] + x_m * cos_to, place[1] + x_m * sin_to
            foot_m = height_at(terrain_m, terrain_grid, north_m, east_m)
            break_m = height_at(surface_m, surface_grid, north_m, east_m) - foot_m
            if break_m > _LOWEST_M and x_m < _LEE_HEIGHTS * break_m:
                strongest = max(strongest, reduction_behind(x_m, place[2] - foot_m, break_m, roughness_m))
            x_m += _STEP_M
        total += _FAN_WEIGHTS[ray] * strongest
    return total


class Lee:
    """The lee in a world for a wind from `from_rad`; `step` follows a vehicle through it."""

    def __init__(self, surface: HeightGrid, terrain: HeightGrid, from_rad: float, roughness_m: float) -> None:
        """`surface` is the terrain with what stands on it."""
        self._from_rad = from_rad
        self._roughness_m = roughness_m
        self._surface, self._terrain = surface, terrain
        self._looked_from: Vector = (math.inf, math.inf, math.inf)
        self._target = self._lost = 0.0
        self.reduction((0.0, 0.0, 0.0))  # compiled before the flight

    def reduction(self, position_ned_m: Vector) -> float:
        """The share of the mean wind that is lost at a place, NED [m]."""
        surface, terrain = self._surface, self._terrain
        north_m, east_m, down_m = position_ned_m
        lost: float = reduction_at(
            (float(north_m), float(east_m), -float(down_m)),
            self._from_rad,
            surface.up_m,
            (float(surface.south_m), float(surface.west_m), float(surface.cell_m)),
            terrain.up_m,
            (float(terrain.south_m), float(terrain.west_m), float(terrain.cell_m)),
            self._roughness_m,
        )
        return lost

    def step(self, dt_s: float, position_ned_m: Vector) -> float:
        """The share that is lost where the vehicle is, after `dt_s` [s]; it goes over from place to place smoothly."""
        if math.dist(position_ned_m, self._looked_from) >= _LOOK_EACH_M:
            is_first = math.isinf(self._looked_from[0])
            self._looked_from = position_ned_m
            self._target = self.reduction(position_ned_m)
            if is_first:
                self._lost = self._target
        self._lost += (self._target - self._lost) * dt_s / (_SETTLE_S + dt_s)
        return self._lost
