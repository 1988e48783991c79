"""Walking the setpoint from waypoint to waypoint, each with its place, height and yaw."""

from collections.abc import Sequence
from dataclasses import replace

from mission.autopilot import Setpoint
from mission.guidance import GuidanceSettings, step_level_towards, step_vertical, wrap_angle_rad
from mission.tasks.task import Observation, is_there

_YAW_REACHED_RAD = 0.2


class Walk:
    """Moves the reference along `waypoints`, and to the next one when the vehicle has arrived.

    Place and height move together, at `r` and at the climb or descent speed of the guidance.
    """

    def __init__(self, waypoints: Sequence[Setpoint], guidance: GuidanceSettings) -> None:
        self._waypoints = list(waypoints)
        self._guidance = guidance

    @property
    def is_done(self) -> bool:
        """Whether the vehicle has been at the last waypoint."""
        return not self._waypoints

    def step(self, reference: Setpoint, seen: Observation) -> Setpoint:
        """The next setpoint; the reference itself at the end of the walk."""
        if not self._waypoints:
            return reference
        setpoint = step_towards(reference, self._waypoints[0], self._guidance, seen.dt_s)
        yaw_error_rad = abs(wrap_angle_rad(setpoint.yaw_rad - seen.state.yaw_rad))
        is_here = is_there(seen.state, setpoint, self._guidance.arrival_m) and yaw_error_rad < _YAW_REACHED_RAD
        if setpoint == self._waypoints[0] and is_here:
            self._waypoints.pop(0)
        return setpoint


def step_towards(reference: Setpoint, goal: Setpoint, guidance: GuidanceSettings, dt_s: float) -> Setpoint:
    """One step of place, height and yaw towards a goal, each at most as fast as the guidance says."""
    setpoint = step_level_towards(reference, goal, guidance.r_m_s, dt_s)
    is_climb = goal.down_m < reference.down_m
    setpoint = step_vertical(setpoint, goal.down_m, guidance.climb_m_s if is_climb else guidance.descend_m_s, dt_s)
    turn_rad = wrap_angle_rad(goal.yaw_rad - reference.yaw_rad)
    limit_rad = guidance.yaw_rate_rad_s * dt_s
    if abs(turn_rad) <= limit_rad:
        yaw_rad = goal.yaw_rad
    else:
        yaw_rad = wrap_angle_rad(reference.yaw_rad + (limit_rad if turn_rad > 0.0 else -limit_rad))
    # What is nearer than arithmetic can tell is there.
    level = (goal.north_m, goal.east_m)
    is_near = abs(setpoint.north_m - level[0]) < 1e-9 and abs(setpoint.east_m - level[1]) < 1e-9
    if is_near:
        setpoint = replace(setpoint, north_m=level[0], east_m=level[1])
    return replace(setpoint, yaw_rad=yaw_rad, down_m=_snap(setpoint.down_m, goal.down_m))


def _snap(value: float, goal: float) -> float:
    return goal if abs(value - goal) < 1e-9 else value
