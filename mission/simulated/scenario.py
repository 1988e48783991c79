"""What a simulated flight is flown in: the world, its light, the wind, and the chance that a seed stands for."""

from dataclasses import dataclass

from sitl.world.light import LightName


@dataclass(frozen=True, slots=True)
class Scenario:
    """A world by name or file (None: the default one) in a light (None: its own), and the mean wind [m/s].

    The same scenario is the same wind, sensor noise and ground.
    """

    world: str | None = None
    light: LightName | None = None
    seed: int = 1
    wind_m_s: float = 0.0

    @property
    def metadata(self) -> dict[str, str]:
        """What the log keeps of it."""
        words = {"seed": str(self.seed), "wind_m_s": f"{self.wind_m_s:g}"}
        return words | ({} if self.light is None else {"light": self.light})

    @property
    def options(self) -> list[str]:
        """The command line options of dry-run that stand for it."""
        given = {"--world": self.world, "--light": self.light, "--seed": self.seed, "--wind": f"{self.wind_m_s:g}"}
        return [str(part) for option, value in given.items() if value is not None for part in (option, value)]
