"""The fence section of a mission file."""

from typing import Annotated, Self

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from mission.geofence import polygon_fault
from mission.plan_section import AltitudeM, Section

CornerM = Annotated[list[Annotated[float, Field(ge=-2000, le=2000)]], Field(min_length=2, max_length=2)]
"""[north, east] of the take-off point."""


class FencePlan(Section):
    """What narrows the fence of max_distance_m and max_altitude_m."""

    polygon_m: list[CornerM] | None = Field(
        None, min_length=3, max_length=100, description="Corners [north, east] from the take-off point, in order."
    )
    min_altitude_m: AltitudeM | None = Field(
        None, description="Least height, once the vehicle was above it and until it lands."
    )

    @model_validator(mode="after")
    def _polygon_is_sound(self) -> Self:
        fault = None if self.polygon_m is None else polygon_fault(self.corners_ne_m)
        if fault is not None:
            raise PydanticCustomError("polygon", "a polygon_m that is a fence: {fault}", {"fault": fault})
        return self

    @property
    def corners_ne_m(self) -> tuple[tuple[float, float], ...]:
        """The polygon's corners, north and east of the take-off point [m]; empty where there is none."""
        return tuple((north_m, east_m) for north_m, east_m in self.polygon_m or ())
