"""A scenario as options and as the log keeps it; what is said after a simulated flight."""

import math

from mission.simulated.aftermath import Aftermath
from mission.simulated.scenario import Scenario
from sitl import witness
from sitl.world.file import load_world


def test_the_options_stand_for_the_scenario() -> None:
    scenario = Scenario("hills", "dusk", 7, 8.0, math.radians(90.0), has_gust_fronts=True, airframe="x500")
    words = "--world hills --light dusk --wind 8 --wind-from 90 --airframe x500 --seed 7 --gust-fronts"
    assert " ".join(scenario.options) == words
    assert " ".join(Scenario().options) == "--wind 0 --seed 1"


def test_the_log_keeps_the_scenario() -> None:
    assert Scenario(light="dusk", wind_m_s=4.0).metadata == {
        "seed": "1", "wind_m_s": "4", "airframe": "f550", "light": "dusk",
    }  # fmt: skip


def test_a_contact_is_a_sentence() -> None:
    at = (1.0, 2.0, -9.5)
    testimony = witness.Testimony(conductor=witness.Nearness(0.3, at, 5), contact=witness.Contact("conductor", at, 5))
    aftermath = Aftermath(load_world(), 2.0, testimony)
    words = "The vehicle touched a conductor 1.0 m north and 2.0 m east of its start, 9.5 m up, and fell."
    assert aftermath.contact == words
    assert aftermath.clearances == "0.30 m to a conductor"
    assert aftermath.to_json()["clearance_m"] == {"conductor": 0.3, "support": None, "other": None}


def test_nothing_known_is_nothing_said() -> None:
    aftermath = Aftermath(load_world(), None, None)
    assert aftermath.contact is None
    assert aftermath.clearances is None
    assert aftermath.to_json() == {"achieved_speed": None, "contact": None, "clearance_m": None}
