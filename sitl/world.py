"""The world a simulated flight happens in: read from a file, handed on as frozen records."""

import itertools
import math
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Literal

import numpy as np
import yaml
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from sitl.catenary import hang
from sitl.place import Origin

DEFAULT_WORLD = "medium_voltage"
CONDUCTOR_STEP_M = 0.5

Material = Literal["concrete", "wood"]
GroundStyle = Literal["pasture"]


class WorldError(Exception):
    """A world could not be read; the message is one sentence for a person."""


@dataclass(frozen=True, slots=True)
class Support:
    """A pole with its cross-arm. Points are NED [m]; the arm ends are the left and the right one along the line.

    `insulators_ned_m` holds foot and top of each conductor's insulator.
    """

    base_ned_m: tuple[float, float, float]
    top_ned_m: tuple[float, float, float]
    base_diameter_m: float
    top_diameter_m: float
    arm_ends_ned_m: tuple[tuple[float, float, float], tuple[float, float, float]]
    arm_thickness_m: float
    insulators_ned_m: tuple[tuple[tuple[float, float, float], tuple[float, float, float]], ...]
    material: Material


@dataclass(frozen=True, slots=True, eq=False)
class Conductor:
    """A conductor as a polyline (n, 3) float64 [m] NED, read-only."""

    diameter_m: float
    points_ned_m: NDArray[np.float64]

    def __post_init__(self) -> None:
        points = np.array(self.points_ned_m, dtype=np.float64)
        if points.ndim != 2 or points.shape[1] != 3 or len(points) < 2:
            raise ValueError(f"A conductor's points must be (n, 3) with n >= 2, not {points.shape}.")
        points.flags.writeable = False
        object.__setattr__(self, "points_ned_m", points)


@dataclass(frozen=True, slots=True)
class Ground:
    """How the ground, the plane down = 0, looks; the same seed gives the same ground."""

    style: GroundStyle
    seed: int


@dataclass(frozen=True, slots=True)
class Sun:
    """Where the sun stands [rad] (azimuth from north, clockwise) and how bright the scene is: 1 is a clear day."""

    azimuth_rad: float
    elevation_rad: float
    level: float

    @property
    def direction_ned(self) -> tuple[float, float, float]:
        """The unit vector towards the sun, NED."""
        horizontal = math.cos(self.elevation_rad)
        return (
            horizontal * math.cos(self.azimuth_rad),
            horizontal * math.sin(self.azimuth_rad),
            -math.sin(self.elevation_rad),
        )


@dataclass(frozen=True, slots=True)
class World:
    """What stands in the world, NED [m] from where the vehicle starts. `axis_ne_m` is the line seen from above."""

    name: str
    origin: Origin
    start_yaw_rad: float
    axis_ne_m: tuple[tuple[float, float], ...]
    supports: tuple[Support, ...]
    conductors: tuple[Conductor, ...]
    ground: Ground
    sun: Sun


class _Model(BaseModel):
    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)


class _OriginModel(_Model):
    latitude_deg: float = Field(ge=-90, le=90)
    longitude_deg: float = Field(ge=-180, le=180)
    altitude_m: float


class _PointModel(_Model):
    north_m: float
    east_m: float


class _PoleModel(_Model):
    height_m: float = Field(gt=0, le=100)
    base_diameter_m: float = Field(gt=0, le=5)
    top_diameter_m: float = Field(gt=0, le=5)
    material: Material = "concrete"


class _CrossArmModel(_Model):
    height_m: float = Field(gt=0)
    length_m: float = Field(gt=0, le=50)
    thickness_m: float = Field(gt=0, le=2)


class _ConductorModel(_Model):
    lateral_m: float = Field(ge=-25, le=25)
    height_m: float = Field(gt=0, le=100)
    diameter_m: float = Field(gt=0, le=0.2)
    sag_m: float = Field(gt=0)

    @model_validator(mode="after")
    def _hangs_above_the_ground(self) -> "_ConductorModel":
        if self.sag_m >= self.height_m:
            raise ValueError(f"the conductor is held at {self.height_m} m and sags {self.sag_m} m, into the ground")
        return self


class _LineModel(_Model):
    first_pole: _PointModel
    heading_deg: float
    n_poles: int = Field(ge=2, le=200)
    span_m: float = Field(gt=0, le=1000)
    pole: _PoleModel
    cross_arm: _CrossArmModel
    conductors: list[_ConductorModel] = Field(min_length=1)

    @model_validator(mode="after")
    def _fits_together(self) -> "_LineModel":
        if self.cross_arm.height_m > self.pole.height_m:
            raise ValueError(f"the cross-arm at {self.cross_arm.height_m} m is above the pole's top")
        for conductor in self.conductors:
            if conductor.sag_m > self.span_m:
                raise ValueError(f"a sag of {conductor.sag_m} m is longer than the span")
        return self


class _GroundModel(_Model):
    style: GroundStyle = "pasture"
    seed: int = Field(default=0, ge=0)


class _SunModel(_Model):
    azimuth_deg: float = 60.0
    elevation_deg: float = Field(default=50.0, ge=10, le=90)
    level: float = Field(default=1.0, gt=0, le=1)


class _WorldModel(_Model):
    version: Literal[1]
    origin: _OriginModel
    start_yaw_deg: float = 0.0
    line: _LineModel
    ground: _GroundModel = _GroundModel()
    sun: _SunModel = _SunModel()


def shipped_worlds() -> list[str]:
    """The names of the worlds that come with the package."""
    folder = resources.files("sitl") / "worlds"
    return sorted(entry.name.removesuffix(".yaml") for entry in folder.iterdir() if entry.name.endswith(".yaml"))


def load_world(name_or_path: str | None = None) -> World:
    """Read a world: the name of a shipped one, or the path of a YAML file; None is the default world.

    Raises WorldError, with a sentence that names the file and the key, when there is no such world or it is wrong.
    """
    where = DEFAULT_WORLD if name_or_path is None else name_or_path
    if where in shipped_worlds():
        name = where
        text = (resources.files("sitl") / "worlds" / f"{name}.yaml").read_text(encoding="utf-8")
    else:
        path = Path(where)
        name = path.stem
        try:
            text = path.read_text(encoding="utf-8")
        except FileNotFoundError:
            known = ", ".join(shipped_worlds())
            raise WorldError(
                f"There is no world '{where}': give the path of a world file or one of these names: {known}."
            ) from None
        except (OSError, UnicodeDecodeError) as error:
            raise WorldError(f"The world file {where} cannot be read as text: {error}.") from error
    return _build(name, _parse(text, where))


def _parse(text: str, where: str) -> _WorldModel:
    try:
        return _WorldModel.model_validate(yaml.safe_load(text))
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        line = f", line {mark.line + 1}" if mark is not None else ""
        raise WorldError(f"The world file {where}{line} is not valid YAML; mend it there.") from error
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"]) or "the whole file"
        message = first["msg"].removeprefix("Value error, ")
        raise WorldError(f"The world file {where} is wrong at {key}: {message}.") from error


def _build(name: str, model: _WorldModel) -> World:
    line = model.line
    heading_rad = math.radians(line.heading_deg)
    along = (math.cos(heading_rad), math.sin(heading_rad))
    right = (-along[1], along[0])

    def at(i_pole: int, lateral_m: float, height_m: float) -> tuple[float, float, float]:
        """The point `lateral_m` right of pole `i_pole` when looking along the line, at a height above the ground."""
        north_m = line.first_pole.north_m + i_pole * line.span_m * along[0] + lateral_m * right[0]
        east_m = line.first_pole.east_m + i_pole * line.span_m * along[1] + lateral_m * right[1]
        return north_m, east_m, -height_m

    half_arm_m = line.cross_arm.length_m / 2.0
    supports = tuple(
        Support(
            base_ned_m=at(i, 0.0, 0.0),
            top_ned_m=at(i, 0.0, line.pole.height_m),
            base_diameter_m=line.pole.base_diameter_m,
            top_diameter_m=line.pole.top_diameter_m,
            arm_ends_ned_m=(at(i, -half_arm_m, line.cross_arm.height_m), at(i, half_arm_m, line.cross_arm.height_m)),
            arm_thickness_m=line.cross_arm.thickness_m,
            insulators_ned_m=tuple(
                (at(i, c.lateral_m, _foot_height_m(line, c)), at(i, c.lateral_m, c.height_m)) for c in line.conductors
            ),
            material=line.pole.material,
        )
        for i in range(line.n_poles)
    )
    return World(
        name=name,
        origin=Origin(
            math.radians(model.origin.latitude_deg),
            math.radians(model.origin.longitude_deg),
            model.origin.altitude_m,
        ),
        start_yaw_rad=math.radians(model.start_yaw_deg),
        axis_ne_m=tuple(support.base_ned_m[:2] for support in supports),
        supports=supports,
        conductors=tuple(
            _string(c.diameter_m, c.sag_m, [at(i, c.lateral_m, c.height_m) for i in range(line.n_poles)])
            for c in line.conductors
        ),
        ground=Ground(model.ground.style, model.ground.seed),
        sun=Sun(math.radians(model.sun.azimuth_deg), math.radians(model.sun.elevation_deg), model.sun.level),
    )


def _foot_height_m(line: _LineModel, conductor: _ConductorModel) -> float:
    """The height at which a conductor's insulator stands: on the pole's top in the middle, else on the cross-arm."""
    is_on_top = abs(conductor.lateral_m) < line.pole.base_diameter_m
    return line.pole.height_m if is_on_top else line.cross_arm.height_m


def _string(diameter_m: float, sag_m: float, attachments: list[tuple[float, float, float]]) -> Conductor:
    """Hang one conductor over all its supports."""
    spans = [hang(start, end, sag_m, CONDUCTOR_STEP_M) for start, end in itertools.pairwise(attachments)]
    points = np.concatenate([spans[0], *(span[1:] for span in spans[1:])])
    return Conductor(diameter_m, points)
