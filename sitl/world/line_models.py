"""What a world file may say about a power line: where it runs, what carries it, and what hangs on it."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from sitl.world.model import Model, PlaceNe
from sitl.world.wires import WIRES


class MeetingModel(Model):
    """The place where the line runs across the vehicle's nose, from left to right."""

    distance_m: float = Field(gt=0, le=500, description="How far ahead of the start.")
    span: int = Field(ge=1, description="In which span, counted from 1.")
    after_m: float = Field(gt=0, le=2000, description="How far after that span's first support.")


class RouteModel(Model):
    """Supports one after the other: span by span, with a turn at each."""

    first_ne_m: PlaceNe | None = Field(None, description="The first support.")
    heading_deg: float | None = Field(None, description="The first span's direction.")
    meets_start: MeetingModel | None = Field(
        None, description="Instead of first_ne_m and heading_deg: the route is laid across the vehicle's nose."
    )
    spans_m: list[Annotated[float, Field(ge=5, le=2000)]] = Field(min_length=1, max_length=300)
    turns_deg: list[Annotated[float, Field(ge=-60, le=60)]] = Field(
        [], description="The turn at each support between two spans, clockwise positive; all 0 when left out."
    )

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        has_place = self.first_ne_m is not None and self.heading_deg is not None
        if has_place == (self.meets_start is not None) or (self.first_ne_m is None) != (self.heading_deg is None):
            raise ValueError("a route needs first_ne_m and heading_deg, or else meets_start")
        if self.turns_deg and len(self.turns_deg) != len(self.spans_m) - 1:
            raise ValueError(
                f"turns_deg has {len(self.turns_deg)} entries; {len(self.spans_m)} spans have "
                f"{len(self.spans_m) - 1} supports between them"
            )
        if self.meets_start is not None:
            if self.meets_start.span > len(self.spans_m):
                raise ValueError(f"meets_start.span is {self.meets_start.span}, of {len(self.spans_m)} spans")
            if self.meets_start.after_m >= self.spans_m[self.meets_start.span - 1]:
                raise ValueError("meets_start.after_m lies beyond the end of its span")
        return self


class PoleModel(Model):
    """A pole of a medium- or low-voltage line; its conductors stand on pins."""

    kind: Literal["wood_pole", "concrete_pole", "steel_pole"]
    height_m: float = Field(11.0, ge=4, le=30, description="The pole's top, over the ground at its foot.")
    base_diameter_m: float = Field(0.32, gt=0, le=2)
    top_diameter_m: float = Field(0.20, gt=0, le=2)
    head: Literal["cross_arm", "delta", "column"] = Field(
        "cross_arm",
        description="cross_arm: along one arm near the top, an odd one on the top. delta: the same, the arm lower and "
        "longer. column: one below the other.",
    )
    arm_length_m: float | None = Field(None, gt=0, le=6, description="By default 1.9, or 2.4 for delta.")
    arm_below_top_m: float | None = Field(None, gt=0, le=4, description="By default 0.35, or 0.9 for delta.")
    arm_thickness_m: float = Field(0.10, gt=0, le=0.5)

    @model_validator(mode="after")
    def _arm_is_on_the_pole(self) -> Self:
        if self.arm_below_top_m is not None and self.arm_below_top_m >= self.height_m:
            raise ValueError(f"the cross-arm is {self.arm_below_top_m} m below the top of a pole of {self.height_m} m")
        return self


class TowerModel(Model):
    """A lattice tower of a high-voltage line; its conductors hang on strings of insulators."""

    kind: Literal["lattice_tower"]
    height_m: float = Field(35.0, ge=15, le=80, description="The tower's top, over the ground at its centre.")
    head: Literal["three_levels", "one_level"] = Field(
        "three_levels", description="Three pairs of cross-arms one below the other, or one pair of long ones."
    )
    base_width_m: float | None = Field(None, gt=0.5, le=20, description="By default 0.17 of the height.")
    arm_m: float | None = Field(
        None, gt=1, le=20, description="How far the longest arm reaches from the axis; by default 0.15 of the height."
    )
    level_m: float | None = Field(
        None, gt=1, le=12, description="From one level to the next; by default 0.14 of the height."
    )
    string_m: float = Field(2.0, gt=0.1, le=6, description="Length of a string of insulators.")

    @model_validator(mode="after")
    def _levels_fit(self) -> Self:
        if self.level_m is not None and self.level_m > 0.2 * self.height_m:
            raise ValueError(f"levels {self.level_m} m apart do not fit a tower of {self.height_m} m")
        return self


SupportModel = Annotated[PoleModel | TowerModel, Field(discriminator="kind")]


class WireModel(Model):
    """A wire of one's own; all but the diameter is needed only where a tension is given."""

    diameter_m: float = Field(gt=0, le=0.1)
    mass_kg_m: float | None = Field(None, gt=0, le=20)
    area_mm2: float | None = Field(None, gt=0, le=5000)
    modulus_gpa: float | None = Field(None, gt=0, le=500)
    expansion_per_k: float | None = Field(None, gt=0, le=1e-3)


class HangModel(Model):
    """What hangs, and how far it sags."""

    wire: str | WireModel = Field(description=f"A wire of one's own, or one of: {', '.join(WIRES)}.")
    sag_m: float | None = Field(None, gt=0, le=200, description="The sag of every span at its middle; or a tension.")
    tension_n: float | None = Field(
        None, gt=0, le=500_000, description="Horizontal tension; by default 18 % of what a named wire bears."
    )
    tension_at_c: float = Field(15.0, ge=-60, le=100, description="The temperature at which it has that tension.")
    temperature_c: float = Field(25.0, ge=-60, le=200, description="The wire's temperature now.")

    @model_validator(mode="after")
    def _can_be_hung(self) -> Self:
        if self.sag_m is not None and self.tension_n is not None:
            raise ValueError("give sag_m or tension_n, not both")
        if isinstance(self.wire, str):
            if self.wire not in WIRES:
                raise ValueError(f"there is no wire '{self.wire}'; give one of {', '.join(WIRES)}, or its diameter_m")
        elif self.sag_m is None:
            if self.tension_n is None:
                raise ValueError("a wire of one's own needs sag_m or tension_n")
            if None in (self.wire.mass_kg_m, self.wire.area_mm2, self.wire.modulus_gpa, self.wire.expansion_per_k):
                raise ValueError("tension_n needs the wire's mass_kg_m, area_mm2, modulus_gpa and expansion_per_k")
        return self


class ConductorsModel(HangModel):
    """The conductors of a line."""

    n: int = Field(3, ge=1, le=6, description="How many, a bundle counted as one.")
    n_bundle: int = Field(1, ge=1, le=4, description="Wires in each bundle.")
    bundle_spacing_m: float = Field(0.4, gt=0, le=1)


class ShieldWiresModel(HangModel):
    """The wires above the conductors that catch lightning."""

    wire: str | WireModel = Field("steel_9mm", description="As for conductors.")
    n: int = Field(1, ge=1, le=2)


class LineModel(Model):
    """A line: supports by a route or by points, and what hangs on them."""

    name: str = Field("", max_length=100)
    route: RouteModel | None = None
    points_ne_m: list[PlaceNe] | None = Field(None, min_length=2, max_length=301, description="Every support.")
    support: SupportModel
    conductors: ConductorsModel
    shield_wires: ShieldWiresModel | None = None
    missing_spans: list[Annotated[int, Field(ge=1)]] = Field(
        [], description="Spans whose conductors are down, counted from 1."
    )

    @property
    def n_spans(self) -> int:
        """How many spans there are, missing ones included."""
        return len(self.route.spans_m) if self.route is not None else len(self.points_ne_m or ()) - 1

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        if (self.route is None) == (self.points_ne_m is None):
            raise ValueError("a line needs a route or points_ne_m, and not both")
        if any(span > self.n_spans for span in self.missing_spans):
            raise ValueError(f"missing_spans names span {max(self.missing_spans)}, of {self.n_spans} spans")
        if len(set(self.missing_spans)) == self.n_spans:
            raise ValueError("missing_spans leaves no span")
        if self.shield_wires is not None and not isinstance(self.support, TowerModel):
            raise ValueError("shield_wires need a lattice_tower; leave them out or change support.kind")
        if isinstance(self.support, TowerModel) and self.conductors.n in (1, 5):
            raise ValueError(f"a lattice_tower carries 2, 3, 4 or 6 conductors, not {self.conductors.n}")
        return self
