"""What blame says: excursions beyond a limit, each with its culprit and the evidence."""

import enum
import math
from dataclasses import dataclass


class Kind(enum.StrEnum):
    """What went beyond its limit."""

    OFF_LINE = "off_line"
    """The vehicle flew beside the line."""
    UNSEEN = "unseen"
    """The line was not known to be anywhere for too long."""
    MISDATED = "misdated"
    """The frames bear other times than those at which they were taken."""
    OFF_HEIGHT = "off_height"
    """The vehicle was above or below its setpoint."""
    TILTED = "tilted"
    """The vehicle leaned as far as it may for a while, in whatever task: it could do no more."""
    OFF_HEADING = "off_heading"
    """The vehicle's nose pointed elsewhere than its setpoint's, while that stood still."""


class Culprit(enum.StrEnum):
    """Where an excursion came from."""

    PERCEPTION = "perception"
    EXECUTIVE = "executive"
    AUTOPILOT = "autopilot"
    WIND = "wind"


class Fault(enum.StrEnum):
    """What was wrong with it."""

    WRONG = "wrong"
    """The line was told to be where it was not."""
    LATE = "late"
    """What was told was old, or bore a wrong time."""
    MISSING = "missing"
    """Nothing was told."""
    SETPOINT = "setpoint"
    """The setpoint was not on the line as it was known."""
    BEND = "bend"
    """The line turned onto another span, and that was told late, or flown too sharply to be followed."""
    TRACKING = "tracking"
    """The vehicle was not at its setpoint, and nothing pushed it."""
    POSITION = "position"
    """The vehicle's position jumped, as the autopilot told it, without the vehicle."""
    PUSHED = "pushed"
    """The vehicle was pushed off its setpoint."""


@dataclass(frozen=True, slots=True)
class Limits:
    """What counts as an excursion: beyond one of these for at least `least_s` [s]."""

    off_line_m: float = 0.75
    unseen_s: float = 1.0
    misdated_s: float = 0.1
    off_height_m: float = 1.0
    off_heading_rad: float = math.radians(6.0)
    tilted_rad: float = math.radians(38.0)
    tilted_s: float = 1.0
    least_s: float = 0.3


@dataclass(frozen=True, slots=True)
class Excursion:
    """One excursion: from `start_ns` to `end_ns` [flight], at most `peak` in `unit`, in `task`.

    `shares` says how much came from where, in `unit`, in the mean while beyond the limit, positive where it made the
    excursion larger; empty where there is nothing to divide. `evidence` are sentences for a person.
    """

    kind: Kind
    task: str
    start_ns: int
    end_ns: int
    peak: float
    unit: str
    culprit: Culprit
    fault: Fault
    shares: dict[str, float]
    evidence: tuple[str, ...]
