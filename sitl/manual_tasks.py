"""What the autopilot flies for a pilot's sticks: Position and Altitude mode."""

import math

from sitl.control import Estimate, Setpoint, clamp
from sitl.flight_tasks import AutoTask
from sitl.parameters import Parameters
from sitl.pilot import Pilot, Sticks
from sitl.vehicle import GRAVITY_M_S2


class StickTask(AutoTask):
    """Position mode (POSCTL): the sticks ask for a velocity and a yaw rate; centred, the vehicle brakes and stays."""

    def __init__(self, parameters: Parameters, estimate: Estimate, pilot: Pilot) -> None:
        """Obey the sticks of `pilot`; without any they are taken for centred."""
        super().__init__(parameters, estimate)
        self._pilot = pilot

    def step(self, dt_s: float, estimate: Estimate, height_m: float) -> Setpoint:
        """The setpoint after `dt_s` [s]."""
        forward, right = self._horizontal(self._parameters.get("MPC_VEL_MANUAL"))
        self._reference.step(dt_s, (forward, right, self._down_m_s()), estimate.position_m)
        self._steer(dt_s)
        return self._setpoint()

    def _past_dead_zone(self, stick: float) -> float:
        """A stick without its dead zone around the centre (MPC_HOLD_DZ), still -1 to 1."""
        dead = self._parameters.get("MPC_HOLD_DZ")
        return math.copysign(max(0.0, abs(stick) - dead) / max(1.0 - dead, 1e-3), stick)

    @property
    def _sticks(self) -> Sticks:
        return self._pilot.sticks or Sticks()

    def _horizontal(self, full: float) -> tuple[float, float]:
        """What the pitch and roll sticks ask for, turned to (north, east); `full` is a stick at its end."""
        forward, right = self._past_dead_zone(self._sticks.pitch), self._past_dead_zone(self._sticks.roll)
        scale = full / max(1.0, math.hypot(forward, right))
        cos, sin = math.cos(self._yaw_rad), math.sin(self._yaw_rad)
        return (scale * (forward * cos - right * sin), scale * (forward * sin + right * cos))

    def _down_m_s(self) -> float:
        climb = self._past_dead_zone(clamp(self._sticks.climb, -1.0, 1.0))
        return -climb * self._parameters.get("MPC_Z_VEL_MAX_UP" if climb > 0 else "MPC_Z_VEL_MAX_DN")

    def _steer(self, dt_s: float) -> None:
        rate_rad_s = self._past_dead_zone(self._sticks.yaw) * math.radians(self._parameters.get("MPC_MAN_Y_MAX"))
        self._yaw_rad = math.remainder(self._yaw_rad + rate_rad_s * dt_s, 2 * math.pi)


class AltitudeTask(StickTask):
    """Altitude mode (ALTCTL): the sticks ask for a tilt, a climb and a yaw rate; the position drifts with the wind."""

    def step(self, dt_s: float, estimate: Estimate, height_m: float) -> Setpoint:
        """The setpoint after `dt_s` [s]."""
        full_m_s2 = GRAVITY_M_S2 * math.tan(math.radians(self._parameters.get("MPC_MAN_TILT_MAX")))
        self._reference.step(dt_s, (0.0, 0.0, self._down_m_s()), estimate.position_m)
        self._steer(dt_s)
        return self._setpoint(lean_m_s2=self._horizontal(full_m_s2))
