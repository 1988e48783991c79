"""The lines of text that a flight is told in."""

from mission.log.wording import line_of
from mission.records import MissionEnded, Result, TaskEnded


def test_a_reason_that_begins_with_its_result_says_it_once() -> None:
    reason = "interrupted: the operator asked to stop"
    _, _, task = line_of(TaskEnded(0, 0, "return", Result.INTERRUPTED, reason))
    _, _, mission = line_of(MissionEnded(0, Result.INTERRUPTED, reason))
    assert task == "return interrupted: the operator asked to stop"
    assert mission == "mission interrupted: the operator asked to stop"
    _, _, other = line_of(TaskEnded(0, 0, "return", Result.FAILED, reason))
    assert other == f"return failed: {reason}"
