"""What the executive makes of reports: the state at capture time, and the size of the group."""

import math
from dataclasses import replace

import pytest

from mission.autopilot import FlightMode, LandedState, VehicleState
from mission.build import guidance_settings
from mission.camera_plan import pinhole_intrinsics
from mission.eyes import GroupSize, StateHistory, sight_of
from mission.plan import CameraPlan, GuidancePlan
from tests.support.geometric_eyes import bare_report
from vision.records import BLINDING, LineEstimate, Trouble, VisionReport

STATE = VehicleState(
    0, 0, 0, -16, 0, 0, 0, 0, 0, 0, FlightMode.OFFBOARD, True, LandedState.IN_AIR, 0.9, is_connected=True
)
S = 1_000_000_000


def history(*states: VehicleState) -> StateHistory:
    kept = StateHistory()
    for state in states:
        kept.add(state)
    return kept


def test_states_are_interpolated_and_yaw_goes_the_short_way() -> None:
    kept = history(
        replace(STATE, t_ns=S, north_m=1.0, yaw_rad=math.radians(179)),
        replace(STATE, t_ns=2 * S, north_m=3.0, yaw_rad=math.radians(-179)),
    )
    between = kept.at(round(1.5 * S))
    assert between is not None
    assert between.north_m == pytest.approx(2.0)
    assert abs(between.yaw_rad) == pytest.approx(math.pi)


def test_outside_the_history_the_nearest_state_counts() -> None:
    kept = history(replace(STATE, t_ns=S, north_m=1.0), replace(STATE, t_ns=2 * S, north_m=3.0))
    assert [kept.at(t_ns).north_m for t_ns in (0, 9 * S)] == [1.0, 3.0]  # type: ignore[union-attr]
    assert StateHistory().at(S) is None


def test_the_history_forgets() -> None:
    kept = history(replace(STATE, t_ns=S, north_m=1.0), replace(STATE, t_ns=5 * S, north_m=3.0))
    earliest = kept.at(S)
    assert earliest is not None
    assert earliest.north_m == 3.0


def report(t_ns: int, n_lines: int | None) -> VisionReport:
    estimate = None if n_lines is None else LineEstimate(0.1, 5.0, n_lines, None, 1.0, t_ns)
    return bare_report(0, t_ns, estimate)


def test_an_old_estimate_does_not_steer() -> None:
    camera, guidance = pinhole_intrinsics(CameraPlan()), guidance_settings(GuidancePlan())
    kept = history(replace(STATE, t_ns=S))
    fresh = sight_of(report(S, 3), kept, GroupSize(), camera, guidance, S + S // 2)
    assert fresh is not None
    assert fresh.line is not None
    assert sight_of(report(S, 3), kept, GroupSize(), camera, guidance, S + S // 2 + 1) is None


def test_a_frame_without_a_line_is_a_sight_without_a_line() -> None:
    camera, guidance = pinhole_intrinsics(CameraPlan()), guidance_settings(GuidancePlan())
    seen = sight_of(report(S, None), history(replace(STATE, t_ns=S)), GroupSize(), camera, guidance, S)
    assert seen is not None
    assert seen.line is None


@pytest.mark.parametrize("trouble", Trouble)
def test_a_frame_that_nothing_can_be_seen_in_is_no_sight(trouble: Trouble) -> None:
    camera, guidance = pinhole_intrinsics(CameraPlan()), guidance_settings(GuidancePlan())
    troubled = replace(report(S, None), trouble=trouble)
    seen = sight_of(troubled, history(replace(STATE, t_ns=S)), GroupSize(), camera, guidance, S)
    assert (seen is None) is (trouble in BLINDING)


def test_a_part_of_the_group_is_not_whole_once_the_group_is_known() -> None:
    group = GroupSize()
    assert [group.is_whole(1) for _ in range(4)] == [True] * 4
    assert [group.is_whole(3) for _ in range(4)] == [True] * 4
    assert not group.is_whole(2)
    assert group.is_whole(3)


def test_one_wrong_count_does_not_make_the_line_larger() -> None:
    group = GroupSize()
    assert all(group.is_whole(3) for _ in range(50))
    group.is_whole(5)
    assert group.is_whole(3)


def test_the_group_shrinks_when_a_conductor_ends() -> None:
    group = GroupSize(window=40)
    for _ in range(40):
        group.is_whole(3)
    seen = [group.is_whole(2) for _ in range(40)]
    assert not seen[0]
    assert seen[-1]
