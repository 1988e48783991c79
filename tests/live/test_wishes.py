"""What becomes of Hold and Land: flown in virtual time, with the wishes of a scripted live view."""

import asyncio

import pytest

from mission.autopilot import VehicleState
from mission.flight import be_watched
from mission.operator import Wish
from mission.records import Event, Result
from mission.reporting import Progress
from mission.simulated.virtual_time import VirtualClock, run_virtually
from sitl.modes import Mode
from tests.support.faulty_autopilot import FaultyAutopilot
from tests.support.flights import ALL_TASKS_PLAN, START_YAW_RAD, Cockpit, Flown, KeptLog, bare_executive, fly

TASKS = [task.task for task in ALL_TASKS_PLAN.tasks]


class ScriptedView:
    """A live view whose operator does what a test says."""

    def __init__(self) -> None:
        self.failure: str | None = None
        self.said: list[Wish] = []
        self.shown: list[Progress] = []

    def show(self, progress: Progress) -> None:
        self.shown.append(progress)

    def wishes(self) -> list[Wish]:
        said = list(self.said)
        self.said.clear()
        return said


def words(flown: Flown, name: str) -> list[tuple[str, str]]:
    return [(event.reaction, event.message) for event in flown.of(Event) if event.name == name]


@pytest.mark.parametrize("task", TASKS)
def test_hold_in_each_task_leaves_the_vehicle_hovering_in_its_own_mode(task: str) -> None:
    after_s = 6.0 if task == "takeoff" else 0.5
    flown = fly(ALL_TASKS_PLAN, in_task=task, after_s=after_s, do=lambda cockpit: cockpit.executive.request(Wish.HOLD))
    assert flown.ended.result is Result.INTERRUPTED
    assert flown.autopilot.sim.mode is Mode.LOITER
    assert flown.autopilot.sim.is_armed
    assert flown.autopilot.commands[-1] == "hold"
    assert words(flown, "operator_hold") == [("hold_and_end", "the operator asked to hold")]


def test_hold_before_the_vehicle_has_left_the_ground_lands_it_there() -> None:
    flown = fly(ALL_TASKS_PLAN, in_task="takeoff", after_s=0.3, do=lambda cockpit: cockpit.executive.request(Wish.HOLD))
    assert flown.ended.result is Result.INTERRUPTED
    assert not flown.autopilot.sim.is_armed


@pytest.mark.parametrize(("task", "way"), [("ascend", "land"), ("hold", "land"), ("follow_lines", "return")])
def test_land_lands_here_but_never_where_the_line_may_be_below(task: str, way: str) -> None:
    flown = fly(ALL_TASKS_PLAN, in_task=task, do=lambda cockpit: cockpit.executive.request(Wish.LAND))
    assert flown.ended.result is Result.INTERRUPTED
    assert flown.autopilot.commands[-2:] == ["hold", way]
    assert words(flown, "operator_land") == [(way, "the operator asked to land")]
    assert not flown.autopilot.sim.is_armed


@pytest.mark.parametrize("wish", list(Wish))
def test_a_wish_after_the_pilot_took_over_is_told_and_nothing_is_sent(wish: Wish) -> None:
    async def flight() -> tuple[Result, list[str], list[str], list[object]]:
        clock, log = VirtualClock(), KeptLog(lambda _: None)
        autopilot = FaultyAutopilot(clock, start_yaw_rad=START_YAW_RAD)
        executive = bare_executive(ALL_TASKS_PLAN, autopilot, clock, log=log)
        flying = asyncio.create_task(executive.run())
        await asyncio.sleep(25.0)
        autopilot.catch_up()
        autopilot.sim.set_mode(Mode.LOITER)
        ended = await flying
        before = list(autopilot.commands)
        executive.request(wish)
        await asyncio.sleep(5.0)
        return ended.result, before, list(autopilot.commands), log.items

    result, before, after, items = run_virtually(flight())
    assert result is Result.TAKEN_OVER
    assert before == after
    last = items[-1]
    assert isinstance(last, Event)
    assert (last.name, last.reaction) == (f"operator_{wish}", "continue")
    assert "nothing is sent" in last.message


def test_a_wish_on_the_way_down_changes_nothing_and_is_told() -> None:
    def land_then_hold(cockpit: Cockpit) -> None:
        cockpit.executive.request(Wish.LAND)
        asyncio.get_running_loop().call_later(8.0, cockpit.executive.request, Wish.HOLD)

    flown = fly(ALL_TASKS_PLAN, in_task="follow_lines", do=land_then_hold)
    assert not flown.autopilot.sim.is_armed
    (said,) = words(flown, "operator_hold")
    assert said[0] == "continue"
    assert "ended already" in said[1]


@pytest.mark.parametrize("wish", list(Wish))
def test_before_arming_a_wish_ends_the_flight_at_once(wish: Wish) -> None:
    async def flight() -> tuple[Result, list[str]]:
        clock = VirtualClock()
        autopilot = FaultyAutopilot(clock, start_yaw_rad=START_YAW_RAD)
        executive = bare_executive(ALL_TASKS_PLAN, autopilot, clock)
        asyncio.get_running_loop().call_later(1.0, executive.request, wish)
        ended = await executive.run()
        return ended.result, autopilot.commands

    assert run_virtually(flight()) == (Result.INTERRUPTED, [])


def test_the_view_is_shown_the_progress_its_wishes_reach_the_executive_and_its_death_is_one_event() -> None:
    async def flight() -> tuple[Result, ScriptedView, list[object]]:
        clock, log, view = VirtualClock(), KeptLog(lambda _: None), ScriptedView()
        executive = bare_executive(ALL_TASKS_PLAN, FaultyAutopilot(clock, start_yaw_rad=START_YAW_RAD), clock, log=log)
        loop = asyncio.get_running_loop()
        loop.call_later(20.0, setattr, view, "failure", "the live view ended")
        loop.call_later(25.0, view.said.append, Wish.HOLD)
        watching = asyncio.create_task(be_watched(view, executive, log, clock))  # type: ignore[arg-type]
        ended = await executive.run()
        watching.cancel()
        await asyncio.gather(watching, return_exceptions=True)
        return ended.result, view, log.items

    result, view, items = run_virtually(flight())
    assert result is Result.INTERRUPTED
    events = [item.name for item in items if isinstance(item, Event)]
    assert events.count("live_view_lost") == 1
    assert "operator_hold" in events
    assert view.shown[0].stage == "preflight"
    assert max(progress.height_m or 0.0 for progress in view.shown) > 3.0
    assert any(isinstance(item, VehicleState) for item in items)
