"""A height over every place on the map, by interpolation between the nodes of a square grid."""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, eq=False)
class HeightGrid:
    """Heights `up_m` (rows, columns) float32 [m], rows to the north, columns to the east; read-only.

    The first node stands at (`south_m`, `west_m`), the next ones `cell_m` apart. Beyond its edges the grid goes on
    mirrored, so that heights have no step there. Raises ValueError for a grid of less than 2 x 2 nodes.
    """

    south_m: float
    west_m: float
    cell_m: float
    up_m: NDArray[np.float32]

    def __post_init__(self) -> None:
        up_m = np.array(self.up_m, dtype=np.float32)
        if up_m.ndim != 2 or min(up_m.shape) < 2 or not self.cell_m > 0:
            raise ValueError(f"A height grid needs 2 x 2 nodes or more and a cell above 0 m, not {up_m.shape}.")
        up_m.flags.writeable = False
        object.__setattr__(self, "up_m", up_m)

    @classmethod
    def flat(cls, south_m: float, west_m: float, north_m: float, east_m: float, cell_m: float = 4.0) -> Self:
        """Height 0 over those bounds, rounded up to whole cells."""
        shape = (math.ceil((north_m - south_m) / cell_m) + 1, math.ceil((east_m - west_m) / cell_m) + 1)
        return cls(south_m, west_m, cell_m, np.zeros(shape, dtype=np.float32))

    @property
    def bounds_ne_m(self) -> tuple[float, float, float, float]:
        """South, west, north, east [m]."""
        rows, columns = self.up_m.shape
        return (
            self.south_m,
            self.west_m,
            self.south_m + (rows - 1) * self.cell_m,
            self.west_m + (columns - 1) * self.cell_m,
        )

    def at(self, north_m: float, east_m: float) -> float:
        """The height at a place [m], up positive."""
        i, row_part = _fold((north_m - self.south_m) / self.cell_m, self.up_m.shape[0])
        j, column_part = _fold((east_m - self.west_m) / self.cell_m, self.up_m.shape[1])
        up = self.up_m
        south = float(up[i, j]) + column_part * (float(up[i, j + 1]) - float(up[i, j]))
        north = float(up[i + 1, j]) + column_part * (float(up[i + 1, j + 1]) - float(up[i + 1, j]))
        return south + row_part * (north - south)

    def at_all(self, norths_m: NDArray[np.float64], easts_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """The heights at places (n,) [m] each, as (n,) float64 [m]."""
        i, row_part = _fold_all((norths_m - self.south_m) / self.cell_m, self.up_m.shape[0])
        j, column_part = _fold_all((easts_m - self.west_m) / self.cell_m, self.up_m.shape[1])
        up = self.up_m.astype(np.float64)
        south = up[i, j] + column_part * (up[i, j + 1] - up[i, j])
        north = up[i + 1, j] + column_part * (up[i + 1, j + 1] - up[i + 1, j])
        return np.asarray(south + row_part * (north - south))


def _fold(place: float, n_nodes: int) -> tuple[int, float]:
    """Mirror a place in grid steps into the grid: its node below, and how far it is to the next one."""
    last = n_nodes - 1
    folded = math.fmod(abs(place), 2.0 * last)
    folded = min(folded, 2.0 * last - folded)
    node = min(int(folded), last - 1)
    return node, folded - node


def _fold_all(places: NDArray[np.float64], n_nodes: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    last = n_nodes - 1
    folded = np.fmod(np.abs(places), 2.0 * last)
    folded = np.minimum(folded, 2.0 * last - folded)
    nodes = np.minimum(folded.astype(np.int64), last - 1)
    return nodes, folded - nodes
