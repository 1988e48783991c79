"""What every section of a world file is made of."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

Metres = Annotated[float, Field(ge=-50_000, le=50_000)]
LengthM = Annotated[float, Field(gt=0, le=2000)]
PlaceNe = tuple[Metres, Metres]
"""North, east [m] of where the vehicle starts."""


class Model(BaseModel):
    """A misspelt key is an error, never a silent default."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
