"""The fault matrix: how a flight ends for every fault in every task. docs/safety.md shows it."""

import enum


class End(enum.Enum):
    """How a flight ends."""

    COMPLETED = "the mission goes on and completes"
    HOME = "the mission ends early; landed at the take-off point, disarmed"
    DOWN = "landed where it was, disarmed"
    PILOT = "the pilot has it"
    LOST = "nobody brings it down"
