"""kill -9 at fifty random moments of a mission, then resume: it completes, or is refused with a reason."""

import random
from pathlib import Path

import pytest

from mission.records import Result
from tests.resume.killed_flight import kill_and_resume
from tests.support.flights import ALL_TASKS_PLAN

TASKS = [task.task for task in ALL_TASKS_PLAN.tasks]
N_KILLS = 50
_DRAW = random.Random("kills")
# The mission takes 100 s; most of the moments are before its last task, in which there is nothing to resume.
KILLS = [(round(_DRAW.uniform(1.0, 75.0), 2), _DRAW.choice([0.3, 3.0, 30.0, 100.0])) for _ in range(N_KILLS)]


@pytest.mark.parametrize(("kill_s", "away_s"), KILLS)
def test_a_killed_mission_completes_or_says_why_not(kill_s: float, away_s: float, tmp_path: Path) -> None:
    after = kill_and_resume(tmp_path, kill_s, away_s)
    # Each transition is in the journal, in order; one more may be, which was about to happen.
    assert after.journalled[: len(after.reached)] == after.reached
    assert len(after.journalled) - len(after.reached) in (0, 1)
    assert after.is_down
    if after.refusal is not None:
        assert after.killed_in in ("preflight", "completed")
        return
    assert after.ended is not None
    if after.killed_in == "10_return":
        assert "nothing is left to do" in after.ended.reason
        return
    assert after.ended.result is Result.COMPLETED, after.ended.reason
    again = [task for task in after.tasks if task != "takeoff"]
    assert again == TASKS[1:], "each task was completed once, in order"
