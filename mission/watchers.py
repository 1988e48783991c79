"""Small memories that watch one thing over the control ticks. They do no I/O, and time is what they are told."""

import math
from collections import deque

from drivers.clock import NS_PER_S
from mission.autopilot import FlightMode, Setpoint, VehicleState
from mission.hazards import PaceView

_LATE_S = 0.05
_PACE_WINDOW = 100

_TARGET_MEMORY_S = 2.0
_FOREIGN_M = 0.5
_FOREIGN_S = 2.5
_LONGEST_PAUSE_S = 0.2

_ASTRAY_SHARE = 0.9
_ASTRAY_S = 5.0
_CLOSING_M_S = 0.3
_MAX_TILT_RAD = math.radians(40.0)
_TILT_S = 3.0


class Pace:
    """How punctual the control loop is over its last 5 seconds."""

    def __init__(self) -> None:
        self._is_late: deque[bool] = deque(maxlen=_PACE_WINDOW)
        self.view = PaceView()

    def tick(self, late_s: float) -> None:
        """A control tick began `late_s` [s, wall] after its deadline."""
        self._is_late.append(late_s > _LATE_S)
        # Until the window is full a few late ticks of a start would weigh too much.
        self.view = PaceView(late_s, sum(self._is_late) / _PACE_WINDOW)


class TargetWatch:
    """Compares what the autopilot says it flies to with what we sent: two programs must not steer one vehicle.

    PX4 tells back the setpoint it obeys to the millimetre (POSITION_TARGET_LOCAL_NED, 10 Hz). One that we never sent is
    another's, or that of a mode which the pilot has just chosen: the heartbeat tells of it up to a second later, so
    that only what lasts longer counts. Where two streams mix, some of the targets are ours, and it takes longer.
    """

    def __init__(self) -> None:
        self._sent: deque[tuple[int, Setpoint]] = deque()
        self._last: Setpoint | None = None
        self._last_ns = 0
        self._foreign_s = 0.0

    def sent(self, t_ns: int, setpoint: Setpoint) -> None:
        """We sent a setpoint."""
        self._sent.append((t_ns, setpoint))
        while self._sent[0][0] < t_ns - _TARGET_MEMORY_S * NS_PER_S:
            self._sent.popleft()

    def heard(self, now_ns: int, target: Setpoint | None, state: VehicleState, *, is_offboard: bool) -> str | None:
        """What is wrong with the newest target, in a sentence; None where it is ours or does not count.

        `is_offboard` says that offboard is what we commanded last.
        """
        if not is_offboard or state.mode is not FlightMode.OFFBOARD:
            self._foreign_s = 0.0
            return None
        if target is not None and target is not self._last:
            passed_s = min((now_ns - self._last_ns) / NS_PER_S, _LONGEST_PAUSE_S)
            self._last, self._last_ns = target, now_ns
            is_ours = any(_distance_m(target, ours) < _FOREIGN_M for _, ours in self._sent)
            self._foreign_s = max(0.0, self._foreign_s - passed_s / 3) if is_ours else self._foreign_s + passed_s
        if self._foreign_s <= _FOREIGN_S:
            return None
        return "the autopilot flies to setpoints that we did not send: a second program steers it"


def _distance_m(a: Setpoint, b: Setpoint) -> float:
    return math.dist((a.north_m, a.east_m, a.down_m), (b.north_m, b.east_m, b.down_m))


class TrackingWatch:
    """Whether the vehicle follows its setpoints: not when it comes no nearer to them, or has to tilt too far.

    Both are what too much wind looks like, and a weak motor too.
    """

    def __init__(self, leash_m: float) -> None:
        self._astray_m = _ASTRAY_SHARE * leash_m
        self._astray_s = 0.0
        self._tilted_s = 0.0

    def tick(self, dt_s: float, state: VehicleState, reference: Setpoint, *, is_offboard: bool) -> str | None:
        """What is wrong, in a sentence; None where the vehicle follows."""
        north_m, east_m = reference.north_m - state.north_m, reference.east_m - state.east_m
        distance_m = math.hypot(north_m, east_m)
        closing_m_s = (north_m * state.v_north_m_s + east_m * state.v_east_m_s) / max(distance_m, 1e-3)
        is_astray = is_offboard and distance_m > self._astray_m and closing_m_s < _CLOSING_M_S
        tilt_rad = math.acos(max(-1.0, min(1.0, math.cos(state.roll_rad) * math.cos(state.pitch_rad))))
        self._astray_s = self._astray_s + dt_s if is_astray else 0.0
        self._tilted_s = self._tilted_s + dt_s if is_offboard and tilt_rad > _MAX_TILT_RAD else 0.0
        if self._astray_s > _ASTRAY_S:
            return f"the vehicle has stayed {distance_m:.1f} m behind its setpoint for {self._astray_s:.0f} s"
        if self._tilted_s > _TILT_S:
            return f"the vehicle has been tilted by {math.degrees(tilt_rad):.0f} degrees for {self._tilted_s:.0f} s"
        return None
