"""The curves of a flight's page: values over time, thinned for the eye."""

import bisect
import itertools
import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drivers.clock import NS_PER_S
from mission.log.blame.signals import Lateral, Motion, knowledge_of, lateral_of
from mission.log.measures import nearest_on_axis, true_axis
from mission.log.page.thinning import evenly, extremes
from mission.log.reader import Flight
from mission.log.task_spans import FOLLOW_TASK, task_spans

Floats = NDArray[np.float64]
Seconds = Callable[[Sequence[int]], Floats]

_CURVE_POINTS = 1_600
_NEAR_LINE_M = 6.0
_GAP_S = 1.0


def listed(values: Floats, digits: int = 3) -> list[float | None]:
    """Rounded numbers for JSON, which has no NaN."""
    return [round(value, digits) if math.isfinite(value) else None for value in values.tolist()]


def _curve(t_s: Floats, values: Floats, digits: int = 3) -> dict[str, Any]:
    kept = extremes(values, _CURVE_POINTS)
    return {"t": listed(t_s[kept]), "y": listed(values[kept], digits)}


def flight_curves(flight: Flight, motion: Motion, start_ns: int) -> dict[str, Any]:
    """Each curve by name: times and values; what the log does not hold is absent."""

    def s(times_ns: Sequence[int]) -> Floats:
        return (np.array(times_ns, dtype=np.int64) - start_ns) / NS_PER_S

    t_s = s(motion.t_ns.tolist())
    curves = {
        "height": _curve(t_s, -motion.position_m[:, 2]),
        "height_setpoint": _curve(t_s, -motion.setpoint_m[:, 2]),
        "from_setpoint": _curve(t_s, np.linalg.norm(motion.position_m - motion.setpoint_m, axis=1)),
        "tilt_deg": _curve(t_s, np.degrees(motion.tilt_rad), 1),
        "push": _curve(t_s, np.linalg.norm(motion.push_m_s2, axis=1)),
        "speed": _curve(
            s([state.t_ns for state in flight.states]),
            np.array([math.hypot(state.v_north_m_s, state.v_east_m_s) for state in flight.states]),
        ),
        "battery": _curve(
            s([state.t_ns for state in flight.states]),
            np.array([np.nan if state.battery is None else 100.0 * state.battery for state in flight.states]),
            1,
        ),
        **_lateral_curves(flight, motion, t_s),
        **_vision_curves(flight, s),
    }
    if flight.ticks:
        ticks_s = s([tick.t_ns for tick in flight.ticks])
        curves["tick_late_ms"] = _curve(ticks_s, np.array([1e3 * tick.late_s for tick in flight.ticks]), 1)
        curves["telemetry_age_ms"] = _curve(ticks_s, np.array([1e3 * tick.state_age_s for tick in flight.ticks]), 1)
    if flight.syncs:
        curves["round_trip_ms"] = _curve(
            s([sync.t_ns for sync in flight.syncs]), np.array([sync.round_trip_ns / 1e6 for sync in flight.syncs]), 1
        )
    curves |= _imported_curves(flight, s)
    over = _height_over_line(flight)
    if over is not None:
        times_ns, over_m = over
        curves["height_over_line"] = _curve(s(times_ns), over_m)
    depths = [fix for fix in flight.fixes if fix.depth_m is not None]
    if depths:
        times_s = s([fix.t_ns for fix in depths])
        depths_m = np.array([fix.depth_m for fix in depths], dtype=np.float64)
        gaps = np.flatnonzero(np.diff(times_s) > _GAP_S) + 1  # nothing was known in between
        curves["height_over_line_known"] = _curve(
            np.insert(times_s, gaps, times_s[gaps]), np.insert(depths_m, gaps, np.nan)
        )
    holes_s = s([begin_ns + (end_ns - begin_ns) // 2 for begin_ns, end_ns in flight.holes_ns]).tolist()
    for curve in curves.values():
        _break(curve, holes_s)
    return {name: curve for name, curve in curves.items() if any(value is not None for value in curve["y"])}


def _break(curve: dict[str, Any], holes_s: list[float]) -> None:
    """Draw nothing across what a damaged log lacks: nobody knows what was there."""
    for hole_s in holes_s:
        at = bisect.bisect(curve["t"], hole_s)
        curve["t"].insert(at, round(hole_s, 3))
        curve["y"].insert(at, None)


def _lateral_curves(flight: Flight, motion: Motion, t_s: Floats) -> dict[str, Any]:
    """The way off the line and its parts, in the tasks that follow it."""
    lateral = lateral_of(knowledge_of(flight), motion)
    is_following = np.zeros(len(motion.t_ns), dtype=np.bool_)
    for span in task_spans(flight):
        if span.task == FOLLOW_TASK:
            end_ns = flight.end_ns if span.end_ns is None else span.end_ns
            is_following |= (motion.t_ns >= span.start_ns) & (motion.t_ns <= end_ns)

    def part(values: Floats) -> dict[str, Any]:
        return _curve(t_s, np.where(is_following, values, np.nan))

    named = {"off_line": lateral.off_m, "executive": lateral.executive_m, "tracking": lateral.tracking_m}
    if lateral.is_true:
        named |= {"perception": lateral.perception_m}
    return {name: part(values) for name, values in named.items()} if _has_any(lateral) else {}


def _has_any(lateral: Lateral) -> bool:
    return bool(np.isfinite(lateral.off_m).any())


def _vision_curves(flight: Flight, s: Seconds) -> dict[str, Any]:
    estimates = [report.estimate for report in flight.reports]
    curves = {
        "latency_ms": _curve(
            s([report.t_capture_ns for report in flight.reports]),
            np.array([report.latency_ns / 1e6 for report in flight.reports]),
            1,
        )
    }
    if any(estimate is not None for estimate in estimates):
        times_s = s([report.t_capture_ns for report in flight.reports])
        angles_rad = _numbers([None if estimate is None else estimate.angle_rad for estimate in estimates])
        curves["angle_deg"] = _curve(times_s, np.degrees(angles_rad), 2)
        offsets_px = _numbers([None if estimate is None else estimate.offset_px for estimate in estimates])
        curves["offset_px"] = _curve(times_s, offsets_px, 1)
    return curves


def _imported_curves(flight: Flight, s: Seconds) -> dict[str, Any]:
    """What the autopilot's own log adds: its height, its battery, and what each motor was told."""
    own = flight.imported
    if own is None:
        return {}
    power_s = s([power.t_ns for power in own.power])
    curves = {
        "imported_height": _curve(
            s([state.t_ns for state in own.states]), np.array([-state.down_m for state in own.states])
        ),
        "imported_voltage": _curve(power_s, _numbers([power.voltage_v for power in own.power]), 2),
        "imported_current": _curve(power_s, _numbers([power.current_a for power in own.power]), 2),
    }
    told_s = s([actuators.t_ns for actuators in own.actuators])
    for k in range(max((len(actuators.motors) for actuators in own.actuators), default=0)):
        values = [actuators.motors[k] if k < len(actuators.motors) else None for actuators in own.actuators]
        curves[f"motor_{k + 1}"] = _curve(told_s, _numbers(values))
    return curves


def _numbers(values: Sequence[float | None]) -> Floats:
    """NaN for what is not known."""
    return np.array([np.nan if value is None else value for value in values], dtype=np.float64)


def _height_over_line(flight: Flight) -> tuple[list[int], Floats] | None:
    """Times [ns] and the true height over the highest conductor nearby, NaN away from the line; None: unknown."""
    if flight.line is None or not flight.truth or not flight.line.conductors_ned_m:
        return None
    poses = [flight.truth[k] for k in evenly(len(flight.truth), _CURVE_POINTS).tolist()]
    ne_m = np.array([(pose.north_m, pose.east_m) for pose in poses])
    up_m = np.array([-pose.down_m for pose in poses])
    aside_m, _ = nearest_on_axis(ne_m, true_axis(flight.line))
    points = np.concatenate([_dense(np.array(conductor)) for conductor in flight.line.conductors_ned_m])
    over_m = np.full(len(ne_m), np.nan)
    for k in np.flatnonzero(np.abs(aside_m) < _NEAR_LINE_M).tolist():
        near = ((points[:, :2] - ne_m[k]) ** 2).sum(axis=1) < _NEAR_LINE_M**2
        if near.any():
            over_m[k] = up_m[k] + points[near, 2].min()
    return [pose.t_ns for pose in poses], over_m


def _dense(polyline: Floats) -> Floats:
    """A polyline (m, 3) with a point at least every 3 m."""
    pieces = []
    for start, end in itertools.pairwise(polyline):
        n = max(2, math.ceil(float(np.linalg.norm(end - start)) / 3.0) + 1)
        pieces.append(start + np.linspace(0.0, 1.0, n)[:, None] * (end - start))
    return np.concatenate(pieces) if pieces else polyline
