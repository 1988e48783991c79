"""One flight put together: vision worker, autopilot, executive and recorder, from connecting to the closed log."""

import asyncio
import contextlib
import functools
import gc
import json
import signal
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path

from drivers.camera.camera import Camera, Intrinsics
from drivers.clock import ScaledClock
from mission.attachments import flight_attachments
from mission.autopilot import VehicleState
from mission.autopilot_mavsdk import MavsdkAutopilot
from mission.build import vision_settings
from mission.checks import Check
from mission.executive import Crew, Executive
from mission.guard import Guard
from mission.journal import SUFFIX, DiskJournal
from mission.live.feed import LiveFeed, WatchedLog
from mission.live.settings import Briefing
from mission.log.disk import log_path
from mission.log.errors import LogError
from mission.log.recorder import Recorder
from mission.logbook import FlightPapers, Logbook
from mission.plan import MissionPlan
from mission.plan_file import MissionFile
from mission.records import Event, MissionEnded, Severity, TrueLine, TruePose
from mission.reporting import FlightLog, Progress
from mission.resumption import Resumption
from mission.surroundings import Surroundings, Watched
from mission.worker_eyes import WorkerEyes
from vision.worker import VisionWorker

STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""Ctrl-C, a service manager's stop, and a terminal or an SSH session that goes away."""

_PROGRESS_RATE_HZ = 5.0
_TRUTH_RATE_HZ = 20.0
_POSE_RATE_HZ = 100.0
_WATCH_RATE_HZ = 10.0


@dataclass(frozen=True, slots=True)
class FlightSetup:
    """What a flight is made of. `open_camera` is called in the vision worker.

    `true_line` and `truth` are known for a simulated vehicle alone: `truth` tells where it truly is, and what it has
    touched since it was last asked. `feed_pose` gets the telemetry where a camera is simulated for a vehicle that flies
    elsewhere. `remaining` is what is left of a mission that is resumed, and `resumption` where.
    """

    mission: MissionFile
    connection: str
    open_camera: Callable[[], Camera]
    clock: ScaledClock
    log_folder: Path
    metadata: dict[str, str]
    true_line: TrueLine | None = None
    truth: Callable[[], Sequence[TruePose | Event]] | None = None
    feed_pose: Callable[[VehicleState], None] | None = None
    remaining: MissionPlan | None = None
    resumption: Resumption | None = None

    @property
    def plan(self) -> MissionPlan:
        """What is flown: the mission, or what is left of it."""
        return self.mission.plan if self.remaining is None else self.remaining


@dataclass(frozen=True, slots=True)
class FlightOutcome:
    """How the flight ended, whether the vehicle may have been armed, and where its log is.

    `log_failure` says in a sentence why the log is not whole; None where it is.
    """

    ended: MissionEnded
    may_have_armed: bool
    log: Path
    log_failure: str | None


async def fly(
    setup: FlightSetup,
    on_progress: Callable[[Progress], None],
    on_checks: Callable[[Sequence[Check]], None],
    live: LiveFeed | None = None,
) -> FlightOutcome:
    """Fly the mission. STOP_SIGNALS end it by the mission's reaction, not by killing this process.

    `on_progress` hears a few times a second where the flight stands, `on_checks` once what pre-flight found. `live`
    shows all that the log keeps, and hears the operator's wishes.

    Raises LogError when log or journal cannot be made, and GuardError; then nothing was connected.
    """
    plan, clock = setup.plan, setup.clock
    path = log_path(setup.log_folder, plan.name, datetime.now(UTC))
    with (
        Guard() as guard,
        Recorder(
            path,
            mission_text=setup.mission.text,
            mission_name=plan.name,
            metadata=setup.metadata | camera_words(setup.mission.camera),
            clock=clock,
        ) as recorder,
    ):
        log: FlightLog = recorder
        if live is not None:
            live.record(Briefing(plan.name, tuple(task.task for task in plan.tasks)))
            live.record(recorder.mission)
            log = WatchedLog(recorder, live)
        journal = _open_journal(path.with_suffix(SUFFIX))
        camera = setup.mission.camera
        make_worker = functools.partial(
            VisionWorker, setup.open_camera, vision_settings(plan, camera), clock, plan.vision.log_rate_hz
        )
        eyes = WorkerEyes(make_worker, clock, clock.wall_s(1.0 / plan.camera.rate_hz))
        autopilot = MavsdkAutopilot(
            setup.connection,
            clock,
            lambda text: log.record_status_text(clock.now_ns(), f"mavsdk {text}"),
            log.record,
        )
        surroundings = Surroundings(
            Watched(
                path.parent,
                setup.mission.path,
                setup.mission.sha256,
                lambda: recorder.failure,
                lambda: journal.failure,
                lambda: guard.failure,
            )
        )
        for item in (camera, *flight_attachments(setup.mission, plan)):
            log.record(item)
        logbook = Logbook(journal, _papers(setup, path))
        crew = Crew(autopilot, eyes, camera, log, logbook, surroundings.view)
        executive = Executive(plan, crew, clock, setup.resumption, lambda checks: _before_arming(checks, on_checks))
        if setup.true_line is not None:
            log.record(setup.true_line)
        eyes.start()
        with stop_signals(executive.request_stop):
            beating = asyncio.create_task(guard.beat(lambda: executive.tick_s))
            sides = [
                asyncio.create_task(surroundings.watch()),
                asyncio.create_task(_every(_PROGRESS_RATE_HZ, 1.0, lambda: on_progress(executive.progress))),
            ]
            if setup.truth is not None:
                sides.append(asyncio.create_task(_record_truth(setup.truth, log, clock)))
            if setup.feed_pose is not None:
                sides.append(asyncio.create_task(_feed(setup.feed_pose, autopilot)))
            if live is not None:
                sides.append(asyncio.create_task(be_watched(live, executive, log, clock)))
            try:
                ended = await executive.run()
            finally:
                gc.unfreeze()
                for side in sides:
                    side.cancel()
                await asyncio.gather(*sides, return_exceptions=True)
                try:
                    await autopilot.close()
                finally:  # guarded until the stream of setpoints has ended
                    beating.cancel()
                    await asyncio.gather(beating, return_exceptions=True)
                    eyes.stop()
                await journal.close()
        on_progress(executive.progress)
        if live is not None:
            live.show(executive.progress)
    return FlightOutcome(ended, executive.may_have_armed, path, recorder.failure)


def _before_arming(checks: Sequence[Check], on_checks: Callable[[Sequence[Check]], None]) -> None:
    """Tell what was found, and take what the program has loaded by now out of garbage collections.

    A full collection looks at all of it and takes 80 ms, several times that on a small computer: the control loop would
    be late by so much, and its guard is patient for half a second only. What is left is a few milliseconds' work.
    """
    on_checks(checks)
    gc.collect()
    gc.freeze()


def _open_journal(path: Path) -> DiskJournal:
    try:
        return DiskJournal(path)
    except OSError as error:
        raise LogError(f"The journal {path} cannot be made ({error.strerror}); name a folder to write to.") from None


def _papers(setup: FlightSetup, log: Path) -> FlightPapers:
    mission = setup.mission
    return FlightPapers(
        mission=setup.plan.name,
        mission_path=str(mission.path.resolve()),
        mission_sha256=mission.sha256,
        connection=setup.connection,
        camera=setup.metadata.get("camera", setup.metadata["command"]),
        log=str(log),
    )


def camera_words(camera: Intrinsics) -> dict[str, str]:
    """The camera as the log keeps it: what offsets and angles are worth cannot be told without it."""
    return {"camera_intrinsics": json.dumps(asdict(camera))}


async def _every(rate_hz: float, speed: float, act: Callable[[], None]) -> None:
    while True:
        act()
        await asyncio.sleep(1.0 / (rate_hz * speed))


async def _record_truth(truth: Callable[[], Sequence[TruePose | Event]], log: FlightLog, clock: ScaledClock) -> None:
    def act() -> None:
        for record in truth():
            log.record(record)

    try:
        await _every(_TRUTH_RATE_HZ, clock.speed, act)
    finally:  # what it touched last belongs to the flight, too
        act()


async def be_watched(live: LiveFeed, executive: Executive, log: FlightLog, clock: ScaledClock) -> None:
    """Show the progress, and pass the operator's wishes on; a live view that has died is told once."""
    is_told = False

    def act() -> None:
        nonlocal is_told
        live.show(executive.progress)
        for wish in live.wishes():
            executive.request(wish)
        if live.failure is not None and not is_told:
            is_told = True
            log.record(Event(clock.now_ns(), "live_view_lost", Severity.WARNING, live.failure))

    await _every(_WATCH_RATE_HZ, 1.0, act)


async def _feed(feed_pose: Callable[[VehicleState], None], autopilot: MavsdkAutopilot) -> None:
    def act() -> None:
        state = autopilot.state
        if state is not None:
            feed_pose(state)

    await _every(_POSE_RATE_HZ, 1.0, act)


@contextlib.contextmanager
def stop_signals(stop: Callable[[], None]) -> Iterator[None]:
    """Let STOP_SIGNALS end the flight in order, however often they come."""
    loop = asyncio.get_running_loop()
    for number in STOP_SIGNALS:
        loop.add_signal_handler(number, stop)
    try:
        yield
    finally:
        for number in STOP_SIGNALS:
            loop.remove_signal_handler(number)
