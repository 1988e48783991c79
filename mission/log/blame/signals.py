"""The signals that blame looks at, from a flight's records: arrays over the times of the vehicle's states. Pure."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.clock import NS_PER_S
from mission.log.measures import nearest_on_axis, true_axis
from mission.log.reader import Flight

Floats = NDArray[np.float64]
Times = NDArray[np.int64]

GRAVITY_M_S2 = 9.80665
_SLOPE_S = 0.4  # over which a velocity's slope is taken: telemetry comes 20 times a second and is rough

_STRAIGHT_RAD = np.radians(8.0)
_BEND_S = 3.0  # before and after a bend, the other span may be the nearer one
_JUMP_M = 0.4  # between two states, beyond the way that their velocities tell: none that flies does that
_JUMP_S = 0.5  # between states that are further apart, velocities do not tell the way so well
_BEND_AWAY_M = 12.0  # at most so far from the vehicle the line may bend (mission/known_line.py)


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """The vehicle as the autopilot told it, and the setpoint that it had, at (n,) times [ns].

    Positions and setpoints are (n, 3) NED [m], NaN where there was no setpoint; `thrust_m_s2` and `push_m_s2` are
    (n, 2) north, east: what its tilt and what everything else, which is the air, did to it. `velocity_m_s` (n, 3) NED
    is the autopilot's own, not the slope of its positions.
    """

    t_ns: Times
    position_m: Floats
    velocity_m_s: Floats
    roll_rad: Floats
    yaw_rad: Floats
    setpoint_m: Floats
    setpoint_yaw_rad: Floats
    thrust_m_s2: Floats
    push_m_s2: Floats
    tilt_rad: Floats

    def slice(self, start_ns: int, end_ns: int) -> "Motion":
        """What lies between two times."""
        is_in = (self.t_ns >= start_ns) & (self.t_ns <= end_ns)
        return Motion(*(getattr(self, name)[is_in] for name in self.__slots__))


def motion_of(flight: Flight) -> Motion:
    """The vehicle's motion over the whole flight."""
    states = list({state.t_ns: state for state in flight.states}.values())
    t_ns = np.array([state.t_ns for state in states], dtype=np.int64)
    position_m = np.array([(s.north_m, s.east_m, s.down_m) for s in states], dtype=np.float64).reshape(-1, 3)
    velocity_m_s = np.array([(s.v_north_m_s, s.v_east_m_s, s.v_down_m_s) for s in states], dtype=np.float64)
    velocity_m_s = velocity_m_s.reshape(-1, 3)
    angles = np.array([(s.roll_rad, s.pitch_rad, s.yaw_rad) for s in states], dtype=np.float64).reshape(-1, 3)
    setpoints = flight.setpoints
    sent_ns = np.array([s.t_ns for s in setpoints], dtype=np.int64)
    sent = np.array([(s.north_m, s.east_m, s.down_m, s.yaw_rad) for s in setpoints], dtype=np.float64).reshape(-1, 4)
    held = held_at(t_ns, sent_ns, sent, longest_s=1.0)
    down = down_axis(angles)
    acceleration = slope(t_ns, velocity_m_s)
    # Along the thrust, minus the body's down axis, what is left of gravity when the vertical acceleration is taken out.
    lift_m_s2 = (GRAVITY_M_S2 - acceleration[:, 2]) / np.maximum(down[:, 2], 0.2)
    thrust_m_s2 = -lift_m_s2[:, None] * down[:, :2]
    return Motion(
        t_ns=t_ns,
        position_m=position_m,
        velocity_m_s=velocity_m_s,
        roll_rad=angles[:, 0],
        yaw_rad=angles[:, 2],
        setpoint_m=held[:, :3],
        setpoint_yaw_rad=held[:, 3],
        thrust_m_s2=thrust_m_s2,
        push_m_s2=acceleration[:, :2] - thrust_m_s2,
        tilt_rad=np.arccos(np.clip(down[:, 2], -1.0, 1.0)),
    )


def unexplained_steps_m(motion: Motion) -> Floats:
    """By how much the position jumped since the state before, (n, 2) NE [m]: 0 where the velocity explains its way."""
    steps_m = np.zeros((len(motion.t_ns), 2))
    if len(motion.t_ns) < 2:
        return steps_m
    dt_s = np.diff(motion.t_ns) / NS_PER_S
    flown_m = 0.5 * (motion.velocity_m_s[1:, :2] + motion.velocity_m_s[:-1, :2]) * dt_s[:, None]
    beyond_m = np.diff(motion.position_m[:, :2], axis=0) - flown_m
    is_jump = (np.linalg.norm(beyond_m, axis=1) > _JUMP_M) & (dt_s <= _JUMP_S)
    steps_m[1:] = np.where(is_jump[:, None], beyond_m, 0.0)
    return steps_m


def down_axis(angles_rad: Floats) -> Floats:
    """The body's down axis in NED, (n, 3), of attitudes (n, 3): roll, pitch, yaw [rad]."""
    roll, pitch, yaw = angles_rad.T
    return np.stack(
        [
            np.cos(roll) * np.sin(pitch) * np.cos(yaw) + np.sin(roll) * np.sin(yaw),
            np.cos(roll) * np.sin(pitch) * np.sin(yaw) - np.sin(roll) * np.cos(yaw),
            np.cos(roll) * np.cos(pitch),
        ],
        axis=1,
    )


def slope(t_ns: Times, values: Floats) -> Floats:
    """The slope [1/s] of values (n, k) by differences over about 0.4 s; 0 where there are fewer than two."""
    n = len(t_ns)
    if n < 2:
        return np.zeros_like(values)
    half_ns = round(0.5 * _SLOPE_S * NS_PER_S)
    first = np.minimum(np.searchsorted(t_ns, t_ns - half_ns), n - 2)
    last = np.maximum(np.searchsorted(t_ns, t_ns + half_ns, side="right") - 1, first + 1)
    return np.asarray((values[last] - values[first]) / ((t_ns[last] - t_ns[first]) / NS_PER_S)[:, None])


def held_at(t_ns: Times, sent_ns: Times, sent: Floats, *, longest_s: float) -> Floats:
    """What was sent last at each time: (m, k) sent at (m,) -> (n, k); NaN before the first, and after `longest_s`."""
    held = np.full((len(t_ns), sent.shape[1]), np.nan)
    if not len(sent_ns):
        return held
    index = np.searchsorted(sent_ns, t_ns, side="right") - 1
    is_held = (index >= 0) & (t_ns - sent_ns[index] <= longest_s * NS_PER_S)
    held[is_held] = sent[index[is_held]]
    return held


@dataclass(frozen=True, slots=True, eq=False)
class Lateral:
    """How far the vehicle was off its line, and what that is made of: (n,) [m], right of the line as flown positive.

    `off_m` is the true distance where the line is known in truth (`is_true`), else the one believed. It is the sum of
    `perception_m`, by which the line was elsewhere than told, `executive_m`, by which the setpoint was off the line as
    told, and `tracking_m`, by which the vehicle was off its setpoint. NaN where nothing was told yet. `age_s` is how
    old the newest place of the line was. `aside_m` is the way from the line as it lies, which does not move with each
    frame: in truth, or in the median of all that was told of a straight leg, NaN on a bent one. `told` (n, 4) is the
    newest line, as Knowledge holds it.
    """

    t_ns: Times
    off_m: Floats
    perception_m: Floats
    executive_m: Floats
    tracking_m: Floats
    aside_m: Floats
    right: Floats
    age_s: Floats
    told: Floats
    is_true: bool


@dataclass(frozen=True, slots=True, eq=False)
class Knowledge:
    """What was told of the line over a flight, and what was true: arrays that every leg looks into.

    `told` (m, 4) holds north, east [m], heading [rad] and capture time [ns] of each place that was told, at `told_ns`
    (m,). `truth_ns` (k,) and `truth_ne_m` (k, 2) are where the vehicle truly was, `axis_ne_m` the true line; None where
    nobody knows it.
    """

    told_ns: Times
    told: Floats
    truth_ns: Times
    truth_ne_m: Floats
    axis_ne_m: Floats | None


def knowledge_of(flight: Flight) -> Knowledge:
    """What a flight's log holds about the line."""
    latency_ns = {report.t_capture_ns: report.latency_ns for report in flight.reports}
    fixes = [fix for fix in flight.fixes if fix.is_placed]
    told_ns = np.array([fix.t_ns + latency_ns.get(fix.t_ns, 0) for fix in fixes], dtype=np.int64)
    told = np.array([(f.north_m, f.east_m, f.heading_rad, f.t_ns) for f in fixes], dtype=np.float64).reshape(-1, 4)
    order = np.argsort(told_ns, kind="stable")
    is_known = flight.line is not None and len(flight.line.axis_ne_m) >= 2 and len(flight.truth) >= 2
    return Knowledge(
        told_ns=told_ns[order],
        told=told[order],
        truth_ns=np.array([pose.t_ns for pose in flight.truth], dtype=np.int64),
        truth_ne_m=np.array([(pose.north_m, pose.east_m) for pose in flight.truth], dtype=np.float64).reshape(-1, 2),
        axis_ne_m=true_axis(flight.line) if is_known and flight.line is not None else None,
    )


def lateral_of(known: Knowledge, motion: Motion) -> Lateral:
    """Divide the way off the line, at the times of `motion`, among those who made it."""
    t_ns, n = motion.t_ns, len(motion.t_ns)
    told = held_at(t_ns, known.told_ns, known.told, longest_s=np.inf)
    age_s = (t_ns - told[:, 3]) / NS_PER_S
    line = _nearer_span(motion, told)
    line_along = np.where(np.cos(line[:, 2] - motion.yaw_rad) < 0.0, line[:, 2] + np.pi, line[:, 2])
    right = np.stack([-np.sin(line_along), np.cos(line_along)], axis=1)
    believed_m = ((motion.position_m[:, :2] - line[:, :2]) * right).sum(axis=1)
    tracking_m = ((motion.position_m - motion.setpoint_m)[:, :2] * right).sum(axis=1)
    true_m = _true_off_m(known, motion)
    return Lateral(
        t_ns=t_ns,
        off_m=believed_m if true_m is None else true_m,
        perception_m=np.zeros(n) if true_m is None else true_m - believed_m,
        executive_m=believed_m - tracking_m,
        tracking_m=tracking_m,
        aside_m=_aside_m(known.told, motion, right) if true_m is None else true_m,
        right=right,
        age_s=age_s,
        told=told,
        is_true=true_m is not None,
    )


def _nearer_span(motion: Motion, told: Floats) -> Floats:
    """The line at each time (n, 4): as told, but near a bend the span of both that is nearer to the vehicle.

    The old one ends at the bend and the new one begins there: what goes on straight is not the line.
    """
    line, t_ns = told.copy(), motion.t_ns
    turn_rad = np.abs(np.remainder(np.diff(told[:, 2]) + np.pi / 2, np.pi) - np.pi / 2)
    for k in (np.flatnonzero(np.nan_to_num(turn_rad) > _STRAIGHT_RAD) + 1).tolist():
        old, new = told[k - 1], told[k]
        before, after = (_way_along(span[2], motion.yaw_rad[k]) for span in (old, new))
        normal = np.array([-after[1], after[0]])
        to_bend_m = float((new[:2] - old[:2]) @ normal) / float(before @ normal)
        if abs(to_bend_m) > _BEND_AWAY_M:
            continue  # not a bend: another line
        near = slice(*np.searchsorted(t_ns, [t_ns[k] - round(_BEND_S * NS_PER_S), t_ns[k] + round(_BEND_S * NS_PER_S)]))
        beyond_m = motion.position_m[near, :2] - (old[:2] + to_bend_m * before)
        is_new = _ray_distance_m(beyond_m, after) < _ray_distance_m(beyond_m, -before)
        line[near] = np.where(is_new[:, None], new, old)
    return line


def _way_along(line_heading_rad: float, yaw_rad: float) -> Floats:
    """The direction along a line, of both the one that is flown."""
    sign = 1.0 if np.cos(line_heading_rad - yaw_rad) >= 0.0 else -1.0
    return sign * np.array([np.cos(line_heading_rad), np.sin(line_heading_rad)])


def _ray_distance_m(places_m: Floats, way: Floats) -> Floats:
    """How far places (n, 2) are from the ray that begins at the origin and runs along `way`."""
    along_m = np.maximum(places_m @ way, 0.0)
    return np.asarray(np.linalg.norm(places_m - along_m[:, None] * way, axis=1))


def _aside_m(told: Floats, motion: Motion, right: Floats) -> Floats:
    """The vehicle's distance from the median of the lines (m, 4) that were told within a straight leg.

    Where the autopilot's position jumped, neither vehicle nor line did: that is taken out of both.
    """
    n = len(motion.t_ns)
    if not n:
        return np.empty(0)
    told = told[(told[:, 3] >= motion.t_ns[0]) & (told[:, 3] <= motion.t_ns[-1])]
    if not len(told):
        return np.full(n, np.nan)
    middle_rad = _mean_axis_rad(told[:, 2])
    turned_rad = np.abs(np.remainder(told[:, 2] - middle_rad + np.pi / 2, np.pi) - np.pi / 2)
    if float(np.percentile(turned_rad, 90)) > _STRAIGHT_RAD:
        return np.full(n, np.nan)
    normal = np.array([-np.sin(middle_rad), np.cos(middle_rad)])
    jumped_m = np.cumsum(unexplained_steps_m(motion), axis=0)
    then = np.searchsorted(motion.t_ns, told[:, 3].astype(np.int64), side="right") - 1
    place_m = float(np.median((told[:, :2] - jumped_m[then]) @ normal))
    return np.asarray(
        ((motion.position_m[:, :2] - jumped_m) @ normal - place_m) * np.sign(np.nan_to_num(right) @ normal)
    )


def _mean_axis_rad(headings_rad: Floats) -> float:
    """The mean of headings whose opposite means the same."""
    return float(0.5 * np.arctan2(np.sin(2 * headings_rad).mean(), np.cos(2 * headings_rad).mean()))


def _true_off_m(known: Knowledge, motion: Motion) -> Floats | None:
    """The vehicle's true distance from the true line, right of it as flown positive; None where nobody knows it."""
    if known.axis_ne_m is None or not len(motion.t_ns):
        return None
    ne_m = np.stack([np.interp(motion.t_ns, known.truth_ns, known.truth_ne_m[:, k]) for k in (0, 1)], axis=1)
    distance_m, direction_rad = nearest_on_axis(ne_m, known.axis_ne_m)
    return np.where(np.cos(direction_rad - motion.yaw_rad) < 0.0, -distance_m, distance_m)
