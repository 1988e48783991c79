"""The simulated vehicle behind the mission's Autopilot protocol, in virtual time and without a socket.

It shows what MAVLink would: mode and armed state are told once a second, as PX4's heartbeat does.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

from drivers.clock import Clock
from mission.autopilot import (
    AutopilotError,
    AutopilotKind,
    FlightMode,
    GlobalPoint,
    Identity,
    LandedState,
    NoAnswerError,
    Setpoint,
    VehicleState,
)
from sitl.autopilot import SimAutopilot
from sitl.modes import Answer, Landed, Mode
from sitl.parameters import Parameters
from sitl.setup import SETUP
from sitl.vehicle import Vehicle, euler_of
from sitl.wind import Wind

_STEP_S = 0.01
_MODES = {
    Mode.TAKEOFF: FlightMode.TAKEOFF,
    Mode.LOITER: FlightMode.HOLD,
    Mode.OFFBOARD: FlightMode.OFFBOARD,
    Mode.RTL: FlightMode.RETURN,
    Mode.LAND: FlightMode.LAND,
}
_LANDED = {
    Landed.ON_GROUND: LandedState.ON_GROUND,
    Landed.TAKEOFF: LandedState.TAKING_OFF,
    Landed.IN_AIR: LandedState.IN_AIR,
    Landed.LANDING: LandedState.LANDING,
}


class InProcessAutopilot:
    """A mission.autopilot.Autopilot. The vehicle is stepped up to the clock whenever anybody asks anything of it."""

    def __init__(
        self,
        clock: Clock,
        *,
        start_yaw_rad: float = 0.0,
        wind_m_s: float = 0.0,
        seed: int = 1,
        sim: SimAutopilot | None = None,
        step_s: float = _STEP_S,
    ) -> None:
        self._clock = clock
        self._step_s = step_s
        self.sim = sim or SimAutopilot(
            Vehicle(yaw_rad=start_yaw_rad), Wind(wind_m_s, seed), seed=seed, parameters=Parameters(SETUP)
        )
        """The vehicle; one that is given flies on where another link has left it."""
        self._heartbeat: tuple[Mode, bool] = (self.sim.mode, self.sim.is_armed)
        self._heartbeat_s = self.sim.boot_s
        self._heartbeat_failsafe = False
        self._target: Setpoint | None = None
        self._target_s = self.sim.boot_s
        self.is_connected = True
        self.hears_us = True
        """Whether what we send reaches the vehicle. Setpoints that do not are lost in silence, commands unanswered."""
        self.tells_us = True
        """Whether telemetry comes; without it the last state stays."""
        self.after_step: list[Callable[[], None]] = []
        """Called after each step of the vehicle."""
        self._last_state: VehicleState | None = None
        self._is_closed = False
        self.commands: list[str] = []
        self.n_setpoints = 0
        self._setpoint: tuple[float, float, float, float] | None = None
        self._was_offboard = False
        self.faults: dict[str, list[str]] = {}
        """What goes wrong with the next calls of a command: refused, lost (obeyed, unanswered), ignored (answered)."""

    def catch_up(self) -> None:
        """Step the vehicle to now."""
        now_s = self._clock.now_ns() / 1e9
        while self.sim.boot_s + self._step_s <= now_s:
            self.sim.step(self._step_s)
            self._repeat_setpoint()
            for act in self.after_step:
                act()
            if self.sim.boot_s - self._heartbeat_s >= 1.0:
                if self.hears_us and not self._is_closed:
                    self.sim.see_ground_station()  # MAVSDK's own heartbeat
                self._heartbeat_s += 1.0
                self._heartbeat = (self.sim.mode, self.sim.is_armed)
                self._heartbeat_failsafe = self.sim.failsafe is not None
            if self.sim.boot_s - self._target_s >= 0.1:
                self._target_s = self.sim.boot_s
                self._tell_target()

    def _tell_target(self) -> None:
        """POSITION_TARGET_LOCAL_NED, ten times a second."""
        setpoint = self.sim.setpoint
        if setpoint is not None and None not in setpoint.position_m:
            self._target = Setpoint(*setpoint.position_m, setpoint.yaw_rad)

    def _repeat_setpoint(self) -> None:
        """MAVSDK's own thread repeats the last setpoint, until a heartbeat says that the mode is another."""
        if self._heartbeat[0] is not Mode.OFFBOARD and self._was_offboard:
            self._setpoint = None
        self._was_offboard = self._heartbeat[0] is Mode.OFFBOARD
        if self._setpoint is not None and self.hears_us:
            self.sim.set_position_setpoint(*self._setpoint)

    @property
    def state(self) -> VehicleState | None:
        self.catch_up()
        if self.tells_us or self._last_state is None:
            self._last_state = self._state_now()
        return replace(self._last_state, is_connected=self.is_connected)

    def _state_now(self) -> VehicleState:
        estimate = self.sim.estimate
        roll_rad, pitch_rad, yaw_rad = euler_of(estimate.quaternion)
        mode, is_armed = self._heartbeat
        return VehicleState(
            self._clock.now_ns(),
            *estimate.position_m,
            *estimate.velocity_m_s,
            roll_rad,
            pitch_rad,
            yaw_rad,
            _MODES.get(mode, FlightMode.OTHER),
            is_armed,
            _LANDED[self.sim.landed],
            self.sim.battery.remaining,
            self.is_connected,
            is_failsafe=self._heartbeat_failsafe,
            is_position_ok=self.sim.is_position_ok,
        )

    @property
    def takes_off_in_offboard(self) -> bool:
        return False

    @property
    def target(self) -> Setpoint | None:
        self.catch_up()
        return self._target

    async def read_origin(self) -> GlobalPoint | None:
        origin = self.sim.origin
        return GlobalPoint(*origin.global_of((0.0, 0.0, 0.0)))

    def drain_status_texts(self) -> list[str]:
        return [text for _, text in self.sim.drain_texts()]

    async def connect(self) -> None:
        self.catch_up()

    def missing_health(self) -> list[str]:
        self.catch_up()
        if self.sim.boot_s < 5.0:
            return ["global position (GPS)"]
        return [] if self.sim.commander.is_armable else ["the autopilot's own arming checks"]

    async def identify(self) -> Identity:
        return Identity(AutopilotKind.PX4, "1.16.1", "00000000000000000000000000000001")

    async def read_parameters(self, names: Sequence[str]) -> dict[str, float]:
        self.catch_up()
        known = {parameter.name: float(parameter.value) for parameter in self.sim.parameters.all()}
        return {name: known[name] for name in names if name in known}

    async def arm(self) -> None:
        self._command("arm", self.sim.arm)

    async def takeoff(self, altitude_m: float) -> None:
        self.catch_up()
        self.sim.set_parameter("MIS_TAKEOFF_ALT", altitude_m)
        self._command("takeoff", self.sim.takeoff)

    async def start_offboard(self, setpoint: Setpoint) -> None:
        await self.set_setpoint(setpoint)
        self._command("offboard", lambda: self.sim.set_mode(Mode.OFFBOARD))

    async def set_setpoint(self, setpoint: Setpoint) -> None:
        self.catch_up()
        faults = self.faults.get("setpoint", [])
        if faults:
            raise NoAnswerError(f"the setpoint was {faults.pop(0)}")
        self.n_setpoints += 1
        self._setpoint = (setpoint.north_m, setpoint.east_m, setpoint.down_m, setpoint.yaw_rad)
        if self.hears_us:
            self.sim.set_position_setpoint(*self._setpoint)

    async def hold(self) -> None:
        self._command("hold", lambda: self.sim.set_mode(Mode.LOITER))

    async def return_home(self) -> None:
        self._command("return", lambda: self.sim.set_mode(Mode.RTL))

    async def land(self) -> None:
        self._command("land", self.sim.land)

    async def close(self) -> None:
        self._setpoint = None
        self._is_closed = True

    def die(self) -> None:
        """The program at this end was killed: nothing more is sent, its own thread's setpoints neither."""
        self._setpoint = None
        self._is_closed = True
        self.hears_us = False

    def _command(self, name: str, act: Callable[[], Answer]) -> None:
        self.catch_up()
        self.commands.append(name)
        faults = self.faults.get(name, [])
        fault = faults.pop(0) if faults else None
        if not self.hears_us:
            raise NoAnswerError(f"the autopilot did not answer when asked to {name}")
        if fault == "refused":
            raise AutopilotError(f"the autopilot refused to {name}: denied")
        if fault == "ignored":
            return
        answer = act()
        if fault == "lost":
            raise NoAnswerError(f"the autopilot did not answer when asked to {name}")
        if answer is not Answer.ACCEPTED:
            raise AutopilotError(f"the autopilot refused to {name}: {answer.name.lower()}")

    def true_pose(self) -> tuple[tuple[float, float, float], tuple[float, float, float, float]]:
        """Where the vehicle truly is: position NED [m], attitude (w, x, y, z)."""
        self.catch_up()
        return self.sim.vehicle.position_m, self.sim.vehicle.quaternion

    @property
    def true_yaw_rad(self) -> float:
        """The vehicle's true heading."""
        return euler_of(self.sim.vehicle.quaternion)[2]

    @property
    def true_distance_m(self) -> float:
        """How far the vehicle truly is from where it started, level."""
        return math.hypot(self.sim.vehicle.position_m[0], self.sim.vehicle.position_m[1])
