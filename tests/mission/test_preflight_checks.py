"""Pre-flight: the table of every check that is not of a parameter, and the waiting around them."""

import asyncio
from collections.abc import Callable
from dataclasses import replace

import pytest

from mission.autopilot import AutopilotError, AutopilotKind, FlightMode, Identity, LandedState, VehicleState
from mission.camera_plan import pinhole_intrinsics
from mission.checks import Check
from mission.executive import Crew, Executive
from mission.hazards import ComputerView
from mission.journal import NoJournal
from mission.logbook import Logbook
from mission.offline_checks import check_offline
from mission.plan import VehiclePlan
from mission.preflight import wait_until_ready
from mission.preflight_checks import Facts, check_all
from mission.records import CheckResult, MissionEnded, PreflightCheck, Result
from mission.simulated.virtual_time import VirtualClock, run_virtually
from tests.mission.test_parameter_checks import GOOD
from tests.support.faulty_autopilot import FaultyAutopilot
from tests.support.flights import LINE_HEADING_RAD, LINE_POINT_NED_M, PAPERS, KeptLog, shipped
from tests.support.geometric_eyes import GeometricEyes

OK, WARNING, FAILED = CheckResult.OK, CheckResult.WARNING, CheckResult.FAILED
PLAN = shipped("follow_line")
AT_REST = VehicleState(
    0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, FlightMode.HOLD, False, LandedState.ON_GROUND, 0.98, True
)
OFFLINE = {check.name for check in check_offline(PLAN)}
PX4 = Identity(AutopilotKind.PX4, "1.16.1", "1f")
FINE = Facts(
    is_linked=True,
    link_failure=None,
    identity=PX4,
    parameters=GOOD,
    state=AT_REST,
    missing_health=(),
    vision_failure=None,
    vision_missing=None,
    frames_hz=29.9,
    free_bytes=10**11,
    unix_s=1_800_000_000.0,
)


def state(**changes: object) -> dict[str, object]:
    return {"state": replace(AT_REST, **changes)}


# Which check, what is other than fine, the result, words of the reason, whether it is waited for.
TABLE = [
    ("link", {"link_failure": "no autopilot was heard"}, FAILED, "no autopilot was heard", False),
    ("link", {"is_linked": False}, FAILED, "waiting for an autopilot on the link", True),
    ("link", {"state": None}, FAILED, "telemetry", True),
    ("link", state(is_connected=False), FAILED, "heartbeat", True),
    ("autopilot", {"identity": None}, FAILED, "name and version", True),
    ("autopilot", {"identity": replace(PX4, version="1.13.3")}, WARNING, "update it", False),
    ("autopilot", {"identity": replace(PX4, version="1.14.0")}, OK, "px4 1.14.0", False),
    ("autopilot", {"identity": replace(PX4, version="")}, WARNING, "does not tell its version", False),
    ("autopilot", {"identity": Identity(AutopilotKind.ARDUPILOT, "4.6.0", "")}, WARNING, "not checked", False),
    ("autopilot", {"identity": Identity(AutopilotKind.UNKNOWN, "", "")}, WARNING, "not checked", False),
    ("vehicle", {"state": None}, FAILED, "telemetry", True),
    ("vehicle", state(is_armed=True), FAILED, "somebody may be flying it", True),
    ("vehicle", state(landed=LandedState.IN_AIR), FAILED, "stand on the ground", True),
    ("vehicle", state(landed=LandedState.UNKNOWN), FAILED, "stand on the ground", True),
    ("health", {"missing_health": ("compass calibration",)}, FAILED, "compass calibration", True),
    ("home", {"missing_health": ("home position",)}, FAILED, "home position", True),
    ("battery", {"state": None}, FAILED, "telemetry", True),
    ("battery", state(battery=None), WARNING, "watch the time", False),
    ("battery", state(battery=0.3), FAILED, "change the battery", False),
    ("battery", state(battery=0.6), OK, "60%", False),
    ("parameters", {"parameters": None}, FAILED, "the autopilot's parameters", True),
    ("offboard_loss_action", {"parameters": GOOD | {"COM_OBL_RC_ACT": 0}}, FAILED, "set it to 3", False),
    ("camera", {"frames_hz": None}, FAILED, "frames of the camera", True),
    ("camera", {"frames_hz": 4.9}, WARNING, "4.9 frames a second", False),
    ("camera", {"frames_hz": 5.0}, OK, "5 frames a second", False),
    ("vision", {"vision_failure": "the worker died"}, FAILED, "the worker died", False),
    ("vision", {"vision_missing": "the first frame through vision"}, FAILED, "first frame", True),
    ("disk", {"free_bytes": None}, WARNING, "not known", False),
    ("disk", {"free_bytes": 10**7}, FAILED, "make room", False),
    ("disk", {"free_bytes": 2 * 10**8}, WARNING, "make room soon", False),
    ("clock", {"unix_s": 0.0}, WARNING, "1970-01-01", False),
    ("clock", {"unix_s": None}, WARNING, "not known", False),
]


def checks_of(changes: dict[str, object]) -> dict[str, Check]:
    checks = check_all(replace(FINE, **changes), PLAN)
    assert len({check.name for check in checks}) == len(checks)
    return {check.name: check for check in checks}


def test_all_is_fine_when_all_is_fine() -> None:
    assert {name: check.reason for name, check in checks_of({}).items() if check.result is not OK} == {}


@pytest.mark.parametrize(("name", "changes", "result", "words", "is_waited_for"), TABLE)
def test_each_case(name: str, changes: dict[str, object], result: CheckResult, words: str, is_waited_for: bool) -> None:
    check = checks_of(changes)[name]
    assert check.result is result
    assert words in check.reason
    assert bool(check.waits_for) == is_waited_for
    assert check.is_final == (result is FAILED and not is_waited_for)


def test_every_check_is_in_the_table_or_in_that_of_the_parameters() -> None:
    ours = {check.name for check in check_all(replace(FINE, parameters=None), PLAN)}
    assert ours == {name for name, *_ in TABLE if name != "offboard_loss_action"} | OFFLINE


def test_without_a_link_nothing_is_said_of_the_vehicle() -> None:
    assert set(checks_of({"is_linked": False})) == {"link", "camera", "vision", "disk", "clock"} | OFFLINE


def test_the_parameters_of_other_autopilots_are_not_checked() -> None:
    names = set(checks_of({"identity": Identity(AutopilotKind.ARDUPILOT, "", ""), "parameters": None}))
    assert not names & {"parameters", "offboard_loss_action", "return_altitude"}


# -- waiting -----------------------------------------------------------------------------------------------------------


def wait(
    spoil: Callable[[FaultyAutopilot, GeometricEyes], None], time_limit_s: float = 60.0
) -> tuple[dict[str, Check], float]:
    """The checks when waiting was over, and how long that took [s]."""

    async def waiting() -> tuple[dict[str, Check], float]:
        clock = VirtualClock()
        autopilot = FaultyAutopilot(clock)
        eyes = GeometricEyes(
            autopilot.true_pose, clock, pinhole_intrinsics(PLAN.camera), LINE_POINT_NED_M, LINE_HEADING_RAD
        )
        spoil(autopilot, eyes)
        plan = PLAN.model_copy(update={"vehicle": VehiclePlan(ready_time_limit_s=time_limit_s)})
        readiness = await wait_until_ready(
            autopilot, eyes, clock, plan, lambda: 10**12, lambda: False, lambda missing: None
        )
        return {check.name: check for check in readiness.checks}, asyncio.get_running_loop().time()

    return run_virtually(waiting())


def nothing(autopilot: FaultyAutopilot, eyes: GeometricEyes) -> None:
    pass


def test_a_sound_vehicle_gets_ready_without_a_warning() -> None:
    checks, took_s = wait(nothing)
    assert {name: check.reason for name, check in checks.items() if check.result is not OK} == {}
    assert took_s < 6.0  # its position takes 5 s


def test_bad_parameters_end_the_wait_at_once() -> None:
    def spoil(autopilot: FaultyAutopilot, eyes: GeometricEyes) -> None:
        autopilot.sim.set_parameter("COM_OBL_RC_ACT", 0)

    checks, took_s = wait(spoil)
    assert checks["offboard_loss_action"].is_final
    assert took_s < 2.0


def test_what_may_still_come_is_waited_for_until_the_limit() -> None:
    def spoil(autopilot: FaultyAutopilot, eyes: GeometricEyes) -> None:
        eyes.missing = "the first frame through vision"

    checks, took_s = wait(spoil, time_limit_s=30.0)
    assert [name for name, check in checks.items() if check.result is FAILED] == ["vision"]
    assert took_s == pytest.approx(30.0, abs=0.5)


def test_a_link_that_fails_is_told_with_its_reason() -> None:
    def spoil(autopilot: FaultyAutopilot, eyes: GeometricEyes) -> None:
        async def connect() -> None:
            raise AutopilotError("the connection nowhere does not open")

        autopilot.connect = connect

    checks, took_s = wait(spoil)
    assert checks["link"].reason == "the connection nowhere does not open"
    assert took_s < 2.0


def test_a_failure_that_lasts_a_moment_only_ends_nothing() -> None:
    def spoil(autopilot: FaultyAutopilot, eyes: GeometricEyes) -> None:
        autopilot.sim.battery.remaining = 0.1
        asyncio.get_running_loop().call_later(0.7, lambda: setattr(autopilot.sim.battery, "remaining", 1.0))

    checks, _ = wait(spoil)
    assert checks["battery"].result is OK


def test_a_refused_vehicle_is_never_armed_and_the_log_says_why() -> None:
    told: list[Check] = []

    async def flight() -> tuple[MissionEnded, KeptLog, FaultyAutopilot]:
        clock, log = VirtualClock(), KeptLog(lambda item: None)
        autopilot = FaultyAutopilot(clock)
        autopilot.sim.set_parameter("RTL_RETURN_ALT", 12.0)
        camera = pinhole_intrinsics(PLAN.camera)
        eyes = GeometricEyes(autopilot.true_pose, clock, camera, LINE_POINT_NED_M, LINE_HEADING_RAD)
        crew = Crew(autopilot, eyes, camera, log, Logbook(NoJournal(), PAPERS), ComputerView)
        executive = Executive(PLAN, crew, clock, on_checks=told.extend)
        ended = await executive.run()
        assert not executive.may_have_armed
        return ended, log, autopilot

    ended, log, autopilot = run_virtually(flight())
    assert ended.result is Result.FAILED
    assert "return altitude: RTL_RETURN_ALT is 12 m" in ended.reason
    assert autopilot.commands == []
    records = {item.name: item for item in log.items if isinstance(item, PreflightCheck)}
    assert records["return_altitude"].result is FAILED
    assert records["offboard_loss_action"].result is OK
    assert list(records) == [check.name for check in told]
