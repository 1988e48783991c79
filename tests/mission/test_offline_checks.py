"""What check says of a mission without a vehicle, and where a mission may be over the line."""

import pytest

from mission.build import fence
from mission.estimate import total
from mission.geofence import Fence
from mission.offline_checks import check_offline
from mission.plan import MissionPlan
from mission.plan_fence import FencePlan
from mission.reach import reckon
from mission.records import CheckResult
from tests.support.flights import ALL_TASKS_PLAN, shipped

PLAN = shipped("follow_line")


def results(**sections: dict[str, object]) -> dict[str, CheckResult]:
    raw = PLAN.model_dump(exclude_unset=True)
    for section, changes in sections.items():
        raw[section] = raw.get(section, {}) | changes
    return {check.name: check.result for check in check_offline(MissionPlan.model_validate(raw))}


@pytest.mark.parametrize("name", ["follow_line", "first_follow"])
def test_shipped_missions_pass_and_know_their_line(name: str) -> None:
    plan = shipped(name)
    assert {check.result for check in check_offline(plan)} == {CheckResult.OK}
    assert plan.safety.line_height_m is not None


@pytest.mark.parametrize(
    ("name", "sections", "result"),
    [
        ("energy", {"vehicle": {"battery_wh": 10.0}}, CheckResult.FAILED),
        ("energy", {"vehicle": {"hover_power_w": 1800.0}}, CheckResult.OK),
        ("energy", {"vehicle": {"hover_power_w": 2200.0}}, CheckResult.FAILED),
        ("time_limits", {"guidance": {"r_m_s": 0.2}}, CheckResult.WARNING),
        ("height_over_line", {"guidance": {"height_over_line_m": 4.5}}, CheckResult.OK),
        ("height_over_line", {"guidance": {"height_over_line_m": 4.0}}, CheckResult.WARNING),
        ("height_over_line", {"guidance": {"height_over_line_m": 2.5}}, CheckResult.FAILED),
        ("height_over_line", {"guidance": {"height_over_line_m": 14.0}}, CheckResult.FAILED),
        (
            "height_over_line",
            {"guidance": {"height_over_line_m": 2.5}, "safety": {"line_height_m": None}},
            CheckResult.OK,
        ),
        ("fence", {"safety": {"max_distance_m": 49.0}}, CheckResult.WARNING),
        ("fence", {"safety": {"max_distance_m": 51.0}}, CheckResult.OK),
        ("fence", {"safety": {"fence": {"polygon_m": [[-60, -60], [-60, 60], [60, 0]]}}}, CheckResult.WARNING),
        ("fence", {"safety": {"fence": {"polygon_m": [[-90, -90], [-90, 90], [90, 90], [90, -90]]}}}, CheckResult.OK),
    ],
)
def test_each_case(name: str, sections: dict[str, dict[str, object]], result: CheckResult) -> None:
    assert results(**sections)[name] is result


def test_the_way_of_the_shipped_mission() -> None:
    legs = reckon(PLAN)
    names = [task.task for task in PLAN.tasks]
    assert [round(leg.reach_m) for leg in legs] == [0, 0, 40, 40, 50, 50, 40, 40, 0, 0, 0]
    over = [name for name, leg in zip(names, legs, strict=True) if leg.may_be_over_line]
    assert over == names[2:9]
    assert total(PLAN).reach_m == pytest.approx(50.0)


def test_what_comes_after_the_line_is_over_it_until_the_vehicle_is_back() -> None:
    legs = reckon(ALL_TASKS_PLAN)
    over = [task.task for task, leg in zip(ALL_TASKS_PLAN.tasks, legs, strict=True) if leg.may_be_over_line]
    assert over == ["move_until", "align", "follow_lines", "rotate", "move_forward", "descend"]
    assert legs[-2].lowest_m == 13.0


def test_the_plans_fence_is_the_flights() -> None:
    safety = PLAN.safety.model_copy(
        update={"fence": FencePlan(polygon_m=[[-9, -9], [-9, 9], [9, 0]], min_altitude_m=5)}
    )
    assert fence(safety) == Fence(150.0, 60.0, ((-9, -9), (-9, 9), (9, 0)), 5)
