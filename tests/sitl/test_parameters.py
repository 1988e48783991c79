"""Parameters keep PX4's names, types and ranges, and the vehicle bears every value within them."""

import math

import pytest

from sitl.autopilot import SimAutopilot
from sitl.modes import Answer
from sitl.parameters import DEFAULTS, LIMITS, Parameters


def test_defaults_are_px4s() -> None:
    parameters = Parameters()
    assert parameters.get("MIS_TAKEOFF_ALT") == 2.5
    assert parameters.get("COM_OF_LOSS_T") == 1.0
    assert parameters.parameter("COM_OBL_RC_ACT").is_integer
    assert not parameters.parameter("COM_OF_LOSS_T").is_integer


def test_every_parameter_is_found_at_its_index() -> None:
    parameters = Parameters()
    assert [parameters.at(parameter.index) for parameter in parameters.all()] == parameters.all()
    assert len(parameters.all()) == len(parameters) == len(DEFAULTS)


def test_names_fit_the_message() -> None:
    assert all(len(name) <= 16 for name in DEFAULTS)


def test_a_written_value_is_read_back() -> None:
    parameters = Parameters({"COM_OBL_RC_ACT": 3})
    parameters.set("MIS_TAKEOFF_ALT", 10.0)
    assert (parameters.get("COM_OBL_RC_ACT"), parameters.get("MIS_TAKEOFF_ALT")) == (3.0, 10.0)


@pytest.mark.parametrize(("name", "value"), [("COM_OBL_RC_ACT", 3.0), ("MIS_TAKEOFF_ALT", 10)])
def test_the_wrong_type_is_refused(name: str, value: float) -> None:
    with pytest.raises(TypeError, match=name):
        Parameters().set(name, value)


def test_an_unknown_name_is_refused() -> None:
    with pytest.raises(KeyError):
        Parameters().set("NO_SUCH_PARAM", 1.0)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, -0.1, 5.1])
def test_a_value_out_of_range_is_refused_and_the_old_one_stays(value: float) -> None:
    parameters = Parameters()
    with pytest.raises(ValueError, match=r"MPC_TKO_RAMP_T .* from 0\.0 to 5\.0"):
        parameters.set("MPC_TKO_RAMP_T", value)
    assert parameters.get("MPC_TKO_RAMP_T") == 3.0


def test_defaults_lie_within_their_limits_and_are_of_their_type() -> None:
    for name, default in DEFAULTS.items():
        least, greatest = LIMITS[name]
        assert least <= default <= greatest
        assert type(least) is type(default) is type(greatest)


@pytest.mark.parametrize("name", sorted(LIMITS))
def test_a_takeoff_bears_a_parameter_at_its_limits(name: str) -> None:
    for value in LIMITS[name]:
        autopilot = SimAutopilot(seed=1)
        while not autopilot.commander.is_armable:
            autopilot.step(0.01)
        assert autopilot.arm() is autopilot.takeoff() is Answer.ACCEPTED
        # Before the motors are up, so that the whole take-off is flown with it.
        autopilot.set_parameter(name, value)
        for _ in range(900):
            autopilot.step(0.01)
            n, e, d = autopilot.vehicle.position_m
            assert math.isfinite(n + e + d + autopilot.thrust)
            assert d <= 0.0


@pytest.mark.parametrize(("name", "value"), [("MPC_TKO_RAMP_T", 0.0), ("MC_YAW_WEIGHT", 0.0)])
def test_a_zero_that_px4_allows_still_takes_off(name: str, value: float) -> None:
    autopilot = SimAutopilot(seed=1, parameters=Parameters({name: value}))
    while not autopilot.commander.is_armable:
        autopilot.step(0.01)
    autopilot.arm()
    autopilot.takeoff()
    for _ in range(1000):
        autopilot.step(0.01)
    assert autopilot.vehicle.height_m == pytest.approx(2.2, abs=0.8)
