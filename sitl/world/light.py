"""The lights that a world can be flown in, by name."""

import math
from typing import Literal, get_args

from sitl.world.records import Light

LightName = Literal["noon", "low_sun", "overcast", "dusk"]
LIGHT_NAMES: tuple[LightName, ...] = get_args(LightName)

LIGHTS: dict[LightName, Light] = {
    "noon": Light(math.radians(60.0), math.radians(52.0), direct=0.58, sky=0.42, visibility_m=15_000.0),
    "low_sun": Light(math.radians(255.0), math.radians(12.0), direct=0.42, sky=0.16, visibility_m=12_000.0),
    "overcast": Light(math.radians(60.0), math.radians(52.0), direct=0.0, sky=0.35, visibility_m=6_000.0),
    "dusk": Light(math.radians(280.0), math.radians(3.0), direct=0.012, sky=0.03, visibility_m=8_000.0),
}
"""Each light; illuminances of day and dusk after the usual tables (100 klx, 10 klx, a few hundred lx)."""
