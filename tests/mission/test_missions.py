"""Whole missions in virtual time, against the simulated vehicle."""

import asyncio
import itertools
import math
from collections.abc import Callable

import pytest

from mission.autopilot import LandedState, Setpoint, VehicleState
from mission.executive import Executive
from mission.plan import MissionPlan, VehiclePlan
from mission.records import Result, TaskEnded, TaskStarted
from mission.simulated.virtual_time import VirtualClock, run_virtually
from mission.tasks.task import Observation, Step
from sitl.modes import Mode
from tests.support.faulty_autopilot import FaultyAutopilot
from tests.support.flights import (
    ALL_TASKS_PLAN,
    LINE_HEADING_RAD,
    LINE_POINT_NED_M,
    Cockpit,
    Flown,
    bare_executive,
    fly,
    shipped,
)

TASKS = [task.task for task in ALL_TASKS_PLAN.tasks]


@pytest.fixture(scope="module")
def nominal() -> Flown:
    return fly(shipped("follow_line"))


def test_follow_line_tells_this_story(nominal: Flown) -> None:
    assert nominal.story == [
        "takeoff completed",
        "ascend completed",
        "move_until completed",
        "align completed",
        "follow_lines completed",
        "rotate completed",
        "follow_lines completed",
        "rotate completed",
        "move_forward completed",
        "descend completed",
        "land completed",
        "mission completed",
    ]


def test_first_follow_completes_and_comes_home_by_itself() -> None:
    flown = fly(shipped("first_follow"))
    assert flown.ended.result is Result.COMPLETED
    assert flown.story[-2:] == ["return completed", "mission completed"]
    assert not flown.autopilot.sim.is_armed
    assert flown.autopilot.true_distance_m < 2.0


@pytest.mark.parametrize("wind_m_s", [0.0, 4.0, 8.0])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_follow_line_lands_where_it_took_off_in_wind(wind_m_s: float, seed: int) -> None:
    flown = fly(shipped("follow_line"), wind_m_s=wind_m_s, seed=seed)
    assert flown.ended.result is Result.COMPLETED, flown.story
    assert not flown.autopilot.sim.is_armed
    assert flown.autopilot.true_distance_m < {0.0: 1.0, 4.0: 1.5, 8.0: 2.0}[wind_m_s]


def test_setpoints_are_sent_at_20_hz_without_a_gap_in_every_offboard_task(nominal: Flown) -> None:
    times_s = [t_ns / 1e9 for t_ns, _ in nominal.log.setpoints]
    gaps_s = [b - a for a, b in itertools.pairwise(times_s)]
    assert max(gaps_s) < 0.11
    assert len(times_s) / (times_s[-1] - times_s[0]) == pytest.approx(20.0, rel=0.02)


def test_setpoints_never_leave_the_leash(nominal: Flown) -> None:
    states = {state.t_ns: state for state in nominal.of(VehicleState)}
    leash_m = shipped("follow_line").guidance.leash_m
    for t_ns, setpoint in nominal.log.setpoints:
        state = states[t_ns]
        assert math.hypot(setpoint.north_m - state.north_m, setpoint.east_m - state.east_m) <= leash_m + 1e-6


def test_the_first_setpoint_is_where_the_vehicle_is(nominal: Flown) -> None:
    t_ns, setpoint = nominal.log.setpoints[0]
    state = next(state for state in nominal.of(VehicleState) if state.t_ns == t_ns)
    assert (setpoint.north_m, setpoint.east_m, setpoint.down_m) == (state.north_m, state.east_m, state.down_m)


def _following_states(flown: Flown) -> list[VehicleState]:
    starts = [item.t_ns for item in flown.of(TaskStarted) if item.task == "follow_lines"]
    ends = [item.t_ns for item in flown.of(TaskEnded) if item.task == "follow_lines"]
    spans = list(zip(starts, ends, strict=True))
    return [s for s in flown.of(VehicleState) if any(begin <= s.t_ns <= end for begin, end in spans)]


def _offset_m(state: VehicleState) -> float:
    north_m, east_m = state.north_m - LINE_POINT_NED_M[0], state.east_m - LINE_POINT_NED_M[1]
    return abs(-math.sin(LINE_HEADING_RAD) * north_m + math.cos(LINE_HEADING_RAD) * east_m)


def test_centred_law_keeps_the_vehicle_over_the_line_and_the_thesis_law_its_direction() -> None:
    plan = shipped("follow_line")
    thesis = plan.model_copy(update={"guidance": plan.guidance.model_copy(update={"law": "thesis"})})
    offsets_m = {
        law: [_offset_m(s) for s in _following_states(fly(p, wind_m_s=4.0))]
        for law, p in (("centred", plan), ("thesis", thesis))
    }
    assert sum(offsets_m["centred"]) / len(offsets_m["centred"]) < 0.35
    assert sum(offsets_m["thesis"]) / len(offsets_m["thesis"]) < 2.0


def test_detected_stops_move_until_before_the_line() -> None:
    tasks = [
        {"task": "takeoff"},
        {"task": "ascend", "altitude_m": 16.0},
        {"task": "move_until", "until": "detected"},
        {"task": "return"},
    ]
    flown = fly(MissionPlan.model_validate({"version": 1, "name": "x", "tasks": tasks}))
    assert flown.ended.result is Result.COMPLETED
    reason = next(item.reason for item in flown.of(TaskEnded) if item.task == "move_until")
    distance_m = float(reason.split()[-2])
    assert 6.0 < distance_m < 11.0


@pytest.mark.parametrize("task", TASKS)
def test_ctrl_c_in_each_task_ends_landed_and_disarmed(task: str) -> None:
    flown = fly(ALL_TASKS_PLAN, in_task=task, do=lambda cockpit: cockpit.executive.request_stop())
    assert flown.ended.result is Result.INTERRUPTED
    assert not flown.autopilot.sim.is_armed
    assert flown.autopilot.sim.vehicle.height_m < 0.2
    states = flown.of(VehicleState)
    assert states[-1].landed is LandedState.ON_GROUND
    is_over_line = TASKS.index(task) >= TASKS.index("move_until")
    expected = ["hold", "return"] if is_over_line else ["hold", "land"]
    if task == "return":
        expected = ["offboard", "return"]  # it is on its way already
    assert flown.autopilot.commands[-2:] == expected


def test_ctrl_c_with_reaction_land_lands_in_place() -> None:
    reactions = ALL_TASKS_PLAN.safety.reactions.model_copy(update={"interrupted": "land"})
    safety = ALL_TASKS_PLAN.safety.model_copy(update={"reactions": reactions})
    plan = ALL_TASKS_PLAN.model_copy(update={"safety": safety})
    flown = fly(plan, in_task="follow_lines", do=lambda cockpit: cockpit.executive.request_stop())
    assert flown.autopilot.commands[-2:] == ["hold", "land"]
    assert flown.autopilot.true_distance_m > 5.0


def test_ctrl_c_twice_does_not_end_the_way_down() -> None:
    def twice(cockpit: Cockpit) -> None:
        cockpit.executive.request_stop()
        asyncio.get_running_loop().call_later(10.0, cockpit.executive.request_stop)

    flown = fly(ALL_TASKS_PLAN, in_task="align", do=twice)
    assert flown.ended.result is Result.INTERRUPTED
    assert not flown.autopilot.sim.is_armed


@pytest.mark.parametrize("mode", [Mode.LOITER, Mode.RTL, Mode.LAND])
@pytest.mark.parametrize("task", [task for task in TASKS if task != "return"])
def test_takeover_in_each_task_is_never_fought(task: str, mode: Mode) -> None:
    at_takeover: list[Cockpit] = []
    commands: list[str] = []

    def take_over(cockpit: Cockpit) -> None:
        cockpit.autopilot.catch_up()
        cockpit.autopilot.sim.set_mode(mode)
        at_takeover.append(cockpit)
        commands.extend(cockpit.autopilot.commands)

    flown = fly(ALL_TASKS_PLAN, in_task=task, after_s=6.0 if task == "takeoff" else 0.5, do=take_over)
    assert flown.ended.result is Result.TAKEN_OVER, flown.story
    # Before the heartbeat has told of offboard, an autopilot that refused and a pilot who was quicker look the same.
    assert "takeover" in flown.ended.reason or ("offboard refused" in flown.ended.reason and task == "ascend")
    assert flown.autopilot.commands == commands
    assert flown.autopilot.sim.mode is mode


def test_after_a_takeover_setpoints_stop_for_good() -> None:
    counts: list[int] = []

    def take_over(cockpit: Cockpit) -> None:
        cockpit.autopilot.catch_up()
        cockpit.autopilot.sim.set_mode(Mode.LOITER)
        counts.append(cockpit.autopilot.n_setpoints)

    flown = fly(ALL_TASKS_PLAN, in_task="follow_lines", after_s=5.0, do=take_over)
    # The heartbeat tells the mode once a second: until then we cannot know.
    assert flown.autopilot.n_setpoints - counts[0] <= 21


def test_a_takeover_on_the_way_down_is_not_fought() -> None:
    def stop_then_take_over(cockpit: Cockpit) -> None:
        cockpit.executive.request_stop()
        asyncio.get_running_loop().call_later(8.0, lambda: cockpit.autopilot.sim.set_mode(Mode.LOITER))

    flown = fly(ALL_TASKS_PLAN, in_task="follow_lines", do=stop_then_take_over)
    assert flown.ended.result is Result.TAKEN_OVER, flown.story
    assert flown.autopilot.commands[-2:] == ["hold", "return"]


def test_a_kill_in_mid_air_ends_our_control() -> None:
    def kill(cockpit: Cockpit) -> None:
        cockpit.autopilot.catch_up()
        cockpit.autopilot.sim.disarm(is_forced=True)

    flown = fly(ALL_TASKS_PLAN, in_task="follow_lines", do=kill)
    assert "! disarmed -> give_up_control" in flown.story
    assert flown.autopilot.commands[-1] == "offboard"


@pytest.mark.parametrize("fault", ["refused", "lost"])
@pytest.mark.parametrize("command", ["return", "hold"])
def test_the_way_down_survives_refused_and_unanswered_commands(command: str, fault: str) -> None:
    def stop(cockpit: Cockpit) -> None:
        cockpit.autopilot.faults[command] = [fault, fault]
        cockpit.executive.request_stop()

    flown = fly(ALL_TASKS_PLAN, in_task="follow_lines", do=stop)
    assert flown.ended.result is Result.INTERRUPTED, flown.story
    assert not flown.autopilot.sim.is_armed


@pytest.mark.parametrize("fault", ["refused", "lost"])
def test_the_last_landing_is_commanded_again(fault: str) -> None:
    def spoil(cockpit: Cockpit) -> None:
        cockpit.autopilot.faults["return"] = [fault]

    flown = fly(ALL_TASKS_PLAN, in_task="descend", do=spoil)
    assert flown.ended.result is Result.COMPLETED, flown.story
    assert not flown.autopilot.sim.is_armed


@pytest.mark.parametrize(("n_missed", "result"), [(2, Result.COMPLETED), (3, Result.FAILED)])
def test_a_setpoint_may_be_missed_but_not_three_in_a_row(n_missed: int, result: Result) -> None:
    def miss(cockpit: Cockpit) -> None:
        cockpit.autopilot.faults["setpoint"] = ["lost"] * n_missed

    flown = fly(ALL_TASKS_PLAN, in_task="follow_lines", do=miss)
    assert flown.ended.result is result, flown.story
    assert not flown.autopilot.sim.is_armed


def test_a_refused_offboard_brings_the_vehicle_down() -> None:
    def spoil(cockpit: Cockpit) -> None:
        cockpit.autopilot.faults["offboard"] = ["refused"]

    flown = fly(ALL_TASKS_PLAN, in_task="takeoff", do=spoil)
    assert flown.ended.result is Result.FAILED
    assert "! command_refused -> land" in flown.story
    assert not flown.autopilot.sim.is_armed


def test_offboard_that_was_accepted_and_never_came_leaves_the_vehicle_in_its_own_mode() -> None:
    def spoil(cockpit: Cockpit) -> None:
        cockpit.autopilot.faults["offboard"] = ["ignored"]

    flown = fly(ALL_TASKS_PLAN, in_task="takeoff", do=spoil)
    assert flown.ended.result is Result.TAKEN_OVER
    assert "! offboard_refused -> give_up_control" in flown.story
    assert "in hold mode" in flown.ended.reason
    assert flown.autopilot.sim.mode is Mode.LOITER


def fly_with(spoil: Callable[[FaultyAutopilot], None]) -> tuple[Executive, FaultyAutopilot, Result]:
    """A flight whose vehicle is spoilt before it begins."""

    async def flight() -> tuple[Executive, FaultyAutopilot, Result]:
        clock = VirtualClock()
        autopilot = FaultyAutopilot(clock)
        spoil(autopilot)
        # The autopilot disarms a vehicle that does not take off after ten seconds; we give up before.
        plan = ALL_TASKS_PLAN.model_copy(update={"vehicle": VehiclePlan(ready_time_limit_s=9.0)})
        executive = bare_executive(plan, autopilot, clock)
        ended = await executive.run()
        return executive, autopilot, ended.result

    return run_virtually(flight())


def test_a_refused_arming_ends_the_mission_before_it_began() -> None:
    executive, autopilot, result = fly_with(lambda autopilot: autopilot.faults.update(arm=["refused"]))
    assert result is Result.FAILED
    assert not executive.may_have_armed
    assert autopilot.commands == ["arm"]


def test_an_arming_without_an_answer_is_brought_down() -> None:
    executive, autopilot, result = fly_with(lambda autopilot: autopilot.faults.update(arm=["lost"]))
    assert result is Result.FAILED
    assert executive.may_have_armed
    assert not autopilot.sim.is_armed
    assert "takeoff" not in autopilot.commands


def test_a_vehicle_that_is_armed_already_is_left_to_whoever_armed_it() -> None:
    def arm_by_hand(autopilot: FaultyAutopilot) -> None:
        loop = asyncio.get_running_loop()
        loop.call_later(4.5, lambda: (autopilot.catch_up(), autopilot.sim.arm()))

    executive, autopilot, result = fly_with(arm_by_hand)
    assert result is Result.FAILED
    assert not executive.may_have_armed
    assert autopilot.commands == []


@pytest.mark.parametrize("task", ["align", "follow_lines"])
def test_a_lost_line_brings_the_vehicle_home(task: str) -> None:
    def blind(cockpit: Cockpit) -> None:
        cockpit.eyes.is_blind = True

    flown = fly(ALL_TASKS_PLAN, in_task=task, after_s=0.1, do=blind)
    assert flown.ended.result is Result.FAILED
    assert "! line_lost -> search" in flown.story
    assert "! task_failed -> return" in flown.story
    assert not flown.autopilot.sim.is_armed
    assert flown.autopilot.true_distance_m < 2.0


def test_following_waits_while_it_is_blind() -> None:
    def blind(cockpit: Cockpit) -> None:
        cockpit.eyes.is_blind = True

    flown = fly(ALL_TASKS_PLAN, in_task="follow_lines", after_s=2.0, do=blind)
    lost_ns = next(item.t_ns for item in flown.of(TaskEnded) if item.task == "follow_lines")
    before = [setpoint for t_ns, setpoint in flown.log.setpoints if lost_ns - 2e9 < t_ns < lost_ns]
    assert before[0].north_m == pytest.approx(before[-1].north_m, abs=0.2)
    assert before[0].east_m == pytest.approx(before[-1].east_m, abs=0.2)


@pytest.mark.parametrize("task", ["move_until", "align", "follow_lines"])
def test_a_dead_vision_worker_brings_the_vehicle_home(task: str) -> None:
    def kill(cockpit: Cockpit) -> None:
        cockpit.eyes.failure = "the vision worker ended"

    flown = fly(ALL_TASKS_PLAN, in_task=task, do=kill)
    assert flown.ended.result is Result.FAILED
    assert "! vision_dead -> return" in flown.story
    assert not flown.autopilot.sim.is_armed


def test_a_dead_vision_worker_does_not_matter_to_a_task_without_it() -> None:
    def kill(cockpit: Cockpit) -> None:
        cockpit.eyes.failure = "the vision worker ended"

    flown = fly(ALL_TASKS_PLAN, in_task="rotate", do=kill)
    assert flown.ended.result is Result.COMPLETED


def test_no_line_at_all_ends_move_until_and_returns() -> None:
    def blind(cockpit: Cockpit) -> None:
        cockpit.eyes.is_blind = True

    flown = fly(ALL_TASKS_PLAN, in_task="takeoff", do=blind)
    assert "move_until failed" in flown.story
    assert "! task_failed -> return" in flown.story
    assert not flown.autopilot.sim.is_armed


def test_a_lost_link_ends_our_control_without_a_further_command() -> None:
    def cut(cockpit: Cockpit) -> None:
        cockpit.autopilot.is_connected = False

    flown = fly(ALL_TASKS_PLAN, in_task="follow_lines", do=cut)
    assert flown.ended.result is Result.FAILED
    assert "! link_lost -> give_up_control" in flown.story
    assert flown.autopilot.commands[-1] == "offboard"


def test_a_task_that_takes_too_long_ends_the_mission() -> None:
    tasks = [
        task.model_copy(update={"time_limit_s": 3.0}) if task.task == "hold" else task for task in ALL_TASKS_PLAN.tasks
    ]
    flown = fly(ALL_TASKS_PLAN.model_copy(update={"tasks": tasks}))
    assert flown.ended.result is Result.TIMED_OUT
    assert "! task_timed_out -> return" in flown.story
    assert not flown.autopilot.sim.is_armed


def test_a_fence_that_the_mission_leaves_brings_it_home() -> None:
    safety = ALL_TASKS_PLAN.safety.model_copy(update={"max_distance_m": 10.0})
    flown = fly(ALL_TASKS_PLAN.model_copy(update={"safety": safety}))
    assert "! geofence -> return" in flown.story
    assert not flown.autopilot.sim.is_armed


class BrokenTask:
    needs_line = False
    needs_vision = False
    progress = 0.0

    def step(self, reference: Setpoint, seen: Observation) -> Step:
        raise ZeroDivisionError("a bug")


def test_a_bug_in_a_task_brings_the_vehicle_down() -> None:
    def break_it(cockpit: Cockpit) -> None:
        cockpit.executive._flow.task = BrokenTask()

    flown = fly(ALL_TASKS_PLAN, in_task="hold", do=break_it)
    assert flown.ended.result is Result.FAILED
    assert "! internal_error -> land" in flown.story
    assert not flown.autopilot.sim.is_armed


def test_before_arming_ctrl_c_ends_at_once() -> None:
    async def flight() -> tuple[Result, list[str]]:
        clock = VirtualClock()
        autopilot = FaultyAutopilot(clock)
        executive = bare_executive(ALL_TASKS_PLAN, autopilot, clock)
        asyncio.get_running_loop().call_later(1.0, executive.request_stop)
        ended = await executive.run()
        return ended.result, autopilot.commands

    assert run_virtually(flight()) == (Result.INTERRUPTED, [])


def test_ctrl_c_while_connecting_does_not_wait_for_the_vehicle() -> None:
    async def flight() -> tuple[Result, int]:
        clock = VirtualClock()
        autopilot = FaultyAutopilot(clock)
        autopilot.connect = asyncio.Event().wait  # type: ignore[method-assign,assignment]  # nobody is there
        executive = bare_executive(ALL_TASKS_PLAN, autopilot, clock)
        asyncio.get_running_loop().call_later(1.0, executive.request_stop)
        ended = await executive.run()
        return ended.result, clock.now_ns()

    result, now_ns = run_virtually(flight())
    assert result is Result.INTERRUPTED
    assert now_ns < 2_000_000_000


def test_ctrl_c_before_a_line_can_be_below_lands_and_after_moving_ahead_returns() -> None:
    tasks = [
        {"task": "takeoff"},
        {"task": "ascend", "altitude_m": 16.0},
        {"task": "move_forward", "distance_m": 12.0},
        {"task": "hold", "duration_s": 20.0},
        {"task": "return"},
    ]
    plan = MissionPlan.model_validate({"version": 1, "name": "x", "tasks": tasks})
    flown = fly(plan, in_task="hold", do=lambda cockpit: cockpit.executive.request_stop())
    assert flown.autopilot.commands[-2:] == ["hold", "return"]


def test_a_short_leash_shortens_no_leg() -> None:
    guidance = ALL_TASKS_PLAN.guidance.model_copy(update={"leash_m": 1.0})
    flown = fly(ALL_TASKS_PLAN.model_copy(update={"guidance": guidance}))
    assert flown.ended.result is Result.COMPLETED, flown.story
    states = _following_states(flown)
    first, last = states[0], states[-1]
    assert math.hypot(last.north_m - first.north_m, last.east_m - first.east_m) == pytest.approx(12.0, abs=1.0)
