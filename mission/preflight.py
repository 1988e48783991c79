"""Before arming: connect, find out the facts, and wait until every check has passed."""

import asyncio
import contextlib
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from drivers.clock import NS_PER_S, Clock
from mission.autopilot import Autopilot, AutopilotError, AutopilotKind, FlightMode, Identity
from mission.checks import Check
from mission.eyes import Eyes
from mission.parameter_checks import NAMES
from mission.plan import MissionPlan
from mission.preflight_checks import Facts, check_all, not_at_rest
from mission.records import CheckResult
from vision.records import VisionReport

_POLL_S = 0.2
_FINAL_AFTER_S = 1.0
"""A failure that waiting does not mend must have stood so long [s, wall]: first telemetry may be half of the truth."""

_FRAMES_WINDOW = 30
_MIN_FRAMES = 3


@dataclass(frozen=True, slots=True)
class Readiness:
    """What the checks found, who flies the vehicle, and its parameters that were read (None: it did not say)."""

    checks: list[Check]
    identity: Identity | None
    parameters: Mapping[str, float] | None

    @property
    def failures(self) -> list[str]:
        """What keeps the vehicle on the ground, in sentences; empty when it may be armed."""
        return [check.line for check in self.checks if check.result is CheckResult.FAILED]


class _Answers:
    """What the autopilot answered so far; `failure` says why there is no link."""

    def __init__(self) -> None:
        self.is_linked = False
        self.failure: str | None = None
        self.identity: Identity | None = None
        self.parameters: Mapping[str, float] | None = None

    async def ask(self, autopilot: Autopilot) -> None:
        """Connect, then ask who it is and for its parameters; seconds of wall time, beside everything else."""
        try:
            await autopilot.connect()
            self.is_linked = True
            self.identity = await autopilot.identify()
            if self.identity.kind is AutopilotKind.PX4:
                self.parameters = await autopilot.read_parameters(NAMES)
        except AutopilotError as error:
            self.failure = str(error)


class _FrameRate:
    """The camera's rate from the frames that vision saw lately, those counted that it had no time for."""

    def __init__(self) -> None:
        self._seen: deque[tuple[int, int]] = deque(maxlen=_FRAMES_WINDOW)

    def add(self, reports: list[VisionReport]) -> None:
        """Take the newest reports."""
        for report in reports:
            if self._seen and report.seq <= self._seen[-1][0]:
                self._seen.clear()  # the camera was opened again
            self._seen.append((report.seq, report.t_capture_ns))

    @property
    def hz(self) -> float | None:
        """Frames a second of flight time; None before there were a few."""
        if len(self._seen) < _MIN_FRAMES:
            return None
        (first, first_ns), (last, last_ns) = self._seen[0], self._seen[-1]
        return (last - first) * NS_PER_S / (last_ns - first_ns) if last_ns > first_ns else None


async def wait_until_ready(
    autopilot: Autopilot,
    eyes: Eyes,
    clock: Clock,
    plan: MissionPlan,
    free_bytes: Callable[[], int | None],
    is_stopped: Callable[[], bool],
    tell: Callable[[tuple[str, ...]], None],
    *,
    may_fly: bool = False,
) -> Readiness:
    """Connect, wait, and return what every check found; the vehicle may be armed when none of them has failed.

    Waits for what may still come, at most vehicle.ready_time_limit_s [s, wall]: compiling and connecting take wall
    time, however fast the flight's clock runs. Returns early when `is_stopped`, and when a check has failed for good.
    `free_bytes` tells the room that the log has; `tell` hears what is being waited for. A mission that is resumed
    `may_fly` already.
    """
    loop = asyncio.get_running_loop()
    limit_s = loop.time() + plan.vehicle.ready_time_limit_s
    answers, frames = _Answers(), _FrameRate()
    asking = asyncio.create_task(answers.ask(autopilot))
    final_since_s: float | None = None
    has_left_offboard = False
    try:
        while True:
            frames.add(eyes.take())
            checks = check_all(_facts(autopilot, eyes, answers, frames, free_bytes(), may_fly=may_fly), plan)
            tell(tuple(dict.fromkeys(check.waits_for for check in checks if check.waits_for)))
            now_s = loop.time()
            if answers.is_linked and not has_left_offboard:
                has_left_offboard = await _leave_offboard(autopilot)
            has_failed = any(check.result is CheckResult.FAILED for check in checks)
            is_final = any(check.is_final for check in checks)
            final_since_s = None if not is_final else now_s if final_since_s is None else final_since_s
            is_over = final_since_s is not None and now_s - final_since_s >= _FINAL_AFTER_S
            if not has_failed or is_over or is_stopped() or now_s > limit_s:
                return Readiness(checks, answers.identity, answers.parameters)
            if asking.done():
                asking.result()  # a bug in there is ours to hear of
            await asyncio.sleep(clock.wall_s(_POLL_S))
    finally:
        asking.cancel()
        await asyncio.gather(asking, return_exceptions=True)


async def _leave_offboard(autopilot: Autopilot) -> bool:
    """A vehicle that a failsafe has landed stands in offboard, where PX4 does not arm: bring it to hold, once.

    Only one that stands disarmed on the ground; returns whether that was done.
    """
    state = autopilot.state
    if state is None or not_at_rest(state) is not None or state.mode is not FlightMode.OFFBOARD:
        return False
    with contextlib.suppress(AutopilotError):  # then it does not get ready, and the checks say so
        await autopilot.hold()
    return True


def _facts(
    autopilot: Autopilot,
    eyes: Eyes,
    answers: _Answers,
    frames: _FrameRate,
    free_bytes: int | None,
    *,
    may_fly: bool,
) -> Facts:
    return Facts(
        is_linked=answers.is_linked,
        link_failure=answers.failure,
        identity=answers.identity,
        parameters=answers.parameters,
        state=autopilot.state if answers.is_linked else None,
        missing_health=tuple(autopilot.missing_health()) if answers.is_linked else (),
        vision_failure=eyes.failure,
        vision_missing=eyes.missing,
        frames_hz=frames.hz,
        free_bytes=free_bytes,
        unix_s=time.time(),
        may_fly=may_fly,
    )
