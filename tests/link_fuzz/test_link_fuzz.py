"""Whatever another station sends to the port that the mission listens on, nothing of ours falls over."""

import itertools
from concurrent.futures import ThreadPoolExecutor

import pytest
from pymavlink.dialects.v20 import all as dialect

from mission.safety import Hazard
from mission.simulated.simulation import free_udp_port
from tests.link_fuzz.flight_through import Ended, fly_through
from tests.link_fuzz.lies import strangers_lies, vehicles_lies

OFFBOARD = 6  # PX4's main mode
N_STREAMS = 12  # that MavsdkAutopilot subscribes to
ONLY_THE_VEHICLE_TELLS = {
    Hazard.TAKEOVER,
    Hazard.AUTOPILOT_FAILSAFE,
    Hazard.SECOND_CONTROLLER,
    Hazard.BATTERY_LOW,
    Hazard.BATTERY_CRITICAL,
    Hazard.GEOFENCE,
}


@pytest.fixture(scope="module")
def flights(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Ended]:
    """All flights, at the same time: strangers lie; the vehicle's own packets lie, first where it steers nothing."""
    streams = {
        "strangers": list(itertools.islice(strangers_lies(1), 100_000)),
        "vehicle": list(itertools.islice(vehicles_lies(2, is_steering=False), 40_000)),
        "steering": list(itertools.islice(vehicles_lies(3, is_steering=True), 20_000)),
    }
    ports: set[int] = set()
    while len(ports) < len(streams):
        ports.add(free_udp_port())
    with ThreadPoolExecutor(len(streams)) as pool:
        flying = {
            name: pool.submit(fly_through, packets, port, tmp_path_factory.mktemp(name))
            for (name, packets), port in zip(streams.items(), ports, strict=True)
        }
        return {name: flight.result() for name, flight in flying.items()}


@pytest.mark.parametrize("name", ["strangers", "vehicle", "steering"])
def test_nothing_of_ours_falls_over(flights: dict[str, Ended], name: str) -> None:
    ended = flights[name]
    assert ended.returncode == 0, ended.err[-2000:]
    outcome = ended.outcome
    assert outcome["faults"] == []
    assert outcome["log_failure"] is None
    assert Hazard.INTERNAL_ERROR not in outcome["events"]
    assert "Traceback" not in ended.err
    assert "Fatal Python error" not in ended.err
    # A subscription that ends would leave the flight with what it told last.
    n_streams = [words["n_streams"] for words in ended.said if words.get("stage", "")[:1].isdigit()]
    assert set(n_streams) == {N_STREAMS}


@pytest.mark.parametrize("name", ["strangers", "vehicle", "steering"])
def test_in_flight_no_garbage_collection_looks_at_all_that_was_loaded(flights: dict[str, Ended], name: str) -> None:
    n_frozen = [words["n_frozen"] for words in flights[name].said if words.get("stage", "")[:1].isdigit()]
    assert min(n_frozen) > 10_000


@pytest.mark.parametrize("name", ["strangers", "vehicle", "steering"])
def test_the_mission_ends_as_declared(flights: dict[str, Ended], name: str) -> None:
    outcome = flights[name].outcome
    hazard = outcome["reason"].partition(":")[0].replace(" ", "_")
    assert outcome["result"] == "completed" or hazard in set(Hazard)


@pytest.mark.parametrize("name", ["strangers", "vehicle", "steering"])
def test_afterwards_the_autopilot_flies_by_itself(flights: dict[str, Ended], name: str) -> None:
    last = flights[name].heartbeats[-1]
    is_armed = bool(last.base_mode & dialect.MAV_MODE_FLAG_SAFETY_ARMED)
    assert not is_armed or (last.custom_mode >> 16) & 0xFF != OFFBOARD


def test_a_hundred_thousand_packets_came(flights: dict[str, Ended]) -> None:
    assert sum(ended.n_sent for ended in flights.values()) > 100_000
    for ended in flights.values():
        assert ended.n_lost < ended.n_sent / 2  # or they were thrown at the kernel, and not at the mission


def test_what_strangers_say_changes_nothing(flights: dict[str, Ended]) -> None:
    ended = flights["strangers"]
    assert ended.outcome["result"] == "completed"
    assert not ONLY_THE_VEHICLE_TELLS & set(ended.outcome["events"])


def test_lies_in_the_vehicles_name_were_heard(flights: dict[str, Ended]) -> None:
    assert flights["vehicle"].n_sent > 1_000
    assert flights["steering"].outcome["result"] != "completed"
    assert ONLY_THE_VEHICLE_TELLS & set(flights["steering"].outcome["events"])
