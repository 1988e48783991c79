"""The in-process vehicle with what tests need of it: faults on demand, and the truth."""

import math
from collections.abc import Callable

from drivers.clock import Clock
from mission.autopilot import AutopilotError, NoAnswerError, Setpoint
from mission.simulated.in_process import InProcessAutopilot
from sitl.autopilot import SimAutopilot
from sitl.modes import Answer
from sitl.parameters import Parameters
from sitl.setup import SETUP
from sitl.vehicle import Vehicle, euler_of
from sitl.wind import Wind

STEP_S = 0.01
"""Coarser than a dry-run's, for many flights."""


class FaultyAutopilot(InProcessAutopilot):
    """`faults` says what goes wrong with the next calls of a command: refused, lost (obeyed, unanswered), ignored."""

    def __init__(
        self,
        clock: Clock,
        *,
        start_yaw_rad: float = 0.0,
        wind_m_s: float = 0.0,
        seed: int = 1,
        sim: SimAutopilot | None = None,
        step_s: float = STEP_S,
    ) -> None:
        made = sim or SimAutopilot(
            Vehicle(yaw_rad=start_yaw_rad), Wind(wind_m_s, seed), seed=seed, parameters=Parameters(SETUP)
        )
        super().__init__(clock, made, step_s=step_s)
        self.n_setpoints = 0
        self.faults: dict[str, list[str]] = {}

    async def set_setpoint(self, setpoint: Setpoint) -> None:
        faults = self.faults.get("setpoint", [])
        if faults:
            raise NoAnswerError(f"the setpoint was {faults.pop(0)}")
        self.n_setpoints += 1
        await super().set_setpoint(setpoint)

    def die(self) -> None:
        """The program at this end was killed: nothing more is sent, its own thread's setpoints neither."""
        self._setpoint = None
        self._is_closed = True
        self.hears_us = False

    def _command(self, name: str, act: Callable[[], Answer]) -> None:
        faults = self.faults.get(name, [])
        fault = faults.pop(0) if faults else None
        if fault in ("refused", "ignored"):
            self.catch_up()
            self.commands.append(name)
            if fault == "refused":
                raise AutopilotError(f"the autopilot refused to {name}: denied")
            return
        super()._command(name, act)
        if fault == "lost":
            raise NoAnswerError(f"the autopilot did not answer when asked to {name}")

    @property
    def true_yaw_rad(self) -> float:
        """The vehicle's true heading."""
        return euler_of(self.sim.vehicle.quaternion)[2]

    @property
    def true_distance_m(self) -> float:
        """How far the vehicle truly is from where it started, level."""
        return math.hypot(self.sim.vehicle.position_m[0], self.sim.vehicle.position_m[1])
