"""A control loop that stops: over real MAVLink, PX4 is out of offboard in time, and the program never comes back.

The one place where a test asserts wall time, because that is the promise: COM_OF_LOSS_T (1 s) after the last setpoint
the failsafe acts, and half a second after the loop fell silent there are none.
"""

from pathlib import Path

import pytest

from sitl.modes import Mode
from tests.faults.table import TASKS
from tests.over_mavlink.observed_flight import Outcome, observe

pytestmark = pytest.mark.real_time

OFFBOARD_LOSS_S = 1.0
NOTICED_S = 0.6
HOWS = ("spin", "sleep", "lock")
IN_OWN_MODE = ("takeoff", "return", "land")


def assert_out_of_offboard(outcome: Outcome, limit_s: float) -> None:
    assert outcome.offboard_s is not None, outcome.words
    assert outcome.offboard_s <= limit_s
    assert outcome.exit_code == -9
    assert "ended" not in outcome.words.split("lineflight:")[0]


@pytest.mark.parametrize(("task", "how"), [(task, HOWS[number % 3]) for number, task in enumerate(TASKS)])
def test_a_loop_that_blocks_for_ever_is_ended(task: str, how: str, tmp_path: Path) -> None:
    outcome = observe(tmp_path, task, how)
    assert (outcome.mode_at_stop is Mode.OFFBOARD) == (task not in IN_OWN_MODE)
    assert_out_of_offboard(outcome, OFFBOARD_LOSS_S + NOTICED_S)
    assert "the control loop was silent" in outcome.words


@pytest.mark.parametrize("how", ["kill", "stop"])
def test_a_program_that_is_killed_or_stopped_flies_no_more(how: str, tmp_path: Path) -> None:
    outcome = observe(tmp_path, "follow_lines", how)
    assert outcome.mode_at_stop is Mode.OFFBOARD
    assert_out_of_offboard(outcome, OFFBOARD_LOSS_S + NOTICED_S)
    # A program that was only stopped could be continued, and would send where the vehicle was: it is ended.
    assert ("the control loop was silent" in outcome.words) == (how == "stop")


def test_the_vehicle_comes_home_after_that(tmp_path: Path) -> None:
    outcome = observe(tmp_path, "align", "spin", until_landed=True)
    assert_out_of_offboard(outcome, OFFBOARD_LOSS_S + NOTICED_S)
    assert outcome.is_down
