"""The model's step responses beside those of a real PX4 (tests/sitl/golden/px4_a_nominal.json)."""

import json
import math
from pathlib import Path

import pytest

from tests.sitl.nominal_flight import Moments, figures, fly_nominal

GOLDEN = json.loads((Path(__file__).parent / "golden" / "px4_a_nominal.json").read_text())

# Allowed relative difference, and what noise may add in the figure's own unit. The leg has more room: the recorded
# vehicle (PX4's SIH) has a drag of 1 1/s, more than a real multirotor, and so is slower at the same tilt.
TOLERANCES = {
    "takeoff_half_metre_s": (0.10, 0.1),
    "climb_speed_m_s": (0.05, 0.05),
    "climb_to_8_m_s": (0.05, 0.1),
    "leg_peak_speed_m_s": (0.12, 0.0),
    "leg_half_way_s": (0.10, 0.0),
    "leg_within_1_m_s": (0.14, 0.0),
    "leg_overshoot_m": (0.0, 0.4),
    "leg_sag_m": (0.0, 0.3),
    "turn_peak_rate_rad_s": (0.10, 0.0),
    "turn_90_percent_s": (0.08, 0.0),
    "turn_overshoot_rad": (0.0, math.radians(5)),
    "descent_speed_high_m_s": (0.12, 0.0),
    "descent_speed_mid_m_s": (0.12, 0.05),
    "descent_to_0m8_s": (0.15, 0.3),
}


@pytest.mark.parametrize("seed", [0, 3])
def test_step_responses_agree_with_the_recording(seed: int) -> None:
    samples, ground_down_m, north_m = fly_nominal(Moments(**GOLDEN["moments"]), seed, until_s=58.0)
    ours = figures(samples, Moments(**GOLDEN["moments"]), ground_down_m, north_m, math.pi / 2)
    assert ours.keys() == GOLDEN["figures"].keys() == TOLERANCES.keys()
    apart = {
        name: (wanted, ours[name])
        for name, wanted in GOLDEN["figures"].items()
        if abs(ours[name] - wanted) > TOLERANCES[name][0] * abs(wanted) + TOLERANCES[name][1]
    }
    assert not apart
