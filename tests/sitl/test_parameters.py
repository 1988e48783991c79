"""Parameters keep PX4's names and types."""

import pytest

from sitl.parameters import DEFAULTS, Parameters


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
