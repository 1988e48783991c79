"""kill -9 over real MAVLink, and resume; fifty moments are tried in virtual time by tests/resume."""

from pathlib import Path

import pytest

from tests.over_mavlink.observed_flight import kill_and_resume

pytestmark = pytest.mark.real_time


@pytest.mark.parametrize(("kill_s", "away_s"), [(26.0, 2.0), (60.0, 60.0)])
def test_a_killed_program_s_mission_is_taken_up(kill_s: float, away_s: float, tmp_path: Path) -> None:
    after = kill_and_resume(tmp_path, "missions/follow_line.yaml", kill_s, away_s)
    assert "ended completed landed and disarmed" in after.words
    assert after.is_down
