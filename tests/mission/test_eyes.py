"""What the executive makes of reports: the state at capture time, and where its conductors are seen."""

import math
from dataclasses import replace

import pytest

from mission.autopilot import FlightMode, LandedState, VehicleState
from mission.build import guidance_settings
from mission.camera_plan import pinhole_intrinsics
from mission.eyes import StateHistory, sight_of, view_of
from mission.known_line import KnownLine
from mission.plan import CameraPlan, GuidancePlan
from tests.support.geometric_eyes import bare_report
from vision.records import BLINDING, ImageLine, LineEstimate, Trouble, VisionReport

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
    fresh = sight_of(report(S, 3), kept, KnownLine(), camera, guidance, 16.0, S + S // 2)
    assert fresh is not None
    assert fresh.found is not None
    assert sight_of(report(S, 3), kept, KnownLine(), camera, guidance, 16.0, S + S // 2 + 1) is None


def test_a_frame_without_a_line_is_a_sight_without_a_line() -> None:
    camera, guidance = pinhole_intrinsics(CameraPlan()), guidance_settings(GuidancePlan())
    seen = sight_of(report(S, None), history(replace(STATE, t_ns=S)), KnownLine(), camera, guidance, 16.0, S)
    assert seen is not None
    assert seen.found is None


@pytest.mark.parametrize("trouble", Trouble)
def test_a_frame_that_nothing_can_be_seen_in_is_no_sight(trouble: Trouble) -> None:
    camera, guidance = pinhole_intrinsics(CameraPlan()), guidance_settings(GuidancePlan())
    troubled = replace(report(S, None), trouble=trouble)
    seen = sight_of(troubled, history(replace(STATE, t_ns=S)), KnownLine(), camera, guidance, 16.0, S)
    assert (seen is None) is (trouble in BLINDING)


def test_conductors_are_seen_from_left_to_right_whichever_way_the_image_line_is_counted() -> None:
    """Conductors across the image: one runs at 89 degrees, the next at -89, and both go the same way."""
    camera = pinhole_intrinsics(CameraPlan())
    conductors = (ImageLine(math.radians(89.0), -60.0), ImageLine(math.radians(-89.0), 0.0))
    estimate = replace(report(S, 2).estimate, angle_rad=math.pi / 2, offset_px=-30.0, conductors=conductors)  # type: ignore[type-var]
    view = view_of(estimate, replace(STATE, t_ns=S), camera, 16.0)
    assert view is not None
    slopes = [bearing.slope for bearing in view.along(math.pi / 2).conductors]
    assert slopes == pytest.approx([-60.0 / camera.fx_px, 0.0], abs=0.02)
    assert view.in_view[0] < -0.4
    assert view.in_view[1] > 0.4


def test_a_line_above_the_horizon_is_no_view() -> None:
    camera = pinhole_intrinsics(CameraPlan())
    estimate = report(S, 3).estimate
    assert estimate is not None
    assert view_of(estimate, replace(STATE, t_ns=S, pitch_rad=1.5), camera, 16.0) is None
