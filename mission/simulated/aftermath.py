"""What is known of a simulated flight beyond what its autopilot knows: what it touched, and what it came near to."""

from dataclasses import dataclass
from typing import Any

from mission.records import Event, Severity
from sitl.witness import Contact, Nearness, Testimony
from sitl.world.records import World


@dataclass(frozen=True, slots=True)
class Aftermath:
    """The world of the flight, its speed over real time, and what the vehicle came near to; None where unknown."""

    world: World
    speed: float | None
    testimony: Testimony | None

    @property
    def contact(self) -> str | None:
        """What the vehicle touched, in a sentence; None where it touched nothing."""
        contact = None if self.testimony is None else self.testimony.contact
        return None if contact is None else _sentence(contact)

    @property
    def clearances(self) -> str | None:
        """The least distances in words; None where nothing came within reach."""
        if self.testimony is None:
            return None
        kinds = (
            (self.testimony.conductor, "conductor"),
            (self.testimony.support, "support"),
            (self.testimony.other, "other"),
        )
        words = [f"{near.distance_m:.2f} m to {_A[what]}" for near, what in kinds if near is not None]
        return ", ".join(words) or None

    def to_json(self) -> dict[str, Any]:
        """The same for programs; distances [m] from the vehicle's centre."""
        seen = self.testimony
        return {
            "achieved_speed": self.speed,
            "contact": self.contact,
            "clearance_m": None
            if seen is None
            else {"conductor": _m(seen.conductor), "support": _m(seen.support), "other": _m(seen.other)},
        }


_A = {
    "conductor": "a conductor",
    "support": "a support",
    "other": "a tree or a house",
    "tree": "a tree",
    "building": "a house",
    "ground": "the ground",
}


def contact_event(contact: Contact) -> Event:
    """A contact as the log keeps it, at its moment."""
    return Event(contact.t_ns, "contact", Severity.ERROR, _sentence(contact))


def _sentence(contact: Contact) -> str:
    north_m, east_m, down_m = contact.position_ned_m
    return (
        f"The vehicle touched {_A[contact.what]} {north_m:.1f} m north and {east_m:.1f} m east of its start, "
        f"{-down_m:.1f} m up, and fell."
    )


def _m(nearness: Nearness | None) -> float | None:
    return None if nearness is None else nearness.distance_m
