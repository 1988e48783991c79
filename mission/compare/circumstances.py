"""What flights were flown with: where that differs, and what it was for all of them. Pure."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from mission.log.circumstances import flown_with, settings_of
from mission.log.reader import Flight

NOT_TOLD = "not told"

_ALIKE = ("command", "world", "wind", "seed", "airframe", "mission", "mission file", "lineflight", "computer")
_MOST_SHOWN = 20


@dataclass(frozen=True, slots=True)
class Circumstances:
    """What flights were flown with, by what it is called: each one's words where they differ, and those of all."""

    differing: dict[str, tuple[str, ...]]
    alike: dict[str, str]

    @property
    def shown(self) -> dict[str, tuple[str, ...]]:
        """As much of what differs as people read."""
        return dict(list(self.differing.items())[:_MOST_SHOWN])

    @property
    def n_not_shown(self) -> int:
        """How much more differs."""
        return max(0, len(self.differing) - _MOST_SHOWN)


def circumstances_of(flights: Sequence[Flight]) -> Circumstances:
    """What flights were flown with: their metadata, software and computers, the settings of mission and autopilot."""
    told = [_told_of(flight) for flight in flights]
    differing = _differing(told)
    settings = {
        f"{name} ({of_what})": values
        for of_what, attachment in (("mission", "plan.json"), ("autopilot", "parameters.json"))
        for name, values in _differing([settings_of(flight, attachment) for flight in flights]).items()
    }
    if "mission" in differing:  # then what their files say cannot be held against each other
        settings = {name: values for name, values in settings.items() if not name.endswith("(mission)")}
    alike = {name: told[0][name] for name in _ALIKE if name in told[0] and name not in differing}
    return Circumstances(differing | settings, alike)


def _told_of(flight: Flight) -> dict[str, str]:
    """What a flight was flown with; a dry-run tells of gust fronts only where it had them."""
    told = flown_with(flight)
    return {"gust fronts": "no"} | told if told.get("command", "").startswith("dry-run") else told


def _differing(told: Sequence[Mapping[str, str]]) -> dict[str, tuple[str, ...]]:
    names = dict.fromkeys(name for words in told for name in words)
    rows = {name: tuple(words.get(name, NOT_TOLD) for words in told) for name in names}
    return {name: values for name, values in rows.items() if len(set(values)) > 1}
