"""Every fault in every task, flown in virtual time, against the declared table."""

import pytest

from mission.plan import TASK_MODELS
from tests.faults.faults import FAULTS
from tests.faults.flight import fly_case
from tests.faults.page import PAGE, with_matrix
from tests.faults.table import EXPECTED, TASKS, End, expected

CASES = [(fault.name, task) for fault in FAULTS for task in TASKS]


@pytest.mark.parametrize(("fault", "task"), CASES)
def test_each_fault_in_each_task_ends_as_declared(fault: str, task: str) -> None:
    flight = fly_case(fault, task)
    assert flight.broken == [], flight.story
    assert flight.end is expected(fault, task), flight.story


def test_the_table_is_whole() -> None:
    assert set(EXPECTED) == {fault.name for fault in FAULTS}
    assert set(TASKS) == set(TASK_MODELS)
    for fault in FAULTS:
        ends = [expected(fault.name, task) for task in TASKS]
        assert End.LOST not in ends
        if not fault.is_takeover:
            assert End.PILOT not in ends


def test_the_page_shows_the_table() -> None:
    page = PAGE.read_text(encoding="utf-8")
    assert with_matrix(page) == page, "run make safety-table"
