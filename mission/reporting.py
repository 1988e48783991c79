"""What the executive tells others while it flies: the log, and a person who watches."""

from dataclasses import dataclass
from typing import Protocol

from mission.autopilot import Setpoint


class FlightLog(Protocol):
    """Where the records of the flight go. Never blocks and never raises."""

    def record(self, item: object) -> None:
        """Keep a record."""
        ...

    def record_setpoint(self, t_ns: int, setpoint: Setpoint) -> None:
        """Keep a setpoint that was sent."""
        ...

    def record_status_text(self, t_ns: int, text: str) -> None:
        """Keep the autopilot's own words."""
        ...


@dataclass(frozen=True, slots=True)
class Progress:
    """Where the flight stands now; `task_index` is None outside the mission's tasks.

    Height and distance are from the take-off point [m], the heading from north [rad]; None before take-off.
    """

    stage: str
    task_index: int | None
    height_m: float | None
    distance_m: float | None
    heading_rad: float | None = None
    waiting_for: tuple[str, ...] = ()
