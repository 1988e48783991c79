"""From a flight task to thrust and torque: the take-off ramp, the position loop and the attitude loop in a row."""

import math
from dataclasses import replace

from sitl.control import AttitudeControl, Estimate, PositionControl, Setpoint, attitude_of
from sitl.flight_tasks import FlightTask, Takeoff
from sitl.parameters import Parameters
from sitl.takeoff_landing import Ramp, TakeoffRamp
from sitl.vehicle import Vector

_IDLE_THRUST = 0.001  # armed and standing
_NO_TORQUE: Vector = (0.0, 0.0, 0.0)


class FlightControl:
    """Steers by the flight task's setpoint. `setpoint` is the newest one (None on the ground), `thrust` 0 to 1."""

    def __init__(self, parameters: Parameters, hover_thrust: float) -> None:
        """Stand; `hover_thrust` (0 to 1) is what PX4's hover thrust estimator finds."""
        self._parameters = parameters
        self._ramp = TakeoffRamp(parameters)
        self._position = PositionControl(parameters, hover_thrust)
        self._attitude = AttitudeControl(parameters)
        self.setpoint: Setpoint | None = None
        self.thrust = 0.0

    @property
    def ramp(self) -> Ramp:
        """Where a take-off stands."""
        return self._ramp.state

    def tune(self) -> None:
        """Take the parameters that are in force now."""
        self._position.tune(self._parameters)
        self._attitude.tune(self._parameters)

    def prepare(self, dt_s: float, *, is_armed: bool, wants_takeoff: bool, is_landed: bool) -> None:
        """Let the ramp move on by `dt_s` [s]."""
        self._ramp.step(dt_s, is_armed=is_armed, wants_takeoff=wants_takeoff, is_landed=is_landed)

    def step(
        self, dt_s: float, task: FlightTask | None, estimate: Estimate, height_m: float, *, has_let_go: bool
    ) -> Vector:
        """The torque -1 to 1 after `dt_s` [s], and `thrust`; `has_let_go` is the land detector's word for standing."""
        self.thrust, torque = self._steer(dt_s, task, estimate, height_m, has_let_go=has_let_go)
        return torque

    def _steer(
        self, dt_s: float, task: FlightTask | None, estimate: Estimate, height_m: float, *, has_let_go: bool
    ) -> tuple[float, Vector]:
        state = self._ramp.state
        if state in (Ramp.DISARMED, Ramp.SPOOLUP, Ramp.READY) or task is None:
            self._position.reset()
            self._attitude.reset()
            self.setpoint = None
            return (0.0 if state is Ramp.DISARMED else _IDLE_THRUST), _NO_TORQUE
        if state is Ramp.RAMPUP and isinstance(task, Takeoff) and self._ramp.max_up_m_s(1.0) < 0.0:
            task.wait()
        setpoint = task.step(dt_s, estimate, height_m)
        if state is Ramp.RAMPUP:
            setpoint = replace(setpoint, max_up_m_s=self._ramp.max_up_m_s(setpoint.max_up_m_s))
        self.setpoint = setpoint
        if has_let_go:
            self._position.reset()
            return self._parameters.get("MPC_THR_MIN"), _NO_TORQUE
        thrust = self._position.step(dt_s, setpoint, estimate)
        wanted = attitude_of(thrust, setpoint.yaw_rad)
        torque = self._attitude.step(dt_s, wanted, estimate.quaternion, estimate.rates_rad_s)
        return math.sqrt(thrust[0] ** 2 + thrust[1] ** 2 + thrust[2] ** 2), torque
