"""What a simulated vehicle came near to, and what it touched."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from sitl.contact import Clearance, Obstacles, Thing
from sitl.vehicle import Vector, Vehicle

_LOOK_EACH_M = 0.05  # of its way: nothing comes nearer in between by more
_HARD_M_S = 3.0  # meeting the ground faster than this is a crash; PX4 lands at 0.7 m/s and sinks at 1.5 m/s
_NS_PER_S = 1_000_000_000

TouchedThing = Thing | Literal["ground"]


@dataclass(frozen=True, slots=True)
class Nearness:
    """The least distance [m] of the vehicle's centre to a kind of thing, where it was then, NED [m], and when [ns]."""

    distance_m: float
    position_ned_m: Vector
    t_ns: int


@dataclass(frozen=True, slots=True)
class Contact:
    """The first thing that the vehicle touched, where it was then, NED [m], and when [ns, flight time]."""

    what: TouchedThing
    position_ned_m: Vector
    t_ns: int


@dataclass(frozen=True, slots=True)
class Testimony:
    """The nearest that the vehicle came to conductors, supports and all else; None where nothing came within reach.

    `contact` is the first one, after which nothing more is measured; None when there was none.
    """

    conductor: Nearness | None = None
    support: Nearness | None = None
    other: Nearness | None = None
    contact: Contact | None = None


class Witness:
    """Watches a flight among obstacles. `summary` is what it has seen so far.

    `tell_contact` hears of the first contact when it happens. `began_ns` is the flight time at which the autopilot was
    booted; set it where both clocks are known.
    """

    def __init__(self, obstacles: Obstacles, tell_contact: Callable[[Contact], None] | None = None) -> None:
        self._obstacles = obstacles
        self._tell_contact = tell_contact
        self.summary = Testimony()
        self.began_ns = 0
        self._looked_from: Vector = (math.inf, math.inf, math.inf)
        self._velocity_m_s: Vector = (0.0, 0.0, 0.0)

    def look(self, boot_s: float, vehicle: Vehicle) -> Contact | None:
        """Look at the vehicle at `boot_s` [s]; the first contact, when it is now."""
        if self.summary.contact is not None:
            return None
        before_m_s, self._velocity_m_s = self._velocity_m_s, vehicle.velocity_m_s
        what = self._touched(boot_s, vehicle, before_m_s)
        if what is None:
            return None
        contact = Contact(what, vehicle.position_m, self._t_ns(boot_s))
        seen = self.summary
        self.summary = Testimony(seen.conductor, seen.support, seen.other, contact)
        if self._tell_contact is not None:
            self._tell_contact(contact)
        return contact

    def _touched(self, boot_s: float, vehicle: Vehicle, before_m_s: Vector) -> TouchedThing | None:
        if vehicle.is_on_ground and math.hypot(*before_m_s) > _HARD_M_S:
            return "ground"
        position_m = vehicle.position_m
        if math.dist(position_m, self._looked_from) < _LOOK_EACH_M:
            return None
        self._looked_from = position_m
        clearance = self._obstacles.clearance(position_m)
        self._keep(clearance, position_m, boot_s)
        what, distance_m = clearance.nearest
        return what if distance_m < vehicle.airframe.radius_m else None

    def _keep(self, clearance: Clearance, position_m: Vector, boot_s: float) -> None:
        seen = self.summary

        def nearer(last: Nearness | None, distance_m: float) -> Nearness | None:
            if distance_m < (math.inf if last is None else last.distance_m):
                return Nearness(distance_m, position_m, self._t_ns(boot_s))
            return last

        self.summary = Testimony(
            nearer(seen.conductor, clearance.conductor_m),
            nearer(seen.support, clearance.support_m),
            nearer(seen.other, clearance.other_m),
        )

    def _t_ns(self, boot_s: float) -> int:
        return self.began_ns + round(boot_s * _NS_PER_S)
