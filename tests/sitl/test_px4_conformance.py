"""The simulated autopilot answers as a recorded PX4 v1.16.1 did, in every recorded scenario."""

from pathlib import Path

import pytest

from tests.sitl.comparison import differences
from tests.sitl.replay import load, play_px4

GOLDEN = Path(__file__).parent / "golden" / "px4"
SCENARIOS = sorted(path.stem for path in GOLDEN.glob("*.json"))

EVERYWHERE = {
    "parameter (CAL_|COM_FLIGHT_UUID|LND_FLIGHT_)": "after a flight PX4 writes down what it learnt of its sensors",
}
"""What is left out, as a pattern of `comparison.written`, and why: everywhere, and by scenario."""
EXCEPTIONS = {
    "b_offloss_land": {"message_ack 245 0x200 ": "a request of AUTOPILOT_VERSION was lost on the way"},
    "f_gpsloss": {"parameter SIM_GPS_USED": "PX4 answers the other station on that station's link alone"},
    "c_offstart_none": {"health .* 0x1?320c83f$": "PX4's next health report after the mode came 2 s late"},
    "g_arm_in_offboard": {"health .* 0x1?320[8c]83f$": "the same, and its position was good 2 s later than ever else"},
    "h_direct": {
        "ack 245 176 [01]": "the first setpoint came 0.2 ms before the command, too late for PX4's commander to see it",
        "text 2 Switching to Offboard": "the same",
    },
    "x_offloss_speed5": {"text 0 Accel #0 fail": "the recording machine was too slow"},
}


def test_there_are_recordings() -> None:
    assert len(SCENARIOS) > 30
    assert set(EXCEPTIONS) <= set(SCENARIOS)


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_it_answers_as_recorded(scenario: str) -> None:
    record = load(GOLDEN / f"{scenario}.json")
    found = differences(record, play_px4(record), EVERYWHERE | EXCEPTIONS.get(scenario, {}))
    assert not found, "\n".join(["", *found])
