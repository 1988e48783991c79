"""The fault matrix: how a flight ends for every fault in every task. docs/safety.md shows it."""

import enum


class End(enum.StrEnum):
    """How a flight ends."""

    COMPLETED = "c"
    """The mission completes."""
    PAUSED = "p"
    """The task is paused, goes on, and the mission completes."""
    HOME = "H"
    """The mission ends early: landed at the take-off point, disarmed."""
    ELSEWHERE = "E"
    """Landed somewhere else, disarmed: the autopilot's own doing."""
    HOVERS = "o"
    """It hovers in its own mode until the low battery brings it home."""
    PILOT = "P"
    """The pilot has it, and nothing more is sent."""
    LOST = "X"
    """Nobody brings it down. It stands nowhere in the table."""


TASKS = (
    "takeoff",
    "ascend",
    "descend",
    "rotate",
    "hold",
    "move_forward",
    "move_until",
    "align",
    "follow_lines",
    "return",
    "land",
)
"""The columns of EXPECTED."""

# One letter of End for each task, in the order of TASKS.
EXPECTED = {
    "pilot_hold": "P P P P P P P P P P P",
    "pilot_return": "P P P P P P P P P c P",
    "pilot_land": "P P P P P P P P P c c",
    "pilot_sticks": "P P P P P P P P P P P",
    "kill_switch": "P P P P P P P P P P P",
    "link_lost": "o H H H H H H H H H H",
    "uplink_lost": "o H H H H H H H H c c",
    "telemetry_frozen": "H H H H H H H H H H H",
    "second_controller": "H H H H H H H H H c c",
    "setpoints_unanswered": "H H H H H H H H H c c",
    "stop_refused": "H H H H H H H H H H H",
    "stop_unanswered": "H H H H H H H H H H H",
    "internal_error": "H H H H H H H H H H H",
    "setpoint_nan": "H H H H H H H H H H H",
    "setpoint_low": "H H H H H H H H H H H",
    "task_failed": "H H H H H H H H H H H",
    "task_too_long": "H H H H H H H H H H H",
    "battery_low": "H H H H H H H H H H H",
    "battery_critical": "H H H H H H H H H H H",
    "battery_collapses": "H H H H H H H E E H H",
    "gps_lost": "c E c c E E E E E c c",
    "gps_flickers": "c c c c c c c c c c c",
    "operator_stop": "H H H H H H H H H H H",
    "operator_land": "H H H H H H H H H H H",
    "operator_hold": "o o o o o o o E E o o",
    "operator_hold_unanswered": "o o o o o o o E E o o",
    "fence": "H H H H H H H H H c c",
    "gale": "H H H H c H H H H E E",
    "vision_dead": "c c c c c c H H H c c",
    "eyes_raise": "c c c c c c H H H c c",
    "camera_gone": "c c c c c c H H H c c",
    "camera_flickers": "c c c c c c p p p c c",
    "camera_frozen": "c c c c c c H H H c c",
    "estimates_pause": "c c c c c c p p p c c",
    "line_gone": "c c c c c c H H H c c",
    "line_hidden": "c c c c c c c p p c c",
    "guard_dead": "H H H H H H H H H H H",
    "cpu_overload": "H H H H H H H H H H H",
    "loop_stalls": "c c c c c c c c c c c",
    "disk_full": "c c c c c c c c c c c",
    "log_failing": "c c c c c c c c c c c",
    "mission_changed": "c c c c c c c c c c c",
}


def expected(fault: str, task: str) -> End:
    """How the flight must end."""
    return End(EXPECTED[fault].split()[TASKS.index(task)])
