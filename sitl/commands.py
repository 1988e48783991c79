"""MAVLink commands (COMMAND_LONG, COMMAND_INT) as PX4 v1.16 answers them, apart from those about messages."""

import math

from sitl.autopilot import SimAutopilot
from sitl.modes import Answer, Mode, Severity

RETURN_TO_LAUNCH = 20
LAND = 21
TAKEOFF = 22
DO_SET_MODE = 176
SET_ACTUATOR = 187
REBOOT = 246
MISSION_START = 300
ARM_DISARM = 400
RUN_PREARM_CHECKS = 401
INJECT_FAILURE = 420
FORCE = 21196
_UNIT_BATTERY, _TYPE_OFF = 100, 1  # FAILURE_UNIT, FAILURE_TYPE


def execute(autopilot: SimAutopilot, command: int, params: tuple[float, ...]) -> Answer:
    """Carry out the command number `command` with its seven `params`; returns the answer for COMMAND_ACK."""
    if command == ARM_DISARM:
        if _is(params[0], 1):
            return autopilot.arm()
        return autopilot.disarm(is_forced=_is(params[1], FORCE))
    if command == TAKEOFF:
        return autopilot.takeoff(params[6] if math.isfinite(params[6]) else None)
    if command == LAND:
        return autopilot.land()
    if command == RETURN_TO_LAUNCH:
        return autopilot.set_mode(Mode.RTL)
    if command == RUN_PREARM_CHECKS:
        return Answer.ACCEPTED  # the model's checks run all the time
    if command == DO_SET_MODE:
        return _set_mode(autopilot, params)
    if command == SET_ACTUATOR:
        return Answer.ACCEPTED  # nothing is connected
    if command == INJECT_FAILURE:
        return _inject_failure(autopilot, params)
    if command == MISSION_START:
        autopilot.say(Severity.CRITICAL, "Mission start denied! No valid mission")
        return Answer.DENIED
    if command == REBOOT:
        return Answer.DENIED if autopilot.is_armed else Answer.TEMPORARILY_REJECTED
    return Answer.UNSUPPORTED


def _inject_failure(autopilot: SimAutopilot, params: tuple[float, ...]) -> Answer:
    """Params: FAILURE_UNIT, FAILURE_TYPE. PX4's simulator lets the battery fail, and takes the rest as good."""
    if _is(params[0], _UNIT_BATTERY):
        autopilot.battery.has_failed = _is(params[1], _TYPE_OFF)
        return Answer.ACCEPTED
    return Answer.UNSUPPORTED


def _is(param: float, value: int) -> bool:
    return math.isfinite(param) and round(param) == value


def _set_mode(autopilot: SimAutopilot, params: tuple[float, ...]) -> Answer:
    """Params: base mode, PX4's main mode, its sub mode. An unknown mode is accepted and changes nothing."""
    main, sub = (round(value) if math.isfinite(value) else 0 for value in params[1:3])
    try:
        mode = Mode(main << 16 | (sub << 24 if main == Mode.LOITER >> 16 & 0xFF else 0))
    except ValueError:
        return Answer.ACCEPTED
    return autopilot.set_mode(mode)
