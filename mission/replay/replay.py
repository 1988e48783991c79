"""Fly a log again: today's vision on its frames, today's guidance on its states, held against what it holds."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from drivers.clock import NS_PER_S
from mission.autopilot import Setpoint
from mission.build import vision_settings
from mission.log.copying import write_copy
from mission.log.errors import LogError
from mission.log.reader import Flight
from mission.log.task_spans import flight_start_ns
from mission.plan import MissionPlan
from mission.replay.differences import Differences, estimate_differences, setpoint_differences
from mission.replay.guidance import ReplayedTick, replay_guidance
from mission.replay.pairing import frame_of, moments_of
from mission.replay.records import ReplayedEstimate, ReplayedSetpoint
from mission.replay.vision import replay_vision
from mission.yaml_document import DocumentError, parse_document
from vision.records import VisionReport


@dataclass(frozen=True, slots=True)
class Replay:
    """What today's program made of a flight's frames and states; `is_by_order` as in mission.replay.pairing.Moments."""

    reports: tuple[VisionReport, ...]
    ticks: tuple[ReplayedTick, ...]
    is_by_order: bool


def replay(flight: Flight, on_frame: Callable[[], None] = lambda: None) -> Replay:
    """Fly a log again. Guidance sees a report of each frame: today's where the log holds the frame, else the flight's.

    Raises LogError where the log does not hold what that takes: frames, its mission and its camera.
    """
    plan, camera = _plan(flight), flight.camera
    if camera is None:
        raise LogError(f"The log {flight.path} does not tell its camera: it cannot be replayed.")
    if not flight.image_times_ns:
        why = " (vision.log_rate_hz was 0)" if flight.damage is None else ""
        raise LogError(f"The log {flight.path} holds no frames{why}: there is nothing to replay.")
    reports = tuple(replay_vision(flight, vision_settings(plan, camera), on_frame))
    today = {frame_of(report): report for report in reports}
    paired = moments_of(flight)
    moments = [
        replace(moment, reports=tuple(today.get(frame_of(report), report) for report in moment.reports))
        for moment in paired.moments
    ]
    return Replay(reports, tuple(replay_guidance(flight, plan, camera, moments)), paired.is_by_order)


def differences(flight: Flight, replayed: Replay) -> Differences:
    """Hold a replay against the reference in the log, where there is one, else against the flight."""
    n_lacking, start_ns = 0, flight_start_ns(flight)
    now = {report.t_capture_ns: report.estimate for report in replayed.reports}
    if flight.reference_estimates:
        then = {estimate.t_ns: estimate.estimate for estimate in flight.reference_estimates}
        setpoints = {s.t_ns: Setpoint(s.north_m, s.east_m, s.down_m, s.yaw_rad) for s in flight.reference_setpoints}
        ticks = [tick for tick in replayed.ticks if tick.t_ns in setpoints]
        pairs = [(tick.replayed, setpoints[tick.t_ns]) for tick in ticks]
        n_lacking = len(setpoints) - len(pairs)
    else:
        then = {report.t_capture_ns: report.estimate for report in flight.reports}
        ticks = list(replayed.ticks)
        pairs = [(tick.replayed, tick.flown) for tick in ticks]
        then = {t_ns: then[t_ns] for t_ns in flight.image_times_ns if t_ns in then}
    return Differences(
        bool(flight.reference_estimates),
        replayed.is_by_order,
        estimate_differences(now, then, start_ns),
        setpoint_differences(pairs, n_lacking, [(tick.t_ns - start_ns) / NS_PER_S for tick in ticks]),
    )


def write_reference(flight: Flight, replayed: Replay, out: Path, tell: Callable[[float], None]) -> None:
    """Write a copy of the log that holds the replay as the reference of later ones.

    Raises CopyError when it exists or cannot be written, LogError when the log cannot be read or has a reference.
    """
    if flight.reference_estimates:
        raise LogError(f"The log {flight.path} holds a reference already; write one from the flight's own log.")
    records: list[tuple[int, object]] = [
        (r.t_capture_ns, ReplayedEstimate(r.t_capture_ns, r.seq, r.estimate, r.track, r.trouble))
        for r in replayed.reports
    ]
    for tick in replayed.ticks:
        s = tick.replayed
        records.append((tick.t_ns, ReplayedSetpoint(tick.t_ns, s.north_m, s.east_m, s.down_m, s.yaw_rad)))
    offset_ns = flight.mission.unix_minus_flight_ns
    timed = sorted(((t_ns + offset_ns, record) for t_ns, record in records), key=lambda one: one[0])
    write_copy(flight.path, out, timed, tell)


def _plan(flight: Flight) -> MissionPlan:
    """The plan that was flown: as the log keeps it filled in, or from the mission's text in older logs."""
    text = flight.attachments.get("plan.json")
    if text is None and not flight.mission.text and flight.damage is not None:
        raise LogError(f"The mission file in the log {flight.path} is damaged; it cannot be replayed.")
    try:
        if text is not None:
            return MissionPlan.model_validate_json(text)
        return MissionPlan.model_validate(parse_document(flight.mission.text).data)
    except (ValueError, DocumentError) as error:
        first = str(error).splitlines()[0]
        raise LogError(f"The mission in the log {flight.path} is not one of this version ({first}).") from error
