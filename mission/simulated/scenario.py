"""What a simulated flight is flown in: the world, its light, the wind, and the chance that a seed stands for."""

import math
from dataclasses import dataclass

from sitl.airframes import AirframeName
from sitl.world.light import LightName


@dataclass(frozen=True, slots=True)
class Scenario:
    """A world by name or file (None: the default one) in a light (None: its own), the mean wind [m/s], the airframe.

    The wind blows from `wind_from_rad`, clockwise from north; None: from where the seed draws it. The same scenario is
    the same wind, sensor noise and ground.
    """

    world: str | None = None
    light: LightName | None = None
    seed: int = 1
    wind_m_s: float = 0.0
    wind_from_rad: float | None = None
    has_gust_fronts: bool = False
    airframe: AirframeName = "f550"

    @property
    def metadata(self) -> dict[str, str]:
        """What the log keeps of it, but for the world."""
        words = {"seed": str(self.seed), "wind_m_s": f"{self.wind_m_s:g}", "airframe": self.airframe}
        if self.light is not None:
            words["light"] = self.light
        if self.wind_from_rad is not None:
            words["wind_from_deg"] = f"{math.degrees(self.wind_from_rad):g}"
        return words | ({"gust_fronts": "yes"} if self.has_gust_fronts else {})

    @property
    def options(self) -> list[str]:
        """The command line options of dry-run that stand for it."""
        given = {
            "--world": self.world,
            "--light": self.light,
            "--wind": f"{self.wind_m_s:g}",
            "--wind-from": None if self.wind_from_rad is None else f"{math.degrees(self.wind_from_rad):g}",
            "--airframe": None if self.airframe == "f550" else self.airframe,
            "--seed": self.seed,
        }
        options = [str(part) for option, value in given.items() if value is not None for part in (option, value)]
        return options + (["--gust-fronts"] if self.has_gust_fronts else [])
