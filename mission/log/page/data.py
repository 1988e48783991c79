"""A flight as the page's script wants it: plain lists, times in seconds from the first task, degrees for people."""

from datetime import UTC, datetime
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drivers.clock import NS_PER_S
from mission.log.blame.signals import Motion, motion_of
from mission.log.circumstances import flown_with
from mission.log.flight_report import FlightReport, to_json
from mission.log.page.curves import flight_curves, listed
from mission.log.page.thinning import evenly
from mission.log.reader import Flight
from mission.log.task_spans import flight_start_ns
from mission.log.wording import counted
from mission.records import LineFix

Floats = NDArray[np.float64]

_TRACK_POINTS = 2_500
_FIX_POINTS = 900
_BINS = 40
_NO_TIME_MS = 0.01


def page_data(flight: Flight, report: FlightReport) -> dict[str, Any]:
    """Everything that the page shows, but for frames and ground."""
    start_ns = flight_start_ns(flight)
    motion = motion_of(flight)
    begun = datetime.fromtimestamp((flight.mission.start_ns + flight.mission.unix_minus_flight_ns) / NS_PER_S, UTC)
    return {
        "name": flight.mission.name,
        "log": flight.path.name,
        "begun": begun.strftime("%Y-%m-%d %H:%M UTC"),
        "headline": report.headline,
        "times_since": report.times_since,
        "report": to_json(report),
        "track": _track(flight, motion, start_ns),
        "truth": _truth(flight, start_ns),
        "line": _line(flight),
        "fixes": _fixes(flight, start_ns),
        "imported": _imported(flight),
        "curves": flight_curves(flight, motion, start_ns),
        "histograms": _histograms(flight),
        "texts": _texts(flight, start_ns),
        "facts": _facts(flight),
        "mission_text": flight.mission.text,
    }


def _s(t_ns: int, start_ns: int) -> float:
    return round((t_ns - start_ns) / NS_PER_S, 3)


def _track(flight: Flight, motion: Motion, start_ns: int) -> dict[str, Any]:
    kept = evenly(len(motion.t_ns), _TRACK_POINTS)
    position_m, setpoint_m = motion.position_m[kept], motion.setpoint_m[kept]
    return {
        "t": listed((motion.t_ns[kept] - start_ns) / NS_PER_S),
        "north": listed(position_m[:, 0]),
        "east": listed(position_m[:, 1]),
        "up": listed(-position_m[:, 2]),
        "yaw_deg": listed(np.degrees(motion.yaw_rad[kept]), 1),
        "setpoint_north": listed(setpoint_m[:, 0]),
        "setpoint_east": listed(setpoint_m[:, 1]),
        "setpoint_up": listed(-setpoint_m[:, 2]),
        "mode": [str(state.mode) for state in _states_at(flight, motion, kept)],
    }


def _states_at(flight: Flight, motion: Motion, kept: NDArray[np.intp]) -> list[Any]:
    states = {state.t_ns: state for state in flight.states}
    return [states[t_ns] for t_ns in motion.t_ns[kept].tolist()]


def _truth(flight: Flight, start_ns: int) -> dict[str, Any] | None:
    if not flight.truth:
        return None
    poses = [flight.truth[k] for k in evenly(len(flight.truth), _TRACK_POINTS).tolist()]
    return {
        "t": [_s(pose.t_ns, start_ns) for pose in poses],
        "north": [round(pose.north_m, 3) for pose in poses],
        "east": [round(pose.east_m, 3) for pose in poses],
        "up": [round(-pose.down_m, 3) for pose in poses],
    }


def _line(flight: Flight) -> dict[str, Any] | None:
    if flight.line is None:
        return None
    return {
        "axis": [list(point) for point in flight.line.axis_ne_m],
        "conductors": [
            [[round(value, 2) for value in conductor[k]] for k in evenly(len(conductor), 120).tolist()]
            for conductor in flight.line.conductors_ned_m
        ],
        "supports": [[round(value, 2) for value in support] for support in flight.line.supports_ned_m],
    }


def _imported(flight: Flight) -> dict[str, Any] | None:
    """The way flown by the autopilot's own log."""
    if flight.imported is None:
        return None
    states = [flight.imported.states[k] for k in evenly(len(flight.imported.states), _TRACK_POINTS).tolist()]
    return {
        "north": [round(state.north_m, 3) for state in states],
        "east": [round(state.east_m, 3) for state in states],
    }


def _texts(flight: Flight, start_ns: int) -> list[tuple[float, str]]:
    """What the autopilot said to us, and to its own log."""
    own = () if flight.imported is None else flight.imported.texts
    said = [(_s(text.t_ns, start_ns), text.text) for text in flight.status_texts]
    said += [(_s(text.t_ns, start_ns), text.text) for text in own]
    return sorted(dict.fromkeys(said))


def _fixes(flight: Flight, start_ns: int) -> dict[str, Any]:
    placed = [fix for fix in flight.fixes if fix.is_placed]
    kept: list[LineFix] = [placed[k] for k in evenly(len(placed), _FIX_POINTS).tolist()]
    return {
        "t": [_s(fix.t_ns, start_ns) for fix in kept],
        "north": [round(fix.north_m, 2) for fix in kept],
        "east": [round(fix.east_m, 2) for fix in kept],
        "depth_m": [None if fix.depth_m is None else round(fix.depth_m, 2) for fix in kept],
    }


# -- distributions, facts --------------------------------------------------------------------------------------------


def _histograms(flight: Flight) -> dict[str, Any]:
    """Counts in equal bins by name: what is punctual, and what is not."""
    frames_ns = np.diff(np.array([report.t_capture_ns for report in flight.reports], dtype=np.int64))
    named = {
        "vision latency": [report.latency_ns / 1e6 for report in flight.reports],
        "time between frames": (frames_ns / 1e6).tolist(),
        "control tick late by": [1e3 * tick.late_s for tick in flight.ticks],
        "telemetry age at the tick": [1e3 * tick.state_age_s for tick in flight.ticks],
        "link, there and back": [sync.round_trip_ns / 1e6 for sync in flight.syncs],
    }
    found = {}
    for name, values in named.items():
        if len(values) >= 2:
            array = np.array(values)
            if array.max() < _NO_TIME_MS:  # nothing is ever late in virtual time: there is nothing to show
                continue
            high = float(np.percentile(array, 99.5)) * 1.05 + 1e-3
            counts, edges = np.histogram(np.clip(array, 0.0, high), bins=_BINS, range=(0.0, high))
            found[name] = {
                "counts": counts.tolist(),
                "edges_ms": np.round(edges, 3).tolist(),
                "p50": round(float(np.percentile(array, 50)), 2),
                "p95": round(float(np.percentile(array, 95)), 2),
                "max": round(float(array.max()), 2),
            }
    return found


def _facts(flight: Flight) -> dict[str, str]:
    """What was flown with, and how the log itself did."""
    facts = flown_with(flight)
    if flight.imported is not None:
        own = flight.imported.log
        facts["the autopilot's own log"] = (
            f"{own.file}, {own.version}; clocks aligned by {own.aligned_by.replace('_', ' ')}, "
            f"correlation {own.correlation:.3f}, {own.position_rms_m:.2f} m rms apart"
        )
    if flight.health:
        last = flight.health[-1]
        dropped = counted(last.n_dropped_images, "image")
        facts["log"] = f"{last.n_bytes / 1e6:.1f} MB, {dropped} dropped, {last.work_s:.1f} s of work"
    return facts
