"""The simulated vehicle behind the mission's Autopilot protocol, in virtual time and without a socket.

It shows what MAVLink would: mode and armed state are told once a second, as PX4's heartbeat does.
"""

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
from sitl.vehicle import euler_of

STEP_S = 0.004
"""As the simulated vehicle of a dry-run is stepped [s]."""

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
    """A mission.autopilot.Autopilot. `sim` is stepped up to the clock whenever anybody asks anything of it.

    One that is given flies on where another link has left it. `commands` are the names of those given, in order.
    """

    def __init__(
        self,
        clock: Clock,
        sim: SimAutopilot,
        *,
        step_s: float = STEP_S,
    ) -> None:
        self._clock = clock
        self._step_s = step_s
        self.sim = sim
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
        self._setpoint: tuple[float, float, float, float] | None = None
        self._was_offboard = False

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
        if setpoint is None:
            return
        north_m, east_m, down_m = setpoint.position_m
        if north_m is not None and east_m is not None and down_m is not None:
            self._target = Setpoint(north_m, east_m, down_m, setpoint.yaw_rad)

    def _repeat_setpoint(self) -> None:
        """MAVSDK's own thread repeats the last setpoint, until a heartbeat says that the mode is another."""
        if self._heartbeat[0] is not Mode.OFFBOARD and self._was_offboard:
            self._setpoint = None
        self._was_offboard = self._heartbeat[0] is Mode.OFFBOARD
        if self._setpoint is not None and self.hears_us:
            self.sim.set_position_setpoint(*self._setpoint)

    @property
    def state(self) -> VehicleState | None:
        """The vehicle now; while nothing comes from it, its last state."""
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
            boot_ns=round(self.sim.boot_s * 1e9),
        )

    @property
    def takes_off_in_offboard(self) -> bool:
        """No: PX4 has a mode of its own for it."""
        return False

    @property
    def target(self) -> Setpoint | None:
        """What the autopilot last said it flies to."""
        self.catch_up()
        return self._target

    async def read_origin(self) -> GlobalPoint | None:
        """Where the local frame's origin lies on Earth."""
        origin = self.sim.origin
        return GlobalPoint(*origin.global_of((0.0, 0.0, 0.0)))

    def drain_status_texts(self) -> list[str]:
        """The texts since the last call."""
        return [text for _, text in self.sim.drain_texts()]

    async def connect(self) -> None:
        """There is nothing to connect."""
        self.catch_up()

    def missing_health(self) -> list[str]:
        """What the autopilot waits for before it could be armed."""
        self.catch_up()
        if self.sim.boot_s < 5.0:
            return ["global position (GPS)"]
        return [] if self.sim.commander.is_armable else ["the autopilot's own arming checks"]

    async def identify(self) -> Identity:
        """PX4, as simulated."""
        return Identity(AutopilotKind.PX4, "1.16.1", "00000000000000000000000000000001")

    async def read_parameters(self, names: Sequence[str]) -> dict[str, float]:
        """Those of the parameters that it has."""
        self.catch_up()
        known = {parameter.name: float(parameter.value) for parameter in self.sim.parameters.all()}
        return {name: known[name] for name in names if name in known}

    async def arm(self) -> None:
        """Arm."""
        self._command("arm", self.sim.arm)

    async def takeoff(self, altitude_m: float) -> None:
        """Take off to `altitude_m` over home."""
        self.catch_up()
        self.sim.set_parameter("MIS_TAKEOFF_ALT", altitude_m)
        self._command("takeoff", self.sim.takeoff)

    async def start_offboard(self, setpoint: Setpoint) -> None:
        """Send the first setpoint, and change to offboard."""
        await self.set_setpoint(setpoint)
        self._command("offboard", lambda: self.sim.set_mode(Mode.OFFBOARD))

    async def set_setpoint(self, setpoint: Setpoint) -> None:
        """Send a setpoint, which is repeated from then on."""
        self.catch_up()
        self._setpoint = (setpoint.north_m, setpoint.east_m, setpoint.down_m, setpoint.yaw_rad)
        if self.hears_us:
            self.sim.set_position_setpoint(*self._setpoint)

    async def hold(self) -> None:
        """Hold in its own mode."""
        self._command("hold", lambda: self.sim.set_mode(Mode.LOITER))

    async def return_home(self) -> None:
        """Return, and land there."""
        self._command("return", lambda: self.sim.set_mode(Mode.RTL))

    async def land(self) -> None:
        """Land here."""
        self._command("land", self.sim.land)

    async def close(self) -> None:
        """Send nothing any more."""
        self._setpoint = None
        self._is_closed = True

    def _command(self, name: str, act: Callable[[], Answer]) -> None:
        self.catch_up()
        self.commands.append(name)
        if not self.hears_us:
            raise NoAnswerError(f"the autopilot did not answer when asked to {name}")
        answer = act()
        if answer is not Answer.ACCEPTED:
            raise AutopilotError(f"the autopilot refused to {name}: {answer.name.lower()}")

    def true_pose(self) -> tuple[tuple[float, float, float], tuple[float, float, float, float]]:
        """Where the vehicle truly is: position NED [m], attitude (w, x, y, z)."""
        self.catch_up()
        return self.sim.vehicle.position_m, self.sim.vehicle.quaternion
