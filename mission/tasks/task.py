"""What a task is: a small state machine that turns what is observed into the next setpoint or command.

Tasks do no I/O and know no time but the observation's, so that they can be flown in a test by hand.
"""

import enum
import math
from dataclasses import dataclass, field
from typing import Protocol

from mission.autopilot import FlightMode, Setpoint, VehicleState
from mission.known_line import Found, KnownLine
from mission.trail import Trail


@dataclass(frozen=True, slots=True)
class Sight:
    """What one frame showed; `found` is None where it showed no line that counts.

    What it says was worked out with the vehicle's pose at the time of capture: `north_m`, `east_m`, `down_m`, and yaw.
    """

    t_capture_ns: int
    yaw_at_capture_rad: float
    north_m: float
    east_m: float
    down_m: float
    found: Found | None


@dataclass(frozen=True, slots=True)
class Observation:
    """What a task sees in one control tick. `sight` is None where no new frame came since the last tick."""

    dt_s: float
    state: VehicleState
    sight: Sight | None


@dataclass(slots=True)
class FlightMemory:
    """What later tasks need of earlier ones.

    `start` is where the vehicle stood when the mission began, `pad` where a resumed mission takes off again (None: at
    the start); `move_until_m` is how far from the start, along theta_0, the last move_until ended. `trail` is the way
    flown, `line_seen_at` the place where the line was last seen, and `known_line` the line that is followed.
    """

    start: Setpoint
    theta_0_rad: float
    move_until_m: float | None = None
    pad: Setpoint | None = None
    trail: Trail = field(default_factory=Trail)
    line_seen_at: Setpoint | None = None
    known_line: KnownLine = field(default_factory=KnownLine)


class Command(enum.Enum):
    """What only the autopilot's own modes can do."""

    ARM = enum.auto()
    HOLD = enum.auto()
    TAKEOFF = enum.auto()
    RETURN = enum.auto()
    LAND = enum.auto()


@dataclass(frozen=True, slots=True)
class Step:
    """What a task wants now: a setpoint, or a command (take-off: to `altitude_m` above the take-off point).

    `next_mode` is a flight mode that the autopilot may go to by itself from now on. `done` says in words why the task
    ended, `failed` why it cannot.
    """

    setpoint: Setpoint | None = None
    command: Command | None = None
    altitude_m: float = 0.0
    next_mode: FlightMode | None = None
    done: str | None = None
    failed: str | None = None


class Task(Protocol):
    """A task in flight."""

    @property
    def needs_line(self) -> bool:
        """Whether it steers by the line, so that losing the line matters."""
        ...

    @property
    def needs_vision(self) -> bool:
        """Whether it cannot go on without the vision worker."""
        ...

    @property
    def progress(self) -> float:
        """How far the task has come: metres flown, radians turned or seconds held; 0 where it has no such measure."""
        ...

    def step(self, reference: Setpoint, seen: Observation) -> Step:
        """Go on by `seen.dt_s`; `reference` is the last setpoint of the flight."""
        ...


ARRIVED_M_S = 0.5
"""A vehicle that flies faster than this has not arrived: it passes."""


def is_there(state: VehicleState, setpoint: Setpoint, arrival_m: float) -> bool:
    """Whether the vehicle stands within `arrival_m` of the setpoint, level and vertically."""
    level_m = math.hypot(setpoint.north_m - state.north_m, setpoint.east_m - state.east_m)
    speed_m_s = math.hypot(state.v_north_m_s, state.v_east_m_s, state.v_down_m_s)
    return level_m <= arrival_m and abs(setpoint.down_m - state.down_m) <= arrival_m and speed_m_s <= ARRIVED_M_S
