"""A flight in virtual time that is logged with its truth, and read back: the executive, the vehicle, geometric eyes."""

import asyncio
import contextlib
import json
import math
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

from drivers.clock import NS_PER_S
from mission.camera_plan import pinhole_intrinsics
from mission.executive import Crew, Executive
from mission.journal import NoJournal
from mission.log.reader import Flight, read_flight
from mission.log.recorder import Recorder
from mission.logbook import Logbook
from mission.plan import MissionPlan
from mission.records import Attachment, TaskStarted, TrueLine, TruePose
from mission.simulated.virtual_time import VirtualClock, run_virtually
from sitl.autopilot import SimAutopilot
from sitl.parameters import Parameters
from sitl.setup import SETUP
from sitl.vehicle import Vehicle, euler_of
from sitl.wind import Wind
from tests.support.faulty_autopilot import FaultyAutopilot
from tests.support.flights import LINE_HEADING_RAD, LINE_POINT_NED_M, PAPERS, START_YAW_RAD, Cockpit, Computer
from tests.support.geometric_eyes import GeometricEyes

_TRUTH_PERIOD_NS = NS_PER_S // 20
_REACH_M = 200.0


@dataclass(frozen=True, slots=True)
class Bend:
    """The line turns by `turn_rad` to the right, `after_m` [m] beyond where the vehicle meets it."""

    after_m: float
    turn_rad: float


def _true_line(bend: Bend | None) -> TrueLine:
    north_m, east_m, down_m = LINE_POINT_NED_M

    def on_line(reach_m: float) -> tuple[float, float]:
        straight_m = reach_m if bend is None else min(reach_m, bend.after_m)
        turned_rad = LINE_HEADING_RAD + (0.0 if bend is None else bend.turn_rad)
        beyond_m = reach_m - straight_m
        return (
            north_m + straight_m * math.cos(LINE_HEADING_RAD) + beyond_m * math.cos(turned_rad),
            east_m + straight_m * math.sin(LINE_HEADING_RAD) + beyond_m * math.sin(turned_rad),
        )

    reaches_m = (-_REACH_M, _REACH_M) if bend is None else (-_REACH_M, bend.after_m, _REACH_M)
    ends = [on_line(reach_m) for reach_m in reaches_m]
    return TrueLine(tuple(ends), (tuple((*end, down_m) for end in ends),), ())


class _TellingRecorder(Recorder):
    """Says when a task starts, so that something can be done to the flight then."""

    on_task: Callable[[TaskStarted], None] = staticmethod(lambda started: None)

    def record(self, item: object) -> None:
        super().record(item)
        if isinstance(item, TaskStarted):
            self.on_task(item)


def fly_and_log(
    path: Path,
    plan: MissionPlan,
    *,
    wind: Wind,
    seed: int = 1,
    in_task: str,
    after_s: float,
    do: Callable[[Cockpit], None],
    nth: int = 1,
    bend: Bend | None = None,
    until: str | None = None,
    until_s: float | None = None,
) -> Flight:
    """Fly a plan; `do` is called once, `after_s` into the `nth` task named `in_task`. Returns what the log holds.

    The flight breaks off where a task named `until` begins, or `until_s` after `do`: what nobody looks at need not be
    flown.
    """

    async def flight() -> None:
        clock = VirtualClock()
        sim = SimAutopilot(Vehicle(yaw_rad=START_YAW_RAD), wind, seed=seed, parameters=Parameters(SETUP))
        autopilot = FaultyAutopilot(clock, sim=sim)
        camera = pinhole_intrinsics(plan.camera)
        eyes = GeometricEyes(autopilot.true_pose, clock, camera, LINE_POINT_NED_M, LINE_HEADING_RAD)
        computer = Computer()
        if bend is not None:
            eyes.bend_m, eyes.bend_rad = bend.after_m, bend.turn_rad
        n_begun = 0

        def on_task(started: TaskStarted) -> None:
            nonlocal n_begun
            if started.task == until:
                flying.cancel()
            n_begun += started.task == in_task
            if started.task == in_task and n_begun == nth:
                cockpit = Cockpit(executive, autopilot, eyes, computer)
                loop = asyncio.get_running_loop()
                loop.call_later(after_s, do, cockpit)
                if until_s is not None:
                    loop.call_later(after_s + until_s, flying.cancel)

        recorder = _TellingRecorder(path, mission_text="", mission_name=plan.name, metadata={}, clock=clock)
        recorder.on_task = on_task
        next_ns = 0

        def tell_truth() -> None:
            nonlocal next_ns
            now_ns = clock.now_ns()
            if now_ns >= next_ns:
                next_ns = now_ns + _TRUTH_PERIOD_NS
                vehicle = autopilot.sim.vehicle
                recorder.record(TruePose(now_ns, *vehicle.position_m, euler_of(vehicle.quaternion)[2]))

        with recorder:
            recorder.record(Attachment("camera.json", "application/json", json.dumps(asdict(camera)).encode()))
            recorder.record(_true_line(bend))
            autopilot.after_step.append(tell_truth)
            crew = Crew(autopilot, eyes, camera, recorder, Logbook(NoJournal(), PAPERS), lambda: computer.view)
            executive = Executive(plan, crew, clock)
            flying = asyncio.ensure_future(executive.run())
            with contextlib.suppress(asyncio.CancelledError):
                await flying
        assert n_begun >= nth, f"the flight never came to {in_task}"
        assert recorder.failure is None

    run_virtually(flight())
    return read_flight(path)
