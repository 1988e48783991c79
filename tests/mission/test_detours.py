"""Pauses: what each tick of a hold or a search does, and whole flights that pause."""

from collections.abc import Callable
from dataclasses import replace

import pytest

from mission.build import guidance_settings, search_settings
from mission.detours import Detour, detour_task
from mission.eyes import Notice
from mission.limits import SetpointLimits, floor_m, unsafe
from mission.plan import GuidancePlan, MissionPlan, SafetyPlan
from mission.records import Event, Result
from mission.safety import Hazard, Reaction
from mission.tasks.hold_on import HoldOnTask
from mission.tasks.task import FlightMemory
from mission.trail import Trail
from tests.mission.test_watchers import STATE, S, point
from tests.support.flights import ALL_TASKS_PLAN, Cockpit, fly

GUIDANCE = guidance_settings(GuidancePlan())
GONE = (Hazard.CAMERA_GONE, Reaction.HOLD)
LOST = (Hazard.LINE_LOST, Reaction.SEARCH)


def detour(reaction: Reaction) -> Detour:
    return Detour(HoldOnTask(0.0, GUIDANCE), Hazard.CAMERA_GONE, reaction, started_ns=0)


def run(pause: Detour, script: list[tuple[float, tuple[Hazard, Reaction] | None]]) -> list[str]:
    """What the detour does at each second of the script."""
    return [pause.next(round(t * S), decision, hold_limit_s=20.0, search_limit_s=60.0) for t, decision in script]


def test_a_hold_goes_on_a_second_after_its_hazard_is_over() -> None:
    script = [(0.0, GONE), (1.0, GONE), (2.0, None), (2.9, None), (3.0, None)]
    assert run(detour(Reaction.HOLD), script) == ["step", "step", "step", "step", "carry_on"]


def test_a_hazard_that_comes_back_starts_the_second_anew() -> None:
    script = [(0.0, GONE), (1.0, None), (1.5, GONE), (2.0, None), (2.9, None), (3.1, None)]
    assert run(detour(Reaction.HOLD), script)[-2:] == ["step", "carry_on"]


def test_what_holds_too_long_ends_the_mission() -> None:
    assert run(detour(Reaction.HOLD), [(0.0, GONE), (20.0, GONE), (20.1, GONE)])[-2:] == ["step", "too_long"]


def test_a_line_that_is_lost_while_holding_is_for_the_task_to_search() -> None:
    assert run(detour(Reaction.HOLD), [(0.0, GONE), (2.0, LOST), (3.0, LOST)])[-1] == "carry_on"


def test_a_search_keeps_still_while_nothing_can_be_seen() -> None:
    script = [(0.0, None), (1.0, LOST), (2.0, GONE), (3.0, GONE), (4.0, None), (50.0, GONE), (59.0, None)]
    assert run(detour(Reaction.SEARCH), script) == ["step", "step", "wait", "wait", "step", "wait", "step"]


def test_a_search_has_an_end() -> None:
    assert run(detour(Reaction.SEARCH), [(59.0, None), (60.1, None)]) == ["step", "too_long"]


def test_no_climb_passes_the_fence() -> None:
    memory = FlightMemory(point(0.0), 0.0)
    task = detour_task(Reaction.CLIMB_AND_HOLD, search_settings(SafetyPlan()), 1.0, memory, GUIDANCE)
    assert isinstance(task, HoldOnTask)
    assert task._climb_m == 1.0


def test_the_way_back_is_the_way_flown_up_to_the_place() -> None:
    trail = Trail()
    for tick in range(400):
        trail.add(replace(STATE, north_m=tick * 0.1, down_m=-16.0))
    way = trail.back_to(point(30.0), 50.0)
    assert [round(place.north_m) for place in way] == [39, 38, 37, 36, 35, 34, 33, 32, 31]
    assert [round(place.north_m) for place in trail.back_to(point(0.0), 3.5)] == [39, 38, 37, 36]
    assert Trail().back_to(point(0.0), 10.0) == []


LIMITS = SetpointLimits(leash_m=4.0, max_distance_m=100.0, max_altitude_m=60.0)


@pytest.mark.parametrize(
    ("setpoint", "words"),
    [
        (point(10.0), None),
        (point(103.9), None),
        (point(104.1), "outside the fence"),
        (replace(point(0.0), down_m=-64.1), "above the fence"),
        (replace(point(0.0), down_m=-14.9), "has to stay above 15.0 m"),
        (replace(point(0.0), down_m=-15.1), None),
        (replace(point(0.0), yaw_rad=float("nan")), "not a number"),
        (replace(point(0.0), east_m=float("inf")), "not a number"),
    ],
)
def test_which_setpoints_are_never_sent(setpoint: object, words: str | None) -> None:
    start = replace(point(0.0), down_m=0.0)
    found = unsafe(setpoint, start, floor_m(16.0), LIMITS)  # type: ignore[arg-type]
    assert found is None if words is None else words in (found or "")


def test_the_floor_is_that_of_the_lower_end_of_a_task() -> None:
    assert floor_m(16.0) == 15.0
    assert floor_m(16.0, 4.0) == 3.0
    assert floor_m(0.0) == 0.5


def events(plan: MissionPlan, task: str, do: Callable[[Cockpit], None]) -> tuple[list[str], Result]:
    flown = fly(plan, in_task=task, after_s=1.0, do=do)
    return [f"{event.name} {event.reaction}" for event in flown.of(Event)], flown.ended.result


def hide_for(seconds: float) -> Callable[[Cockpit], None]:
    def hide(cockpit: Cockpit) -> None:
        import asyncio

        cockpit.eyes.is_blind = True
        asyncio.get_running_loop().call_later(seconds, lambda: setattr(cockpit.eyes, "is_blind", False))

    return hide


def test_a_line_that_comes_back_is_followed_on_at_the_old_height() -> None:
    flown = fly(ALL_TASKS_PLAN, in_task="follow_lines", after_s=2.0, do=hide_for(7.0))
    assert [event.name for event in flown.of(Event)] == ["line_lost", "carried_on"]
    assert flown.ended.result is Result.COMPLETED
    times = [event.t_ns for event in flown.of(Event)]
    heights = [-state.down_m for state in flown.of(type(STATE)) if times[0] < state.t_ns < times[1] + 2 * S]
    assert max(heights) > 17.5
    assert heights[-1] == pytest.approx(16.0, abs=0.8)


def test_a_camera_that_is_gone_for_a_while_and_then_sees_no_line_leads_to_a_search() -> None:
    def do(cockpit: Cockpit) -> None:
        import asyncio

        cockpit.eyes.impairment = Notice("camera_gone", "unplugged")
        cockpit.eyes.is_blind = True
        loop = asyncio.get_running_loop()
        loop.call_later(2.5, lambda: setattr(cockpit.eyes, "impairment", None))
        loop.call_later(9.0, lambda: setattr(cockpit.eyes, "is_blind", False))

    names, result = events(ALL_TASKS_PLAN, "follow_lines", do)
    assert names == ["camera_gone hold", "carried_on continue", "line_lost search", "carried_on continue"]
    assert result is Result.COMPLETED


def test_pauses_do_not_count_against_the_task_s_time() -> None:
    tasks = [
        task.model_copy(update={"time_limit_s": 14.0}) if task.task == "follow_lines" else task
        for task in ALL_TASKS_PLAN.tasks
    ]
    plan = ALL_TASKS_PLAN.model_copy(update={"tasks": tasks})
    assert fly(plan).ended.result is Result.COMPLETED
    names, result = events(plan, "follow_lines", hide_for(9.0))
    assert names == ["line_lost search", "carried_on continue"]
    assert result is Result.COMPLETED


@pytest.mark.parametrize("height_m", [8.0, 1.0])
def test_a_landing_is_never_exchanged_for_a_return(height_m: float) -> None:
    tasks = [{"task": "takeoff", "altitude_m": 10.0}, {"task": "land"}]
    plan = MissionPlan.model_validate({"version": 1, "name": "x", "tasks": tasks})

    def drain(cockpit: Cockpit) -> None:
        sim = cockpit.autopilot.sim

        def look() -> None:
            if sim.vehicle.height_m < height_m:
                sim.battery.remaining = 0.2

        cockpit.autopilot.after_step.append(look)

    flown = fly(plan, in_task="land", do=drain)
    assert "battery_low" in [event.name for event in flown.of(Event)]
    assert flown.autopilot.commands[-1] == "land"
    assert not flown.autopilot.sim.is_armed
