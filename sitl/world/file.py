"""The world a simulated flight happens in: read from a file, handed on as frozen records."""

import itertools
import math
from importlib import resources
from pathlib import Path
from typing import Literal

import numpy as np
import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from sitl.place import Origin
from sitl.world.catenary import hang
from sitl.world.height_grid import HeightGrid
from sitl.world.light import LIGHTS, LightName
from sitl.world.records import Conductor, Ground, GroundStyle, Material, Member, PointNed, PowerLine, Support, World

DEFAULT_WORLD = "medium_voltage"
CONDUCTOR_STEP_M = 0.5
_MARGIN_M = 100.0
_PIN_DIAMETER_M = 0.11


class WorldError(Exception):
    """A world could not be read; the message is one sentence for a person."""


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


class _WorldModel(_Model):
    version: Literal[1]
    origin: _OriginModel
    start_yaw_deg: float = 0.0
    line: _LineModel
    ground: _GroundModel = _GroundModel()
    light: LightName = "noon"


def shipped_worlds() -> list[str]:
    """The names of the worlds that come with the package."""
    folder = resources.files("sitl") / "worlds"
    return sorted(entry.name.removesuffix(".yaml") for entry in folder.iterdir() if entry.name.endswith(".yaml"))


def load_world(name_or_path: str | None = None, light: LightName | None = None) -> World:
    """Read a world: the name of a shipped one, or the path of a YAML file; None is the default world.

    `light` takes the place of the file's.

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
    return _build(name, _parse(text, where), light)


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


def _build(name: str, model: _WorldModel, light: LightName | None) -> World:
    line = model.line
    heading_rad = math.radians(line.heading_deg)
    along = (math.cos(heading_rad), math.sin(heading_rad))
    right = (-along[1], along[0])

    def at(i_pole: int, lateral_m: float, height_m: float) -> PointNed:
        """The point `lateral_m` right of pole `i_pole` when looking along the line, at a height above the ground."""
        north_m = line.first_pole.north_m + i_pole * line.span_m * along[0] + lateral_m * right[0]
        east_m = line.first_pole.east_m + i_pole * line.span_m * along[1] + lateral_m * right[1]
        return north_m, east_m, -height_m

    supports = tuple(
        Support(
            "concrete_pole" if line.pole.material == "concrete" else "wood_pole",
            at(i, 0.0, 0.0),
            at(i, 0.0, line.pole.height_m),
            heading_rad,
            _members(line, [at(i, side * line.cross_arm.length_m / 2.0, line.cross_arm.height_m) for side in (-1, 1)])
            + tuple(
                Member(
                    at(i, c.lateral_m, _foot_height_m(line, c)),
                    at(i, c.lateral_m, c.height_m),
                    _PIN_DIAMETER_M,
                    0.8 * _PIN_DIAMETER_M,
                    "porcelain",
                )
                for c in line.conductors
            ),
        )
        for i in range(line.n_poles)
    )
    axis = tuple(support.base_ned_m[:2] for support in supports)
    norths, easts = [0.0, *(n for n, _ in axis)], [0.0, *(e for _, e in axis)]
    return World(
        name=name,
        origin=Origin(
            math.radians(model.origin.latitude_deg),
            math.radians(model.origin.longitude_deg),
            model.origin.altitude_m,
        ),
        start_yaw_rad=math.radians(model.start_yaw_deg),
        lines=(
            PowerLine(
                axis,
                supports,
                tuple(
                    _string(c.diameter_m, c.sag_m, [at(i, c.lateral_m, c.height_m) for i in range(line.n_poles)])
                    for c in line.conductors
                ),
            ),
        ),
        terrain=HeightGrid.flat(
            min(norths) - _MARGIN_M, min(easts) - _MARGIN_M, max(norths) + _MARGIN_M, max(easts) + _MARGIN_M
        ),
        ground=Ground(model.ground.style, model.ground.seed),
        strips=(),
        buildings=(),
        trees=(),
        light=LIGHTS[light or model.light],
    )


def _members(line: _LineModel, arm_ends: list[PointNed]) -> tuple[Member, ...]:
    """The pole and its cross-arm."""
    (left, right), pole, thickness_m = arm_ends, line.pole, line.cross_arm.thickness_m
    north_m, east_m = (left[0] + right[0]) / 2.0, (left[1] + right[1]) / 2.0
    foot, top = (north_m, east_m, 0.0), (north_m, east_m, -pole.height_m)
    return (
        Member(foot, top, pole.base_diameter_m, pole.top_diameter_m, pole.material),
        Member(left, right, thickness_m, thickness_m, "steel"),
    )


def _foot_height_m(line: _LineModel, conductor: _ConductorModel) -> float:
    """The height at which a conductor's insulator stands: on the pole's top in the middle, else on the cross-arm."""
    is_on_top = abs(conductor.lateral_m) < line.pole.base_diameter_m
    return line.pole.height_m if is_on_top else line.cross_arm.height_m


def _string(diameter_m: float, sag_m: float, attachments: list[PointNed]) -> Conductor:
    """Hang one conductor over all its supports."""
    spans = [hang(start, end, sag_m, CONDUCTOR_STEP_M) for start, end in itertools.pairwise(attachments)]
    points = np.concatenate([spans[0], *(span[1:] for span in spans[1:])])
    return Conductor(diameter_m, points)
