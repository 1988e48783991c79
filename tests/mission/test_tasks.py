"""Tasks flown by hand: a vehicle that is where its setpoint is, and sights made up for the purpose."""

import math
from dataclasses import replace

import pytest

from mission.autopilot import FlightMode, LandedState, Setpoint, VehicleState
from mission.build import build_task, guidance_settings
from mission.guidance import GuidanceSettings, WorldLine
from mission.known_line import Found
from mission.plan import Align, Ascend, FollowLines, GuidancePlan, Land, MoveForward, MoveUntil, Rotate, Takeoff
from mission.tasks.task import Command, FlightMemory, Observation, Sight, Step, Task

GUIDANCE = guidance_settings(GuidancePlan())
START = Setpoint(0.0, 0.0, 0.0, 0.0)
UP = Setpoint(0.0, 0.0, -16.0, 0.0)


def state_at(setpoint: Setpoint, **changes: object) -> VehicleState:
    """A vehicle that stands where the setpoint is."""
    state = VehicleState(
        0, setpoint.north_m, setpoint.east_m, setpoint.down_m, 0.0, 0.0, 0.0, 0.0, 0.0, setpoint.yaw_rad,
        FlightMode.OFFBOARD, True, LandedState.IN_AIR, 0.9, is_connected=True,
    )  # fmt: skip
    return replace(state, **changes)  # type: ignore[arg-type]


def sight(
    line: WorldLine | None,
    yaw_rad: float = 0.0,
    *,
    at: Setpoint = UP,
    is_placed: bool = True,
    next_line: WorldLine | None = None,
    depth_m: float | None = 6.0,
    height_m: float | None = None,
) -> Sight:
    found = None if line is None else Found(line, 3, is_placed, next_line, depth_m, height_m)
    return Sight(0, yaw_rad, at.north_m, at.east_m, at.down_m, found)


def fly_perfectly(
    task: Task, reference: Setpoint, line: WorldLine | None, rate_hz: float = 20.0, limit_s: float = 200.0
) -> tuple[Step, Setpoint, float]:
    """Step a task with a vehicle that follows at once; the last step, the last setpoint, and the time it took [s]."""
    dt_s = 1.0 / rate_hz
    for tick in range(round(limit_s * rate_hz)):
        step = task.step(
            reference, Observation(dt_s, state_at(reference), sight(line, reference.yaw_rad, at=reference))
        )
        reference = step.setpoint or reference
        if step.done or step.failed:
            return step, reference, tick * dt_s
    raise AssertionError("the task never ended")


def memory(theta_0_rad: float = 0.0) -> FlightMemory:
    return FlightMemory(START, theta_0_rad)


@pytest.mark.parametrize("rate_hz", [10.0, 20.0, 50.0])
def test_the_control_rate_changes_no_flight(rate_hz: float) -> None:
    line = WorldLine(math.radians(8), 0.0, 1.0)
    task = build_task(FollowLines(task="follow_lines", distance_m=20.0), GUIDANCE, memory())
    step, end, took_s = fly_perfectly(task, UP, line, rate_hz)
    assert step.done
    assert took_s == pytest.approx(20.0 / GUIDANCE.r_m_s, abs=0.3)
    assert end.yaw_rad == pytest.approx(math.radians(8), abs=math.radians(0.2))
    assert line.offset_m(end.north_m, end.east_m, end.yaw_rad) == pytest.approx(0.0, abs=0.08)


def test_the_thesis_law_turns_but_does_not_go_sideways() -> None:
    thesis = replace(GUIDANCE, is_centred=False)
    task = build_task(FollowLines(task="follow_lines", distance_m=20.0), thesis, memory())
    _, end, _ = fly_perfectly(task, UP, WorldLine(0.0, 0.0, 3.0))
    assert (end.north_m, end.east_m) == (pytest.approx(20.0), pytest.approx(0.0))


def test_following_does_not_go_ahead_without_a_line() -> None:
    task = build_task(FollowLines(task="follow_lines", distance_m=20.0), GUIDANCE, memory())
    reference = UP
    for _ in range(200):
        reference = task.step(reference, Observation(0.05, state_at(reference), sight(None))).setpoint or reference
    assert reference.north_m <= GUIDANCE.r_m_s * GUIDANCE.max_estimate_age_s + 1e-9


def test_following_takes_the_place_of_a_placed_line_only() -> None:
    task = build_task(FollowLines(task="follow_lines", distance_m=20.0), GUIDANCE, memory())
    partial = sight(WorldLine(0.0, 0.0, 5.0), is_placed=False)
    step = task.step(UP, Observation(0.05, state_at(UP), partial))
    assert step.setpoint is not None
    assert step.setpoint.east_m == 0.0


@pytest.mark.parametrize(
    ("turn", "line_deg", "expected_deg"),
    [
        ("nearest", 70.0, 70.0),
        ("nearest", 110.0, -70.0),
        ("right", 110.0, 110.0),
        ("right", 91.0, 91.0),
        ("right", 89.0, 89.0),
        ("left", 89.0, -91.0),
        ("left", 110.0, -70.0),
        ("right", -5.0, -5.0),
        ("left", 5.0, 5.0),
    ],
)
def test_align_turns_the_wanted_way(turn: str, line_deg: float, expected_deg: float) -> None:
    plan = Align.model_validate({"task": "align", "turn": turn})
    line = WorldLine(math.radians(line_deg), 0.0, 0.0)
    step, end, _ = fly_perfectly(build_task(plan, GUIDANCE, memory()), UP, line)
    assert step.done
    assert math.degrees(end.yaw_rad) == pytest.approx(expected_deg, abs=GUIDANCE.epsilon_rad * 60)


def test_align_needs_n_frames_in_a_row_within_epsilon() -> None:
    task = build_task(Align(task="align", n_detections=4), GUIDANCE, memory())
    good, bad = sight(WorldLine(0.0, 0.0, 0.0)), sight(WorldLine(math.radians(10), 0.0, 0.0))
    seen = [good, good, good, bad, good, good, good, good]
    done = [task.step(UP, Observation(0.05, state_at(UP), one)).done for one in seen]
    assert done[:7] == [None] * 7
    assert done[7]


def move_until_steps(until: str, lines: list[WorldLine | None]) -> tuple[Setpoint, Step]:
    plan = MoveUntil.model_validate({"task": "move_until", "until": until, "max_distance_m": 30.0})
    task, reference, step = build_task(plan, GUIDANCE, memory()), UP, Step()
    for line in lines:
        step = task.step(reference, Observation(0.05, state_at(reference), sight(line)))
        reference = step.setpoint or reference
    return reference, step


def test_move_until_counts_detections_in_a_row() -> None:
    line = WorldLine(math.pi / 2, 9.0, 0.0)
    _, step = move_until_steps("detected", [line, line, line, None, line, line, line])
    assert step.done is None
    _, step = move_until_steps("detected", [line, line, line, None, line, line, line, line])
    assert step.done


def test_move_until_goes_on_until_the_line_is_below_and_remembers_the_way_from_the_start() -> None:
    kept = FlightMemory(Setpoint(-1.0, 0.0, 0.0, 0.0), 0.0)
    task = build_task(MoveUntil(task="move_until"), GUIDANCE, kept)
    step, end, _ = fly_perfectly(task, UP, WorldLine(math.pi / 2, 9.0, 0.0))
    assert step.done
    assert end.north_m == pytest.approx(9.0, abs=0.15)
    assert kept.move_until_m == pytest.approx(10.0, abs=0.15)


def test_move_until_goes_on_over_what_may_lie_on_the_ground() -> None:
    """Until the way flown has told how far below the line is; then it stops over it, or goes back to it."""
    task = build_task(MoveUntil(task="move_until", max_distance_m=30.0), GUIDANCE, memory())
    line, reference = WorldLine(math.pi / 2, 9.0, 0.0), UP
    norths_m, step = [], Step()
    for tick in range(800):
        seen = sight(line, at=reference, depth_m=None if tick < 300 else 6.0)
        step = task.step(reference, Observation(0.05, state_at(reference), seen))
        reference = step.setpoint or reference
        norths_m.append(reference.north_m)
        if step.done:
            break
    assert max(norths_m) > 15.0
    assert step.done
    assert norths_m[-1] == pytest.approx(9.0, abs=0.15)


def test_move_until_goes_on_where_the_line_is_not_seen_where_it_was_to_be() -> None:
    """Something like a line 6 m ahead that is gone when the vehicle comes there, and a line 15 m ahead."""
    kept = memory()
    task = build_task(MoveUntil(task="move_until", max_distance_m=30.0), GUIDANCE, kept)
    reference, step = UP, Step()
    for _ in range(800):
        north_m = reference.north_m
        line = WorldLine(math.pi / 2, 6.0 if north_m < 4.0 else 15.0, 0.0) if not 4.0 <= north_m < 11.0 else None
        step = task.step(reference, Observation(0.05, state_at(reference), sight(line, at=reference)))
        reference = step.setpoint or reference
        if step.done:
            break
    assert step.done
    assert reference.north_m == pytest.approx(15.0, abs=0.15)


def test_move_until_does_not_go_back_behind_its_start() -> None:
    task = build_task(MoveUntil(task="move_until", max_distance_m=30.0), GUIDANCE, memory())
    step, end, _ = fly_perfectly(task, UP, WorldLine(math.pi / 2, -15.0, 0.0))
    assert step.failed
    assert end.north_m == pytest.approx(30.0)


def test_move_until_waits_while_nothing_is_seen() -> None:
    """Without frames the line could pass below unseen."""
    task = build_task(MoveUntil(task="move_until", max_distance_m=30.0), GUIDANCE, memory())
    reference = UP
    norths_m = []
    for tick in range(120):
        seen = None if 40 <= tick < 100 else sight(None)
        reference = task.step(reference, Observation(0.05, state_at(reference), seen)).setpoint or reference
        norths_m.append(reference.north_m)
    blind_m = GUIDANCE.r_m_s * (GUIDANCE.max_estimate_age_s + 0.05)
    assert norths_m[99] - norths_m[39] <= blind_m + 1e-6
    assert norths_m[119] - norths_m[99] == pytest.approx(20 * 0.05 * GUIDANCE.r_m_s)


def test_move_until_gives_up_at_its_limit() -> None:
    task = build_task(MoveUntil(task="move_until", max_distance_m=10.0), GUIDANCE, memory())
    step, end, _ = fly_perfectly(task, UP, None)
    assert step.failed == "no line within 10 m"
    assert end.north_m == pytest.approx(10.0)


@pytest.mark.parametrize("angle_deg", [180.0, -180.0, -90.0, 360.0, 10.0])
def test_rotate_turns_the_way_its_sign_says(angle_deg: float) -> None:
    task = build_task(Rotate(task="rotate", angle_deg=angle_deg), GUIDANCE, memory())
    first = task.step(UP, Observation(0.05, state_at(UP), None)).setpoint
    assert first is not None
    assert math.copysign(1.0, first.yaw_rad) == math.copysign(1.0, angle_deg)
    task = build_task(Rotate(task="rotate", angle_deg=angle_deg), GUIDANCE, memory())
    step, end, took_s = fly_perfectly(task, UP, None)
    assert step.done
    assert math.cos(end.yaw_rad - math.radians(angle_deg)) == pytest.approx(1.0)
    assert took_s == pytest.approx(abs(angle_deg) / 45.0, abs=0.11)


def test_move_forward_goes_as_far_as_move_until_went() -> None:
    kept = memory()
    kept.move_until_m = 7.5
    task = build_task(MoveForward(task="move_forward", distance_m="as_move_until"), GUIDANCE, kept)
    _, end, _ = fly_perfectly(task, replace(UP, yaw_rad=math.pi / 2), None)
    assert (end.north_m, end.east_m) == (pytest.approx(0.0, abs=1e-9), pytest.approx(7.5))


def test_move_forward_fails_where_move_until_took_no_distance() -> None:
    task = build_task(MoveForward(task="move_forward", distance_m="as_move_until"), GUIDANCE, memory())
    assert task.step(UP, Observation(0.05, state_at(UP), None)).failed


def test_a_passing_vehicle_has_not_arrived() -> None:
    task = build_task(Ascend(task="ascend", altitude_m=16.0), GUIDANCE, memory())
    moving = state_at(UP, v_north_m_s=2.0)
    assert task.step(UP, Observation(0.05, moving, None)).done is None
    assert task.step(UP, Observation(0.05, state_at(UP), None)).done


def test_takeoff_commands_once_waits_for_the_autopilot_and_goes_over_the_start() -> None:
    task = build_task(Takeoff(task="takeoff", altitude_m=5.0), GUIDANCE, memory())
    ground = state_at(START, mode=FlightMode.HOLD, is_armed=False, landed=LandedState.ON_GROUND)
    climbing = state_at(Setpoint(0.8, 0.0, -3.0, 0.0), mode=FlightMode.TAKEOFF, landed=LandedState.TAKING_OFF)
    up = state_at(Setpoint(0.8, 0.0, -4.6, 0.0), mode=FlightMode.HOLD)
    assert task.step(START, Observation(0.05, ground, None)).command is Command.ARM
    second = task.step(START, Observation(0.05, ground, None))
    assert (second.command, second.altitude_m) == (Command.TAKEOFF, 5.0)
    for state in (ground, climbing):
        assert task.step(START, Observation(0.05, state, None)) == Step()
    beside = Setpoint(0.8, 0.0, -4.6, 0.0)
    begun = task.step(beside, Observation(0.05, up, None))
    assert begun.setpoint is not None
    assert 0.7 < begun.setpoint.north_m < 0.8
    step, end, _ = fly_perfectly(task, beside, None)
    assert step.done
    assert (end.north_m, end.down_m) == (0.0, -5.0)


def test_takeoff_explains_hold_only_near_its_height() -> None:
    task = build_task(Takeoff(task="takeoff", altitude_m=5.0), GUIDANCE, memory())
    for _ in range(2):
        task.step(START, Observation(0.05, state_at(START), None))
    explained = []
    for height_m in (3.7, 3.9):
        climbing = state_at(Setpoint(0.0, 0.0, -height_m, 0.0), mode=FlightMode.TAKEOFF)
        explained.append(task.step(START, Observation(0.05, climbing, None)).next_mode)
    assert explained == [None, FlightMode.HOLD]


def test_land_is_done_when_disarmed_on_the_ground_and_telemetry_has_had_time() -> None:
    task = build_task(Land(task="land"), GUIDANCE, memory())
    down = state_at(START, is_armed=False, landed=LandedState.ON_GROUND)
    assert task.step(START, Observation(0.05, down, None)).command is Command.LAND
    assert task.step(START, Observation(1.0, down, None)) == Step()  # what it said before the command
    landing = state_at(START, mode=FlightMode.LAND, landed=LandedState.LANDING)
    assert task.step(START, Observation(3.0, landing, None)) == Step()
    assert task.step(START, Observation(0.05, down, None)).done


def test_guidance_settings_keep_the_thesis_names() -> None:
    settings: GuidanceSettings = guidance_settings(
        GuidancePlan(r_m_s=1.5, P_per_s=0.5, epsilon_deg=4.0, theta_0_deg=90.0)
    )
    assert (settings.r_m_s, settings.P_per_s) == (1.5, 0.5)
    assert settings.epsilon_rad == pytest.approx(math.radians(4.0))
    assert settings.theta_0_rad == pytest.approx(math.pi / 2)


def test_land_is_commanded_again_when_the_autopilot_is_not_on_that_way() -> None:
    task = build_task(Land(task="land"), GUIDANCE, memory())
    hovering = state_at(UP, mode=FlightMode.HOLD)
    commands = [task.step(UP, Observation(1.0, hovering, None)).command for _ in range(7)]
    assert commands == [Command.LAND, None, None, Command.LAND, None, None, Command.LAND]


def test_following_holds_the_height_over_the_conductors_but_never_sinks_below_where_it_began() -> None:
    guidance = guidance_settings(GuidancePlan(conductor_spacing_m=0.8, height_over_line_m=6.0))
    task = build_task(FollowLines(task="follow_lines", distance_m=100.0), guidance, memory())
    reference, line_down_m = UP, UP.down_m + 6.0
    heights_m = []
    for tick in range(600):
        line_m = line_down_m - (3.0 if 150 < tick < 400 else -3.0 if tick >= 400 else 0.0)
        seen = sight(WorldLine(0.0, 0.0, 0.0), at=reference, height_m=line_m - reference.down_m)
        reference = task.step(reference, Observation(0.05, state_at(reference), seen)).setpoint or reference
        heights_m.append(-reference.down_m)
    assert heights_m[140] == pytest.approx(16.0, abs=0.1)
    assert heights_m[390] == pytest.approx(19.0, abs=0.1)
    assert heights_m[-1] == pytest.approx(16.0, abs=0.1)
    assert min(heights_m) > 15.99


def test_following_turns_where_the_line_bends_and_not_where_it_is_seen_to() -> None:
    """A bend 5 m ahead of the vehicle, in sight all the while: the setpoint goes on to it, and then along the next."""
    here, beyond = WorldLine(0.0, 0.0, 0.0), WorldLine(math.radians(30.0), 5.0, 0.0)
    task = build_task(FollowLines(task="follow_lines", distance_m=30.0), GUIDANCE, memory())
    reference, track = UP, []
    for _ in range(500):
        spans = (here, beyond) if reference.north_m < 5.0 else (beyond, here)
        seen = sight(spans[0], reference.yaw_rad, at=reference, next_line=spans[1])
        reference = task.step(reference, Observation(0.05, state_at(reference), seen)).setpoint or reference
        track.append(reference)
    before = [place for place in track if place.north_m < 4.5]
    after = [place for place in track if place.north_m > 9.0]
    assert max(abs(place.east_m) for place in before) < 0.05
    assert max(abs(beyond.offset_m(place.north_m, place.east_m, beyond.heading_rad)) for place in after) < 0.1
    assert (
        max(
            abs(beyond.offset_m(place.north_m, place.east_m, beyond.heading_rad))
            for place in track[:-1]
            if place.north_m > 5.0
        )
        < 0.4
    )
    assert track[-1].yaw_rad == pytest.approx(beyond.heading_rad, abs=0.02)
