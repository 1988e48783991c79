"""Pre-flight: from what is known before arming to a list of checks. Pure; mission.preflight finds out the facts."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime

from mission.autopilot import AutopilotKind, FlightMode, Identity, LandedState, VehicleState
from mission.checks import Check, failed, passed, waiting, warning
from mission.estimate import FlightTotals, total
from mission.offline_checks import check_offline
from mission.parameter_checks import Extent, check_parameters
from mission.plan import MissionPlan

OLDEST_PX4 = (1, 14)
"""Older versions name parameters differently."""

MIN_FRAMES_HZ = 5.0
"""Flight time; with less, guidance steers by old estimates, and the way across a line does not tell how deep it is."""

_HOME = "home position"
_LOG_BYTES_PER_S = 60_000  # records, without frames
_LOG_BYTES_PER_FRAME = 150_000  # a 640 x 480 JPEG of grass, generously
_EARLIEST_YEAR = 2025  # a computer that booted without a clock says 1970, or when its system was built


@dataclass(frozen=True, slots=True)
class Facts:
    """What is known before arming; None is not known yet, or not to be had.

    `link_failure` is why no link comes about (a sentence), `frames_hz` the camera's rate in flight time, `free_bytes`
    what the log's disk has, `unix_s` the computer's clock. A mission that is resumed `may_fly` already.
    """

    is_linked: bool
    link_failure: str | None
    identity: Identity | None
    parameters: Mapping[str, float] | None
    state: VehicleState | None
    missing_health: tuple[str, ...]
    vision_failure: str | None
    vision_missing: str | None
    frames_hz: float | None
    free_bytes: int | None
    unix_s: float | None
    may_fly: bool = False

    @property
    def is_handed_over(self) -> bool:
        """Whether a pilot has left the flying vehicle to a mission that is resumed."""
        return self.may_fly and self.state is not None and is_handed_over(self.state)


def check_all(facts: Facts, plan: MissionPlan) -> list[Check]:
    """Every check of a mission, in the order in which people should read them."""
    totals = total(plan)
    vehicle = [_link(facts)]
    if facts.is_linked:
        vehicle += [
            _autopilot(facts.identity),
            _vehicle(facts),
            _health(facts),
            _home(facts.missing_health),
            _battery(facts.state, plan, totals),
            *_parameters(facts, plan, totals),
        ]
    return [
        *vehicle,
        *check_offline(plan),
        _camera(facts),
        _vision(facts),
        _disk(facts.free_bytes, plan, totals),
        _clock(facts.unix_s),
    ]


def not_at_rest(state: VehicleState) -> str | None:
    """Why a vehicle must not be armed by us now, in words; None when it stands disarmed on the ground.

    A vehicle that is armed or in the air is in somebody's hands: arming and take-off would take it from them.
    """
    if state.is_armed:
        return "the vehicle to be disarmed (it is armed: somebody may be flying it)"
    if state.landed is not LandedState.ON_GROUND:
        return "the vehicle to stand on the ground"
    return None


def is_handed_over(state: VehicleState) -> bool:
    """Whether a pilot has left a flying vehicle hovering in hold mode, from where a mission may be resumed."""
    is_hovering = state.landed is LandedState.IN_AIR and state.mode is FlightMode.HOLD
    return state.is_armed and is_hovering and not state.is_failsafe


def _link(facts: Facts) -> Check:
    if facts.link_failure is not None:
        return failed("link", facts.link_failure)
    if not facts.is_linked:
        return waiting("link", "an autopilot on the link")
    if facts.state is None:
        return waiting("link", "telemetry")
    if not facts.state.is_connected:
        return waiting("link", "the autopilot's heartbeat, which stopped")
    return passed("link", "telemetry comes")


def _autopilot(identity: Identity | None) -> Check:
    if identity is None:
        return waiting("autopilot", "the autopilot's name and version")
    words = f"{identity.kind} {identity.version}".strip()
    if identity.kind is AutopilotKind.ARDUPILOT:
        return warning("autopilot", f"{words}: its parameters are not checked; see that its failsafes return home")
    if identity.kind is AutopilotKind.UNKNOWN:
        return warning("autopilot", "it does not say that it is PX4: what it does by itself is not checked")
    if not identity.version:
        return warning("autopilot", f"{words} does not tell its version")
    if _version(identity.version) < OLDEST_PX4:
        oldest = ".".join(map(str, OLDEST_PX4))
        return warning("autopilot", f"{words} is older than {oldest}, which nobody has tried; update it")
    return passed("autopilot", words)


def _version(text: str) -> tuple[int, ...]:
    return tuple(int(part) for part in text.split(".") if part.isdigit())


def _vehicle(facts: Facts) -> Check:
    if facts.is_handed_over:
        return passed("vehicle", "it hovers in hold mode")
    rest = "telemetry" if facts.state is None else not_at_rest(facts.state)
    if rest is None:
        return passed("vehicle", "it stands disarmed on the ground")
    return waiting("vehicle", f"{rest}, or to hover in hold mode" if facts.may_fly else rest)


def _health(facts: Facts) -> Check:
    if facts.is_handed_over:  # what it needs for arming does not matter any more; its position does
        is_ok = facts.state is not None and facts.state.is_position_ok
        return passed("health", "it knows where it is") if is_ok else waiting("health", "a good position")
    others = [words for words in facts.missing_health if words != _HOME]
    return waiting("health", ", ".join(others)) if others else passed("health", "the autopilot would arm")


def _home(missing: tuple[str, ...]) -> Check:
    return waiting("home", _HOME) if _HOME in missing else passed("home", "the autopilot knows where home is")


def _battery(state: VehicleState | None, plan: MissionPlan, totals: FlightTotals) -> Check:
    if state is None:
        return waiting("battery", "telemetry")
    if state.battery is None:
        return warning("battery", "nothing tells its charge: no low battery will end this flight; watch the time")
    reserve = plan.safety.battery_low_percent / 100
    needed = reserve + totals.energy_wh / plan.vehicle.battery_wh
    words = f"{state.battery:.0%} of {plan.vehicle.battery_wh:g} Wh"
    if state.battery < needed:
        return failed(
            "battery", f"{words}, but the flight and {reserve:.0%} of reserve need {needed:.0%}; change the battery"
        )
    return passed("battery", f"{words}; the flight and its reserve need {needed:.0%}")


def _parameters(facts: Facts, plan: MissionPlan, totals: FlightTotals) -> list[Check]:
    if facts.identity is not None and facts.identity.kind is not AutopilotKind.PX4:
        return []  # the check of the autopilot says that they are not checked
    if facts.parameters is None:
        return [waiting("parameters", "the autopilot's parameters")]
    return check_parameters(facts.parameters, plan, Extent(totals.reach_m, totals.highest_m))


def _camera(facts: Facts) -> Check:
    if facts.frames_hz is None:
        return waiting("camera", "frames of the camera")
    if facts.frames_hz < MIN_FRAMES_HZ:
        return warning("camera", f"only {facts.frames_hz:.1f} frames a second; see lineflight camera show")
    return passed("camera", f"{facts.frames_hz:.0f} frames a second")


def _vision(facts: Facts) -> Check:
    if facts.vision_failure is not None:
        return failed("vision", facts.vision_failure)
    if facts.vision_missing is not None:
        return waiting("vision", facts.vision_missing)
    return passed("vision", "it has worked on frames")


def _disk(free_bytes: int | None, plan: MissionPlan, totals: FlightTotals) -> Check:
    if free_bytes is None:
        return warning("disk", "how much room the log has is not known")
    log_bytes = totals.duration_s * (_LOG_BYTES_PER_S + plan.vision.log_rate_hz * _LOG_BYTES_PER_FRAME)
    words = f"{free_bytes / 1e6:.0f} MB free, the log needs about {log_bytes / 1e6:.0f} MB"
    if free_bytes < log_bytes:
        return failed("disk", f"{words}; make room, or name another folder with --log")
    if free_bytes < 3 * log_bytes:
        return warning("disk", f"{words}; make room soon")
    return passed("disk", words)


def _clock(unix_s: float | None) -> Check:
    if unix_s is None:
        return warning("clock", "the computer's clock is not known")
    now = datetime.fromtimestamp(unix_s, UTC)
    if now.year < _EARLIEST_YEAR:
        return warning("clock", f"the computer believes it is {now:%Y-%m-%d}: set its clock, the log is named by it")
    return passed("clock", f"{now:%Y-%m-%d %H:%M} UTC")
