"""The estimate of a mission, against the flight it becomes."""

import pytest

from mission.estimate import estimate_mission
from mission.records import TaskEnded, TaskStarted
from tests.support.flights import ALL_TASKS_PLAN, fly, shipped


@pytest.mark.parametrize("name", ["follow_line", "first_follow"])
def test_the_estimated_time_is_near_the_flown_one(name: str) -> None:
    plan = shipped(name)
    flown = fly(plan)
    begin_s, end_s = flown.of(TaskStarted)[0].t_ns / 1e9, flown.of(TaskEnded)[-1].t_ns / 1e9
    estimated_s = sum(estimate.duration_s for estimate in estimate_mission(plan))
    assert estimated_s == pytest.approx(end_s - begin_s, rel=0.6)


def test_every_task_has_a_sentence_and_the_height_after_it() -> None:
    estimates = estimate_mission(ALL_TASKS_PLAN)
    assert [estimate.task for estimate in estimates] == [task.task for task in ALL_TASKS_PLAN.tasks]
    assert all(estimate.sentence and estimate.duration_s > 0 for estimate in estimates)
    assert [estimate.altitude_m for estimate in estimates] == [4, 16, 16, 16, 16, 16, 16, 16, 13, 0]
