"""Move forward: fly a distance along the present heading."""

from mission.autopilot import Setpoint
from mission.guidance import GuidanceSettings, step_along
from mission.tasks.odometer import NEARLY_M, Odometer
from mission.tasks.task import FlightMemory, Observation, Step, is_there


class MoveForwardTask:
    """Moves the setpoint ahead at r until the vehicle has arrived. `distance_m` None: as far as move_until went."""

    needs_line = False
    needs_vision = False

    def __init__(self, distance_m: float | None, guidance: GuidanceSettings, memory: FlightMemory) -> None:
        self._distance_m = distance_m
        self._guidance = guidance
        self._memory = memory
        self._odometer = Odometer()
        memory.known_line.forget()  # whatever line is seen there, it may be another one

    @property
    def progress(self) -> float:
        """The way flown so far [m]."""
        return self._odometer.moved_m

    def step(self, reference: Setpoint, seen: Observation) -> Step:
        """Move the reference by r dt, at most by what is left."""
        distance_m = self._memory.move_until_m if self._distance_m is None else self._distance_m
        if distance_m is None:
            return Step(reference, failed="move_until took no distance that could be flown back")
        left_m = distance_m - self._odometer.update(reference, reference.yaw_rad)
        step_m = min(self._guidance.r_m_s * seen.dt_s, max(0.0, left_m))
        setpoint = step_along(reference, reference.yaw_rad, step_m)
        if left_m <= NEARLY_M and is_there(seen.state, setpoint, self._guidance.arrival_m):
            return Step(setpoint, done=f"moved {distance_m:.1f} m")
        return Step(setpoint)
