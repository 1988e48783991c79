"""What a world file may say, with its defaults and limits.

Positions in the file are metres north and east of where the vehicle starts; angles are degrees, because people write
them, and headings are clockwise from north.
"""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from sitl.world.light import LightName
from sitl.world.line_models import LineModel
from sitl.world.model import LengthM, Model, PlaceNe
from sitl.world.records import GroundStyle, Roof, StripKind, TreeKind

Seed = Annotated[int, Field(ge=0, le=2**32 - 1)]


class OriginModel(Model):
    """Where on Earth the vehicle starts."""

    latitude_deg: float = Field(ge=-90, le=90)
    longitude_deg: float = Field(ge=-180, le=180)
    altitude_m: float = Field(ge=-500, le=9000)


class GroundModel(Model):
    """What grows on the ground."""

    style: GroundStyle = "pasture"
    seed: Seed = 0


class FlatModel(Model):
    """Level ground."""

    kind: Literal["flat"]


class HillsModel(Model):
    """Smooth seeded hills."""

    kind: Literal["hills"]
    amplitude_m: float = Field(gt=0, le=500, description="How far the ground goes up and down from its mean, roughly.")
    wavelength_m: float = Field(ge=40, le=20_000, description="From one hill to the next, roughly.")
    seed: Seed = 0


class HeightMapModel(Model):
    """A picture or an array of heights, north up."""

    kind: Literal["height_map"]
    file: str = Field(min_length=1, description="A grey PNG or TIFF, an NPY or a GeoTIFF, beside the world file.")
    cell_m: float | None = Field(None, gt=0, le=1000, description="Between two pixels; a GeoTIFF tells it itself.")
    scale_m: float = Field(1.0, gt=0, le=1000, description="Height of a grey value.")
    south_west_ne_m: PlaceNe | None = Field(
        None, description="The middle of the pixel in the south-west corner; by default the start is in the middle."
    )


TerrainModel = Annotated[FlatModel | HillsModel | HeightMapModel, Field(discriminator="kind")]


class StripModel(Model):
    """Something long on the ground."""

    kind: StripKind
    points_ne_m: list[PlaceNe] = Field(min_length=2, max_length=10_000)
    width_m: float | None = Field(
        None, gt=0, le=200, description="By default 5 for a road, 2.6 track, 4 railway, 8 river, 0.12 fence, 1.2 hedge."
    )


class BuildingModel(Model):
    """A house on a rectangle, its ridge along its length."""

    centre_ne_m: PlaceNe
    heading_deg: float
    length_m: LengthM
    width_m: LengthM
    eaves_m: float = Field(3.0, gt=0, le=100)
    ridge_m: float | None = Field(None, gt=0, le=120, description="By default a roof of 35 degrees; flat: the eaves.")
    roof: Roof = "tile"

    @model_validator(mode="after")
    def _ridge_is_above(self) -> Self:
        if self.ridge_m is not None and self.ridge_m < self.eaves_m:
            raise ValueError(f"the ridge at {self.ridge_m} m is below the eaves at {self.eaves_m} m")
        return self


class HouseRowModel(Model):
    """Houses along one of the strips, their ridges parallel to it."""

    strip: int = Field(ge=1, description="Which of the strips, counted from 1.")
    side: Literal["left", "right", "both"] = "both"
    setback_m: float = Field(6.0, ge=0, le=200, description="From the strip's edge to the wall.")
    every_m: float = Field(18.0, ge=5, le=500, description="From one house to the next, roughly.")
    from_m: float = Field(0.0, ge=0, description="Where the row begins, along the strip.")
    to_m: float | None = Field(None, gt=0, description="Where it ends; by default with the strip.")
    roofs: list[Roof] = Field(["tile"], min_length=1)
    seed: Seed = 0


class TreeModel(Model):
    """A tree or a bush."""

    kind: TreeKind
    place_ne_m: PlaceNe
    height_m: float = Field(gt=0, le=80)
    crown_radius_m: float | None = Field(None, gt=0, le=20, description="By default what such a tree has.")


class AreaModel(Model):
    """A rectangle on the map."""

    south_m: float
    west_m: float
    north_m: float
    east_m: float

    @model_validator(mode="after")
    def _is_not_empty(self) -> Self:
        if self.north_m <= self.south_m or self.east_m <= self.west_m:
            raise ValueError("an area needs south_m below north_m and west_m below east_m")
        return self


class ScatterModel(Model):
    """Trees strewn over the world; none on roads, in houses, near a line or the start."""

    kinds: list[TreeKind] = Field(min_length=1)
    density_per_ha: float = Field(gt=0, le=2000)
    keep_clear_m: float = Field(
        10.0, ge=0, le=500, description="From the outermost conductor of every line to the crown."
    )
    keep_start_clear_m: float = Field(10.0, ge=5, le=500, description="From the start to the crown.")
    height_m: tuple[float, float] | None = Field(
        None, description="Least and greatest height; by default what such trees have."
    )
    area: AreaModel | None = Field(None, description="By default the whole world.")
    seed: Seed = 0

    @model_validator(mode="after")
    def _heights_are_ordered(self) -> Self:
        if self.height_m is not None and not 0.3 <= self.height_m[0] <= self.height_m[1] <= 80.0:
            raise ValueError("height_m needs a least and a greatest height between 0.3 and 80")
        return self


class WorldModel(Model):
    """A world file."""

    version: Literal[2] = Field(description="The version of this format.")
    description: str = Field("", max_length=2000, description="One sentence; lineflight world list shows it.")
    origin: OriginModel
    start_yaw_deg: float = Field(0.0, description="Where the nose points at the start.")
    light: LightName = "noon"
    ground: GroundModel = GroundModel()
    terrain: TerrainModel = FlatModel(kind="flat")
    lines: list[LineModel] = Field(min_length=1, max_length=100, description="A mission follows the first.")
    strips: list[StripModel] = Field([], max_length=1000)
    buildings: list[BuildingModel] = Field([], max_length=5000)
    house_rows: list[HouseRowModel] = Field([], max_length=200)
    trees: list[TreeModel] = Field([], max_length=20_000)
    scattered_trees: list[ScatterModel] = Field([], max_length=20)

    @model_validator(mode="after")
    def _rows_have_their_strips(self) -> Self:
        for row in self.house_rows:
            if row.strip > len(self.strips):
                raise ValueError(f"house_rows names strip {row.strip}, of {len(self.strips)} strips")
        return self
