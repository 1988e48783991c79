"""Which flight task flies a mode, and what PX4's navigator says when it begins."""

import math
from collections.abc import Callable
from dataclasses import dataclass

from sitl.control import Estimate
from sitl.flight_tasks import Descend, FlightTask, Hold, Land, Offboard, Return, Takeoff
from sitl.manual_tasks import AltitudeTask, StickTask
from sitl.modes import Mode
from sitl.parameters import Parameters
from sitl.pilot import Pilot
from sitl.place import Home, Origin
from sitl.vehicle import Vector, euler_of

_LEAVES_GROUND_M = 0.3  # above the vehicle: an offboard setpoint that takes off


@dataclass(frozen=True, slots=True)
class Situation:
    """What the choice of a task depends on."""

    mode: Mode
    estimate: Estimate
    home: Home | None
    is_armed: bool
    is_landed: bool
    is_position_valid: bool


class Navigator:
    """Keeps the `task` that flies the mode; None while disarmed."""

    def __init__(self, parameters: Parameters, origin: Origin, pilot: Pilot, say: Callable[[str], None]) -> None:
        """Have no task; `say` tells people something."""
        self._parameters = parameters
        self._origin = origin
        self._pilot = pilot
        self._say = say
        self.task: FlightTask | None = None
        self.has_left_by_takeoff = False
        """Whether the take-off that is flown left the ground."""
        self._key: object = None
        self._target: tuple[Vector, float] | None = None
        self._takeoff_requests = 0
        self._takeoff_altitude_m: float | None = None

    def ask_takeoff(self, altitude_m: float | None) -> None:
        """The next take-off goes to `altitude_m` AMSL, or to MIS_TAKEOFF_ALT over where it begins."""
        self._takeoff_altitude_m = altitude_m
        self.begin_takeoff()

    def begin_takeoff(self) -> None:
        """A take-off begins anew."""
        self._takeoff_requests += 1

    def aim(self, wanted: tuple[float, float, float, float], estimate: Estimate) -> None:
        """Take an offboard setpoint: local NED [m] and yaw [rad].

        What is not finite keeps what is: the position where the vehicle is, the yaw that was last asked for offboard.
        """
        n, e, d = (
            asked if math.isfinite(asked) else actual
            for asked, actual in zip(wanted[:3], estimate.position_m, strict=True)
        )
        yaw_rad = wanted[3]
        if not math.isfinite(yaw_rad):
            asked_before = self._target if isinstance(self.task, Offboard) else None
            yaw_rad = asked_before[1] if asked_before is not None else euler_of(estimate.quaternion)[2]
        self._target = ((n, e, d), yaw_rad)
        if isinstance(self.task, Offboard):
            self.task.aim(*self._target)

    def wants_takeoff(self, estimate: Estimate) -> bool:
        """Whether the task would leave the ground: a take-off, or an offboard setpoint above."""
        if isinstance(self.task, Offboard) and self._target is not None:
            return self._target[0][2] < estimate.position_m[2] - _LEAVES_GROUND_M
        return isinstance(self.task, Takeoff)

    def follow(self, now: Situation) -> None:
        """Start the flight task of the mode, where it is another than before."""
        mode = now.mode
        if mode is not Mode.TAKEOFF:
            self.has_left_by_takeoff = False
        if not now.is_armed:
            self.task = self._key = None
            return
        # What else decides between the tasks of a mode.
        takeoff = self._takeoff_requests if mode is Mode.TAKEOFF else 0
        is_steered = mode.needs_sticks and self._pilot.sticks is not None
        is_blind = not now.is_position_valid and (mode.needs_sticks or mode is Mode.LAND)
        key = (mode, takeoff, is_steered, is_blind)
        if key != self._key:
            self._key = key
            self.task = self._task_of(now)

    def _task_of(self, now: Situation) -> FlightTask:
        mode, estimate, parameters = now.mode, now.estimate, self._parameters
        if mode is Mode.OFFBOARD and self._target is not None:
            return Offboard(parameters, *self._target)
        if mode is Mode.TAKEOFF:
            self.has_left_by_takeoff = self.has_left_by_takeoff or now.is_landed
            return Takeoff(parameters, estimate, min(self._takeoff_down_m(estimate), estimate.position_m[2]))
        if mode is Mode.RTL and now.home is not None:
            return self._return(estimate, now.home)
        if mode is Mode.LAND and now.is_position_valid:
            return Land(parameters, estimate)
        if mode is Mode.LAND or (mode.needs_sticks and self._pilot.sticks is None):
            return Descend(parameters, estimate, is_blind=not now.is_position_valid)
        if mode is Mode.POSCTL:
            return StickTask(parameters, estimate, self._pilot)
        if mode.needs_sticks:  # the model has no attitude or rate mode: it holds the altitude in all of them
            return AltitudeTask(parameters, estimate, self._pilot)
        return Hold(parameters, estimate)

    def _return(self, estimate: Estimate, home: Home) -> Return:
        task = Return(self._parameters, estimate, home.position_m, home.yaw_rad)
        home_altitude_m = self._origin.global_of(home.position_m)[2]
        self._say(
            f"RTL: start return at {math.ceil(home_altitude_m + task.return_height_m)} m "
            f"({math.ceil(task.return_height_m)} m above destination)"
        )
        return task

    def _takeoff_down_m(self, estimate: Estimate) -> float:
        """Where a take-off ends, down [m] NED: at the altitude asked for if that is above, else at the default one."""
        here_m = estimate.position_m[2]
        if self._takeoff_altitude_m is not None:
            down_m = self._origin.altitude_m - self._takeoff_altitude_m
            if down_m < here_m - self._parameters.get("NAV_MC_ALT_RAD"):
                return down_m
        height_m = self._parameters.get("MIS_TAKEOFF_ALT")
        self._say(f"Using default takeoff altitude: {height_m:.1f} m")
        return here_m - height_m  # from where it is, also in the air
