"""What every section of a mission file is made of."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

Metres = Annotated[float, Field(gt=0, le=1000)]
AltitudeM = Annotated[float, Field(ge=1, le=120)]
TimeLimitS = Annotated[float, Field(gt=0, le=3600)]


class Section(BaseModel):
    """Strict: a number in quotes or a misspelt key is an error, never a silent default."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)
