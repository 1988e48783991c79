"""A flight of hours in virtual time, and what the program holds while it flies."""

import asyncio
import gc
import math
import os
import sys
import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TextIO

from mission.autopilot import Setpoint
from mission.camera_plan import pinhole_intrinsics
from mission.executive import Crew, Executive
from mission.hazards import ComputerView
from mission.journal import NoJournal
from mission.logbook import Logbook
from mission.plan import MissionPlan
from mission.records import TaskStarted
from mission.simulated.virtual_time import VirtualClock, run_virtually
from sitl.autopilot import SimAutopilot
from sitl.parameters import Parameters
from sitl.setup import SETUP
from sitl.vehicle import Vehicle
from tests.support.faulty_autopilot import FaultyAutopilot
from tests.support.flights import LINE_HEADING_RAD, LINE_POINT_NED_M, PAPERS, START_YAW_RAD
from tests.support.geometric_eyes import GeometricEyes

_LEG_M = 100.0  # the line that the geometric eyes know is 120 m long, and the vehicle comes to its middle
_SPEED_M_S = 1.5


@dataclass(frozen=True, slots=True)
class Held:
    """What the program holds at a time of the flight [s]: blocks of Python's allocator, memory, tasks, threads, files.

    A Python object is a block or more, so that nothing can be kept without one; memory tells of buffers that grow.
    """

    at_s: float
    n_blocks: int
    memory_mb: float
    n_tasks: int
    n_threads: int
    n_files: int


class FlightLogWithoutMemory:
    """A mission.reporting.FlightLog that keeps nothing; `on_task` hears of each task that starts."""

    def __init__(self, on_task: Callable[[TaskStarted], None]) -> None:
        self._on_task = on_task

    def record(self, item: object) -> None:
        if isinstance(item, TaskStarted):
            self._on_task(item)

    def record_setpoint(self, t_ns: int, setpoint: Setpoint) -> None:
        pass

    def record_status_text(self, t_ns: int, text: str) -> None:
        pass


class LeakingLog(FlightLogWithoutMemory):
    """Leaks in every way: a number and a hundred bytes in each tick; a task, a thread and a file with each task."""

    def __init__(self, on_task: Callable[[TaskStarted], None]) -> None:
        super().__init__(on_task)
        self._numbers: list[float] = []
        self._bytes = bytearray()
        self._files: list[TextIO] = []
        self._end = threading.Event()
        self._tasks: list[asyncio.Task[bool]] = []

    def record(self, item: object) -> None:
        super().record(item)
        if isinstance(item, TaskStarted):
            self._files.append(Path(os.devnull).open(encoding="ascii"))  # noqa: SIM115
            self._tasks.append(asyncio.ensure_future(asyncio.Event().wait()))
            threading.Thread(target=self._end.wait, daemon=True).start()

    def record_setpoint(self, t_ns: int, setpoint: Setpoint) -> None:
        self._numbers.append(setpoint.north_m + 1.0)
        self._bytes += bytes(500)

    def close(self) -> None:
        """Leave the process as it was."""
        self._end.set()
        for file in self._files:
            file.close()
        for task in self._tasks:
            task.cancel()


def long_plan(n_tasks: int) -> MissionPlan:
    """Out and back along the line, again and again; each leg with its turn takes 73 s."""
    head: list[dict[str, Any]] = [
        {"task": "takeoff"},
        {"task": "ascend", "altitude_m": 16},
        {"task": "move_until"},
        {"task": "align", "turn": "right"},
        {"task": "follow_lines", "distance_m": _LEG_M / 2},
        {"task": "rotate", "angle_deg": 180},
    ]
    legs: list[dict[str, Any]] = [{"task": "follow_lines", "distance_m": _LEG_M}, {"task": "rotate", "angle_deg": 180}]
    return MissionPlan.model_validate(
        {
            "version": 1,
            "name": "long",
            "tasks": [*head, *legs * ((n_tasks - len(head) - 1) // 2), {"task": "return"}],
            "vehicle": {"battery_wh": 10000},
            "guidance": {"r_m_s": _SPEED_M_S},
        }
    )


def hold_now() -> Held:
    """Look at what is held now."""
    gc.collect()
    n_pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return Held(
        at_s=asyncio.get_running_loop().time(),
        n_blocks=sys.getallocatedblocks(),
        memory_mb=n_pages * os.sysconf("SC_PAGESIZE") / 1e6,
        n_tasks=len(asyncio.all_tasks()),
        n_threads=threading.active_count(),
        n_files=sum(1 for _ in Path("/proc/self/fd").iterdir()),
    )


def fly_long(n_tasks: int, *, is_leaking: bool) -> tuple[str, list[Held]]:
    """Fly on a pack that is always full; how it ended, and what was held at the start of every fourth turn."""
    held: list[Held] = []
    plan = long_plan(n_tasks)

    def on_task(started: TaskStarted) -> None:
        if started.task == "rotate" and started.index % 8 == 5:
            held.append(hold_now())

    async def flight() -> str:
        clock = VirtualClock()
        vehicle = Vehicle(yaw_rad=START_YAW_RAD)
        # No noise, and the largest steps that fly: the vehicle is not what is tested, and takes most of the time.
        sim = SimAutopilot(vehicle, parameters=Parameters(SETUP), is_noisy=False)
        autopilot = FaultyAutopilot(clock, sim=sim, step_s=0.025)
        autopilot.after_step.append(lambda: setattr(sim.battery, "remaining", 1.0))
        camera = pinhole_intrinsics(plan.camera)
        eyes = GeometricEyes(autopilot.true_pose, clock, camera, LINE_POINT_NED_M, LINE_HEADING_RAD)
        log = LeakingLog(on_task) if is_leaking else FlightLogWithoutMemory(on_task)
        crew = Crew(autopilot, eyes, camera, log, Logbook(NoJournal(), PAPERS), ComputerView)
        ended = await Executive(plan, crew, clock).run()
        if isinstance(log, LeakingLog):
            log.close()
            await asyncio.sleep(0.0)
        return str(ended.result)

    return run_virtually(flight()), held


def growth_per_hour(held: list[Held], figure: str) -> float:
    """By how much a figure has grown in an hour from the first to the last of `held`."""
    first, last = held[0], held[-1]
    grown = getattr(last, figure) - getattr(first, figure)
    return math.inf if last.at_s <= first.at_s else float(grown) * 3600.0 / (last.at_s - first.at_s)
