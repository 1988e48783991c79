"""Pre-flight checks of parameters: the table of what each value means for a flight over a power line."""

import pytest

from mission.checks import Check
from mission.parameter_checks import NAMES, Extent, check_parameters
from mission.plan import GuidancePlan, MissionPlan, ParameterCheck, SafetyPlan, VehiclePlan
from mission.records import CheckResult
from tests.support.flights import shipped

OK, WARNING, FAILED = CheckResult.OK, CheckResult.WARNING, CheckResult.FAILED
EXTENT = Extent(reach_m=50.0, highest_m=16.0)
GOOD = {
    "COM_OF_LOSS_T": 1.0,
    "COM_OBL_RC_ACT": 3.0,
    "COM_RC_OVERRIDE": 3.0,
    "RTL_RETURN_ALT": 30.0,
    "RTL_TYPE": 0.0,
    "MPC_XY_VEL_MAX": 12.0,
    "MPC_Z_VEL_MAX_UP": 3.0,
    "MPC_Z_VEL_MAX_DN": 1.5,
    "GF_ACTION": 2.0,
    "GF_MAX_HOR_DIST": 0.0,
    "GF_MAX_VER_DIST": 0.0,
    "COM_LOW_BAT_ACT": 3.0,
    "NAV_DLL_ACT": 0.0,
}

# Which check, what is other than good (None: the autopilot does not tell it), the result, words of the reason.
TABLE = [
    ("offboard_loss_time", {"COM_OF_LOSS_T": 0.49}, WARNING, "hiccup"),
    ("offboard_loss_time", {"COM_OF_LOSS_T": 0.5}, OK, "0.5 s"),
    ("offboard_loss_time", {"COM_OF_LOSS_T": 2.0}, OK, "2 s"),
    ("offboard_loss_time", {"COM_OF_LOSS_T": 2.1}, FAILED, "set it to at most 2"),
    ("offboard_loss_time", {"COM_OF_LOSS_T": None}, WARNING, "did not tell COM_OF_LOSS_T"),
    ("offboard_loss_action", {"COM_OBL_RC_ACT": 0}, FAILED, "sinks where it is"),
    ("offboard_loss_action", {"COM_OBL_RC_ACT": 1}, FAILED, "sinks where it is"),
    ("offboard_loss_action", {"COM_OBL_RC_ACT": 2}, FAILED, "falls"),
    ("offboard_loss_action", {"COM_OBL_RC_ACT": 3}, OK, "returns"),
    ("offboard_loss_action", {"COM_OBL_RC_ACT": 4}, FAILED, "that may be on the line"),
    ("offboard_loss_action", {"COM_OBL_RC_ACT": 5}, WARNING, "hovers"),
    ("offboard_loss_action", {"COM_OBL_RC_ACT": 6}, FAILED, "stops the motors"),
    ("offboard_loss_action", {"COM_OBL_RC_ACT": 7}, FAILED, "stops the motors"),
    ("offboard_loss_action", {"COM_OBL_RC_ACT": 8}, FAILED, "unknown here"),
    ("offboard_loss_action", {"COM_OBL_RC_ACT": None}, WARNING, "did not tell"),
    ("stick_takeover", {"COM_RC_OVERRIDE": 0}, WARNING, "only the mode switch"),
    ("stick_takeover", {"COM_RC_OVERRIDE": 1}, WARNING, "only the mode switch"),
    ("stick_takeover", {"COM_RC_OVERRIDE": 2}, OK, "sticks take over"),
    ("stick_takeover", {"COM_RC_OVERRIDE": 3}, OK, "sticks take over"),
    ("stick_takeover", {"COM_RC_OVERRIDE": None}, OK, "not checked"),
    ("return_altitude", {"RTL_RETURN_ALT": 15.9}, FAILED, "the mission flies at 16 m"),
    ("return_altitude", {"RTL_RETURN_ALT": 16.0}, OK, "16 m"),
    ("return_altitude", {"RTL_RETURN_ALT": 60.0}, WARNING, "not below the fence"),
    ("return_altitude", {"RTL_TYPE": 1}, WARNING, "RTL_TYPE is 1"),
    ("return_altitude", {"RTL_TYPE": None}, OK, "30 m"),
    ("return_altitude", {"RTL_RETURN_ALT": None}, WARNING, "did not tell"),
    ("speeds", {"MPC_XY_VEL_MAX": 2.4}, WARNING, "guidance.r_m_s is 2.5"),
    ("speeds", {"MPC_Z_VEL_MAX_UP": 1.9}, WARNING, "guidance.climb_m_s is 2"),
    ("speeds", {"MPC_Z_VEL_MAX_DN": 1.4}, WARNING, "guidance.descend_m_s is 1.5"),
    ("speeds", {"MPC_XY_VEL_MAX": None, "MPC_Z_VEL_MAX_UP": None, "MPC_Z_VEL_MAX_DN": None}, OK, "not checked"),
    ("autopilot_fence", {"GF_MAX_HOR_DIST": 49.0}, FAILED, "the mission flies about 50 m far"),
    ("autopilot_fence", {"GF_MAX_HOR_DIST": 50.0}, OK, "within"),
    ("autopilot_fence", {"GF_MAX_VER_DIST": 15.0}, FAILED, "the mission flies about 16 m high"),
    ("autopilot_fence", {"GF_MAX_VER_DIST": 15.0, "GF_ACTION": 1}, OK, "no fence of its own that acts"),
    ("autopilot_fence", {"GF_MAX_VER_DIST": 50.0, "GF_ACTION": 4}, FAILED, "stops the motors"),
    ("autopilot_fence", {"GF_MAX_VER_DIST": 50.0, "GF_ACTION": 5}, WARNING, "lands"),
    ("autopilot_fence", {"GF_ACTION": 4}, OK, "no fence of its own that acts"),
    ("autopilot_fence", {"GF_ACTION": None}, OK, "not checked"),
    ("low_battery_action", {"COM_LOW_BAT_ACT": 0}, WARNING, "only warns"),
    ("low_battery_action", {"COM_LOW_BAT_ACT": 2}, WARNING, "lands"),
    ("low_battery_action", {"COM_LOW_BAT_ACT": None}, OK, "not checked"),
    ("station_loss_action", {"NAV_DLL_ACT": 0}, OK, "nothing happens"),
    ("station_loss_action", {"NAV_DLL_ACT": 2}, WARNING, "take the vehicle from its pilot"),
    ("station_loss_action", {"NAV_DLL_ACT": None}, OK, "not checked"),
]  # fmt: skip


def checks_of(changes: dict[str, float | None], plan: MissionPlan | None = None) -> dict[str, Check]:
    parameters = {name: value for name, value in (GOOD | changes).items() if value is not None}
    return {check.name: check for check in check_parameters(parameters, plan or plain_plan(), EXTENT)}


def plain_plan(**sections: object) -> MissionPlan:
    return shipped("follow_line").model_copy(update={"safety": SafetyPlan(), **sections})


def test_good_parameters_pass_without_a_warning() -> None:
    assert set(GOOD) == set(NAMES)
    assert {name: check.result for name, check in checks_of({}).items() if check.result is not OK} == {}


def test_a_mission_can_name_each_check() -> None:
    assert set(checks_of({})) == set(ParameterCheck.__args__)


@pytest.mark.parametrize(("name", "changes", "result", "words"), TABLE)
def test_each_value(name: str, changes: dict[str, float | None], result: CheckResult, words: str) -> None:
    checks = checks_of(changes)
    assert checks[name].result is result
    assert words in checks[name].reason
    assert all(check.result is OK for other, check in checks.items() if other != name)


def test_every_failure_says_what_to_do() -> None:
    for name, changes, result, _ in TABLE:
        if result is FAILED:
            reason = checks_of(changes)[name].reason
            assert any(word in reason for word in ("set it to", "widen it")), reason


def test_every_check_can_fail_or_warn() -> None:
    assert {name for name, _, result, _ in TABLE if result is not OK} == set(ParameterCheck.__args__)


@pytest.mark.parametrize(("altitude_m", "result"), [(12.9, FAILED), (13.0, OK)])
def test_the_return_clears_a_line_of_known_height(altitude_m: float, result: CheckResult) -> None:
    plan = plain_plan(safety=SafetyPlan(line_height_m=10.0, min_clearance_m=3.0))
    assert checks_of({"RTL_RETURN_ALT": altitude_m}, plan)["return_altitude"].result is result


def test_speeds_are_the_missions_own() -> None:
    plan = plain_plan(guidance=GuidancePlan(r_m_s=5.0))
    assert checks_of({"MPC_XY_VEL_MAX": 4.0}, plan)["speeds"].result is WARNING


def test_what_the_mission_accepts_warns_only() -> None:
    plan = plain_plan(vehicle=VehiclePlan(accept=["offboard_loss_action"]))
    checks = checks_of({"COM_OBL_RC_ACT": 4, "COM_OF_LOSS_T": 9.0}, plan)
    assert checks["offboard_loss_action"].result is WARNING
    assert "accepted by the mission" in checks["offboard_loss_action"].reason
    assert checks["offboard_loss_time"].result is FAILED
