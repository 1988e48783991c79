"""What stands in a world. Positions are NED [m] from where the vehicle starts; down is 0 on the ground there."""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from sitl.place import Origin
from sitl.world.height_grid import HeightGrid

PointNed = tuple[float, float, float]
"""North, east, down [m]."""
PointNe = tuple[float, float]
"""North, east [m]."""

Material = Literal["concrete", "wood", "steel", "porcelain"]
SupportKind = Literal["lattice_tower", "wood_pole", "concrete_pole", "steel_pole"]
StripKind = Literal["road", "track", "railway", "river", "fence", "hedge"]
Roof = Literal["tile", "metal", "flat"]
TreeKind = Literal["broadleaf", "conifer", "poplar", "bush"]
GroundStyle = Literal["pasture", "meadow", "cropland", "forest_floor", "village"]


@dataclass(frozen=True, slots=True)
class Member:
    """A straight round bar, tapering from its start to its end."""

    start_ned_m: PointNed
    end_ned_m: PointNed
    start_diameter_m: float
    end_diameter_m: float
    material: Material


@dataclass(frozen=True, slots=True)
class Support:
    """A pole or tower with its cross-arms and insulators, made of members.

    `base_ned_m` and `top_ned_m` are the ends of its axis; `heading_rad` is the line's direction there, to which the
    cross-arms stand at a right angle: at an angle support, the bisector of both spans' directions.
    """

    kind: SupportKind
    base_ned_m: PointNed
    top_ned_m: PointNed
    heading_rad: float
    members: tuple[Member, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Conductor:
    """A conductor over all its spans, as a polyline (n, 3) float64 [m] NED, read-only; `is_shield`: a shield wire.

    A missing span, or a bundle's other wires, are conductors of their own.
    """

    diameter_m: float
    points_ned_m: NDArray[np.float64]
    is_shield: bool = False

    def __post_init__(self) -> None:
        points = np.array(self.points_ned_m, dtype=np.float64)
        if points.ndim != 2 or points.shape[1] != 3 or len(points) < 2:
            raise ValueError(f"A conductor's points must be (n, 3) with n >= 2, not {points.shape}.")
        points.flags.writeable = False
        object.__setattr__(self, "points_ned_m", points)


@dataclass(frozen=True, slots=True)
class PowerLine:
    """Supports with the conductors that hang on them.

    `axis_ne_m` is the line seen from above: at each support the middle between its outermost conductors.
    """

    axis_ne_m: tuple[PointNe, ...]
    supports: tuple[Support, ...]
    conductors: tuple[Conductor, ...]


@dataclass(frozen=True, slots=True)
class Strip:
    """Something long on the ground, `width_m` wide around a polyline."""

    kind: StripKind
    points_ne_m: tuple[PointNe, ...]
    width_m: float


@dataclass(frozen=True, slots=True)
class Building:
    """A house on a rectangle; its ridge runs along `length_m`, which lies along `heading_rad`.

    `eaves_m` and `ridge_m` are heights over the ground at its centre; they are equal for a flat roof.
    """

    centre_ne_m: PointNe
    heading_rad: float
    length_m: float
    width_m: float
    eaves_m: float
    ridge_m: float
    roof: Roof


@dataclass(frozen=True, slots=True)
class Tree:
    """A tree or a bush; its crown is `crown_radius_m` wide and reaches `height_m` over the ground."""

    kind: TreeKind
    north_m: float
    east_m: float
    height_m: float
    crown_radius_m: float


@dataclass(frozen=True, slots=True)
class Ground:
    """What grows on the ground; the same seed gives the same ground."""

    style: GroundStyle
    seed: int


@dataclass(frozen=True, slots=True)
class Light:
    """The light of the day.

    The sun stands at `azimuth_rad` (from north, clockwise) and `elevation_rad` [rad]. A surface that faces it gets
    `direct` from the sun, a level one `sky` from the sky, both as shares of a clear noon's light, linear; they are
    1 together then. `visibility_m` is how far one sees: there a contrast is down to 5 % (Koschmieder).
    """

    azimuth_rad: float
    elevation_rad: float
    direct: float
    sky: float
    visibility_m: float

    @property
    def direction_ned(self) -> PointNed:
        """The unit vector towards the sun, NED."""
        horizontal = math.cos(self.elevation_rad)
        return (
            horizontal * math.cos(self.azimuth_rad),
            horizontal * math.sin(self.azimuth_rad),
            -math.sin(self.elevation_rad),
        )


@dataclass(frozen=True, slots=True)
class World:
    """A whole world. `lines[0]` is the line that a mission follows; `terrain` is 0 where the vehicle starts.

    The terrain's bounds are the world's: within them everything stands, beyond them it goes on mirrored.
    """

    name: str
    origin: Origin
    start_yaw_rad: float
    lines: tuple[PowerLine, ...]
    terrain: HeightGrid
    ground: Ground
    strips: tuple[Strip, ...]
    buildings: tuple[Building, ...]
    trees: tuple[Tree, ...]
    light: Light

    @property
    def line(self) -> PowerLine:
        """The line that a mission follows."""
        return self.lines[0]

    @property
    def conductors(self) -> tuple[Conductor, ...]:
        """The conductors of all lines."""
        return tuple(conductor for line in self.lines for conductor in line.conductors)

    @property
    def supports(self) -> tuple[Support, ...]:
        """The supports of all lines."""
        return tuple(support for line in self.lines for support in line.supports)
