"""A flight of the simulated autopilot in virtual time, with an application that sends setpoints, and a pilot."""

from collections.abc import Callable

from sitl.autopilot import SimAutopilot
from sitl.modes import Answer, Landed, Mode
from sitl.parameters import Parameters
from sitl.vehicle import euler_of
from sitl.wind import Wind

STEP_S = 0.004


class Flight:
    """In virtual time, with an application and a pilot: `target` and `sticks` are sent at 20 Hz while set."""

    def __init__(self, changes: dict[str, float | int] | None = None, *, speed: float = 1.0, wind_m_s: float = 0.0):
        parameters = Parameters({"MIS_TAKEOFF_ALT": 6.0, **(changes or {})})
        self.autopilot = SimAutopilot(parameters=parameters, wind=Wind(wind_m_s, 5), seed=5, speed=speed)
        self.target: tuple[float, float, float, float] | None = None
        self.texts: list[tuple[float, str]] = []
        self.modes: list[Mode] = [self.autopilot.mode]
        self.landed: list[Landed] = [self.autopilot.landed]
        self.sticks: tuple[float, float, float, float] | None = None
        self._steps = 0

    def run(self, time_s: float) -> None:
        for _ in range(round(time_s / STEP_S)):
            self.step()

    def run_until(self, is_reached: Callable[[], bool], within_s: float = 60.0) -> float:
        """Run until `is_reached()`; returns how long it took [s]."""
        began_s = self.autopilot.boot_s
        while not is_reached():
            self.step()
            assert self.autopilot.boot_s - began_s < within_s, f"not reached; heard {self.texts}"
        return self.autopilot.boot_s - began_s

    def step(self) -> None:
        if self.target is not None and self._steps % 12 == 0:
            self.autopilot.set_position_setpoint(*self.target)
        if self.sticks is not None and self._steps % 12 == 0:
            self.autopilot.set_sticks(*self.sticks)
        self.autopilot.step(STEP_S)
        self._steps += 1
        self.texts += [(self.autopilot.boot_s, text) for _, text in self.autopilot.drain_texts()]
        if self.autopilot.mode is not self.modes[-1]:
            self.modes.append(self.autopilot.mode)
        if self.autopilot.landed is not self.landed[-1]:
            self.landed.append(self.autopilot.landed)

    def heard(self, text: str) -> float:
        """When `text` was first said [s, boot]."""
        return next(at_s for at_s, said in self.texts if said == text)

    def has_heard(self, text: str) -> bool:
        return any(said == text for _, said in self.texts)

    def says(self, text: str) -> int:
        """How often `text` was said."""
        return sum(said == text for _, said in self.texts)

    def take_off(self) -> None:
        self.run_until(lambda: self.autopilot.commander.is_armable)
        assert self.autopilot.arm() is Answer.ACCEPTED
        assert self.autopilot.takeoff() is Answer.ACCEPTED
        self.run_until(lambda: self.autopilot.mode is Mode.LOITER)
        self.run(2.0)

    def go_offboard(self, north_m: float = 0.0, east_m: float = 0.0) -> None:
        n, e, d = self.autopilot.estimate.position_m
        self.target = (n + north_m, e + east_m, d, euler_of(self.autopilot.estimate.quaternion)[2])
        self.autopilot.set_position_setpoint(*self.target)
        assert self.autopilot.set_mode(Mode.OFFBOARD) is Answer.ACCEPTED
