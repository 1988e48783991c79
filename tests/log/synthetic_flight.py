"""A made-up flight along a straight power line, record by record, for the log's tests."""

import math
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from drivers.camera.camera import Intrinsics
from drivers.clock import NS_PER_S
from mission.autopilot import FlightMode, LandedState, Setpoint, VehicleState
from mission.log.recorder import Recorder
from mission.records import (
    Attachment,
    AutopilotTarget,
    ClockSync,
    ControlTick,
    Event,
    FlightStart,
    LineFix,
    MissionEnded,
    Origin,
    Result,
    Severity,
    TaskEnded,
    TaskStarted,
    TrueLine,
    TruePose,
)
from vision.records import LineEstimate, Track, VisionReport, wrap_line_angle_rad

START_NS = 5_000 * NS_PER_S
TICK_NS = NS_PER_S // 20
MISSION_TEXT = "version: 1\nname: follow_line\ntasks:\n  - {task: takeoff, altitude_m: 5}\n"
LINE_NORTH_M = 12.0
SWAY_M = 0.3
HEIGHT_PX, WIDTH_PX, FOCAL_PX = 480, 640, 500.0

# Task, does it send setpoints, end pose (north, east, down, yaw in degrees), duration [s].
TASKS = (
    ("takeoff", False, (0.0, 0.0, -5.0, 0.0), 6.0),
    ("ascend", True, (0.0, 0.0, -16.0, 0.0), 8.0),
    ("move_until", True, (LINE_NORTH_M, 0.0, -16.0, 0.0), 10.0),
    ("align", True, (LINE_NORTH_M, 0.0, -16.0, 90.0), 6.0),
    ("follow_lines", True, (LINE_NORTH_M, 30.0, -16.0, 90.0), 20.0),
    ("rotate", True, (LINE_NORTH_M, 30.0, -16.0, 270.0), 8.0),
    ("follow_lines", True, (LINE_NORTH_M, 0.0, -16.0, 270.0), 20.0),
    ("rotate", True, (LINE_NORTH_M, 0.0, -16.0, 180.0), 5.0),
    ("move_forward", True, (0.2, 0.1, -16.0, 180.0), 10.0),
    ("descend", True, (0.2, 0.1, -4.0, 180.0), 8.0),
    ("land", False, (0.2, 0.1, 0.0, 180.0), 6.0),
)

CAMERA = Intrinsics(WIDTH_PX, HEIGHT_PX, FOCAL_PX, FOCAL_PX, 319.5, 239.5)
START = FlightStart(START_NS, 0.0, 0.0, 0.0, 0.0, 0.0, None)
ORIGIN = Origin(START_NS, math.radians(47.4), math.radians(8.5), 488.0)
PARAMETERS = Attachment("parameters.json", "application/json", b'{"MPC_XY_P": 0.95}')
LINE = TrueLine(
    axis_ne_m=((LINE_NORTH_M, -20.0), (LINE_NORTH_M, 50.0)),
    conductors_ned_m=tuple(
        tuple((LINE_NORTH_M + aside_m, east_m, -9.0) for east_m in np.linspace(-20.0, 50.0, 15).tolist())
        for aside_m in (-1.0, 0.0, 1.0)
    ),
    supports_ned_m=tuple((LINE_NORTH_M, east_m, -10.0) for east_m in (-20.0, 15.0, 50.0)),
)


def fly(*, image_period_s: float = 4.0) -> Iterator[tuple[int, object]]:
    """Yield every record of the flight with its time; setpoints as Setpoint."""
    t_ns = START_NS
    pose = np.zeros(4)
    seq = 0
    yield t_ns, LINE
    yield t_ns, CAMERA
    yield t_ns, PARAMETERS
    yield t_ns, ORIGIN
    yield t_ns, START
    for index, (task, is_offboard, goal, duration_s) in enumerate(TASKS):
        yield t_ns, TaskStarted(t_ns, index, task)
        first, goal_pose = pose, np.array([*goal[:3], math.radians(goal[3])])
        n_ticks = round(duration_s * NS_PER_S / TICK_NS)
        for tick in range(n_ticks):
            share = (1 - math.cos(math.pi * tick / n_ticks)) / 2
            pose = first + (goal_pose - first) * share
            sway_m = SWAY_M * math.sin(2 * math.pi * tick * TICK_NS / NS_PER_S / 5) if task == "follow_lines" else 0.0
            north_m, east_m, down_m, yaw_rad = (pose + np.array([sway_m, 0.0, 0.0, 0.0])).tolist()
            yaw_rad = math.remainder(yaw_rad, math.tau)
            yield t_ns, TruePose(t_ns, north_m, east_m, down_m, yaw_rad)
            yield (
                t_ns,
                VehicleState(
                    t_ns=t_ns,
                    north_m=north_m,
                    east_m=east_m,
                    down_m=down_m,
                    v_north_m_s=0.0,
                    v_east_m_s=0.0,
                    v_down_m_s=0.0,
                    roll_rad=0.01,
                    pitch_rad=-0.02,
                    yaw_rad=yaw_rad,
                    mode=FlightMode.OFFBOARD if is_offboard else FlightMode.LAND,
                    is_armed=True,
                    landed=LandedState.IN_AIR,
                    battery=0.8,
                    is_connected=True,
                ),
            )
            yield t_ns, ControlTick(t_ns, TICK_NS / NS_PER_S, 0.001, 0.01)
            if is_offboard:
                yield t_ns + 1_000_000, Setpoint(north_m, east_m, down_m, yaw_rad)
                yield t_ns, AutopilotTarget(t_ns, north_m, east_m, down_m, yaw_rad)
            if tick % 20 == 0:
                yield t_ns, ClockSync(t_ns, -START_NS, 4_000_000)
            has_image = tick % round(image_period_s * NS_PER_S / TICK_NS) == round(image_period_s * 5)
            yield t_ns, see(seq, t_ns, (north_m, east_m, down_m, yaw_rad), has_image=has_image)
            if seq % 2:
                yield (
                    t_ns,
                    LineFix(t_ns, math.pi / 2, LINE_NORTH_M, east_m, True, 3, 6.0 if seq % 4 == 1 else None, None),
                )
            seq += 1
            t_ns += TICK_NS
        pose = goal_pose
        if task == "move_until":
            yield t_ns, Event(t_ns, "line_found", Severity.INFO, "A power line lies ahead.")
        yield t_ns, TaskEnded(t_ns, index, task, Result.COMPLETED, f"{task} reached its goal.")
    north_m, east_m, down_m, yaw_rad = pose.tolist()
    yield (
        t_ns,
        VehicleState(
            t_ns=t_ns,
            north_m=north_m,
            east_m=east_m,
            down_m=down_m,
            v_north_m_s=0.0,
            v_east_m_s=0.0,
            v_down_m_s=0.0,
            roll_rad=0.0,
            pitch_rad=0.0,
            yaw_rad=yaw_rad,
            mode=FlightMode.HOLD,
            is_armed=False,
            landed=LandedState.ON_GROUND,
            battery=0.79,
            is_connected=True,
        ),
    )
    yield t_ns, MissionEnded(t_ns, Result.COMPLETED, "Every task was flown and the vehicle stands disarmed.")


def see(seq: int, t_ns: int, pose: tuple[float, float, float, float], *, has_image: bool) -> VisionReport:
    """What a camera that looks straight down would show of the line, and report."""
    north_m, _, down_m, yaw_rad = pose
    px_per_m = FOCAL_PX / max(-down_m - 9.0, 0.5)
    # The line runs east; `ahead` is how far north of the vehicle it lies.
    ahead_m = LINE_NORTH_M - north_m
    angle_rad = wrap_line_angle_rad(math.pi / 2 - yaw_rad)
    along = np.array([math.sin(angle_rad), -math.cos(angle_rad)])
    foot = np.array([-math.sin(yaw_rad), -math.cos(yaw_rad)]) * ahead_m * px_per_m
    normal = np.array([math.cos(angle_rad), math.sin(angle_rad)])
    offset_px = float(foot @ normal)
    centre = np.array([(WIDTH_PX - 1) / 2, (HEIGHT_PX - 1) / 2])
    lines = []
    for aside_px in (-px_per_m, 0.0, px_per_m):
        middle = centre + normal * (offset_px + aside_px)
        ends = middle - along * 900.0, middle + along * 900.0
        is_seen, first, last = cv2.clipLine((0, 0, WIDTH_PX, HEIGHT_PX), *(tuple(map(round, end)) for end in ends))
        if is_seen:
            lines.append([*first, *last])
    is_present = bool(lines) and down_m < -12.0
    segments = np.array(lines if is_present else [], dtype=np.float64).reshape(-1, 4)
    segments.setflags(write=False)
    estimate = LineEstimate(angle_rad, offset_px, len(segments), px_per_m, 0.9, t_ns) if is_present else None
    track = Track.TRACKING if is_present else Track.LOST
    jpeg = draw_ground(seq, lines) if has_image else None
    latency_ns = 30_000_000 + seq % 7 * 1_000_000
    return VisionReport(seq, t_ns, estimate, track, None, segments, latency_ns, 12_000_000, 0, jpeg)


def draw_ground(seed: int, lines: list[list[int]]) -> bytes:
    """A meadow with conductors over it, as JPEG."""
    rng = np.random.default_rng(seed)
    coarse = rng.normal(0, 1, (HEIGHT_PX // 16, WIDTH_PX // 16)).astype(np.float32)
    texture = cv2.resize(coarse, (WIDTH_PX, HEIGHT_PX), interpolation=cv2.INTER_CUBIC)[..., None] * 14
    grain = rng.normal(0, 5, (HEIGHT_PX, WIDTH_PX, 1))
    image = np.clip(np.array([62.0, 108.0, 92.0]) + texture + grain, 0, 255).astype(np.uint8)
    for x1, y1, x2, y2 in lines:
        cv2.line(image, (x1, y1), (x2, y2), (205, 205, 205), 2, cv2.LINE_AA)
    return cv2.imencode(".jpg", image)[1].tobytes()


class FixedClock:
    """A clock that stands at the flight's start."""

    def now_ns(self) -> int:
        return START_NS

    def wall_s(self, flight_s: float) -> float:
        return flight_s


def put_down(recorder: Recorder, t_ns: int, item: object) -> None:
    """Hand one of the flight's records to a recorder."""
    if isinstance(item, Setpoint):
        recorder.record_setpoint(t_ns, item)
    else:
        recorder.record(item)


def write_log(path: Path, records: list[tuple[int, object]]) -> Recorder:
    """Write records to a new log; returns the closed recorder."""
    with Recorder(
        path, mission_text=MISSION_TEXT, mission_name="follow_line", metadata={"vehicle": "none"}, clock=FixedClock()
    ) as recorder:
        for t_ns, item in records:
            put_down(recorder, t_ns, item)
    return recorder
