"""Flying a mission in virtual time: the executive over the in-process vehicle and geometric eyes."""

import asyncio
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mission.autopilot import Setpoint
from mission.camera_plan import pinhole_intrinsics
from mission.executive import Crew, Executive
from mission.hazards import ComputerView
from mission.journal import Journal, NoJournal
from mission.logbook import FlightPapers, Logbook
from mission.plan import MissionPlan
from mission.plan_file import read_mission
from mission.records import Event, MissionEnded, TaskEnded, TaskStarted
from mission.resumption import Resumption
from mission.simulated.virtual_time import VirtualClock, run_virtually
from tests.support.faulty_autopilot import FaultyAutopilot
from tests.support.geometric_eyes import GeometricEyes

MISSIONS = Path(__file__).parents[2] / "missions"
START_YAW_RAD = math.radians(20.0)
LINE_HEADING_RAD = math.radians(110.0)
LINE_POINT_NED_M = (12.0 * math.cos(START_YAW_RAD), 12.0 * math.sin(START_YAW_RAD), -9.6)

ALL_TASKS_PLAN = read_mission(Path(__file__).parents[1] / "data" / "all_tasks.yaml").plan


class KeptLog:
    """A mission.reporting.FlightLog that keeps everything in a list."""

    def __init__(self, on_record: Callable[[object], None]) -> None:
        self.items: list[object] = []
        self.setpoints: list[tuple[int, Setpoint]] = []
        self.texts: list[str] = []
        self._on_record = on_record

    def record(self, item: object) -> None:
        self.items.append(item)
        self._on_record(item)

    def record_setpoint(self, t_ns: int, setpoint: Setpoint) -> None:
        self.setpoints.append((t_ns, setpoint))

    def record_status_text(self, t_ns: int, text: str) -> None:
        self.texts.append(text)


@dataclass
class Flown:
    """A flight that is over."""

    ended: MissionEnded
    log: KeptLog
    autopilot: FaultyAutopilot
    stages: list[str] = field(default_factory=list)

    def of(self, kind: type[Any]) -> list[Any]:
        """The log's records of a kind, in order."""
        return [item for item in self.log.items if isinstance(item, kind)]

    @property
    def story(self) -> list[str]:
        """The flight as readable lines: tasks, events, the end."""
        lines = []
        for item in self.log.items:
            if isinstance(item, TaskEnded):
                lines.append(f"{item.task} {item.result}")
            elif isinstance(item, Event):
                lines.append(f"! {item.name} -> {item.reaction}")
            elif isinstance(item, MissionEnded):
                lines.append(f"mission {item.result}")
        return lines


@dataclass
class Computer:
    """The companion computer as a test wants it."""

    view: ComputerView = field(default_factory=ComputerView)


@dataclass
class Cockpit:
    """What a test may touch while the flight goes on."""

    executive: Executive
    autopilot: FaultyAutopilot
    eyes: GeometricEyes
    computer: Computer


PAPERS = FlightPapers("test", "test.yaml", "00", "in-process", "geometric", "none")


def shipped(name: str) -> MissionPlan:
    """The plan of a shipped mission."""
    return read_mission(MISSIONS / f"{name}.yaml").plan


def bare_executive(
    plan: MissionPlan,
    autopilot: FaultyAutopilot,
    clock: VirtualClock,
    *,
    log: KeptLog | None = None,
    journal: Journal | None = None,
    resumption: Resumption | None = None,
) -> Executive:
    """An executive over a vehicle that somebody else has made, with eyes of its own."""
    camera = pinhole_intrinsics(plan.camera)
    eyes = GeometricEyes(autopilot.true_pose, clock, camera, LINE_POINT_NED_M, LINE_HEADING_RAD)
    logbook = Logbook(journal or NoJournal(), PAPERS)
    crew = Crew(autopilot, eyes, camera, log or KeptLog(lambda _: None), logbook, ComputerView)
    return Executive(plan, crew, clock, resumption)


def fly(
    plan: MissionPlan,
    *,
    wind_m_s: float = 0.0,
    seed: int = 1,
    in_task: str | None = None,
    after_s: float = 0.5,
    do: Callable[[Cockpit], None] | None = None,
) -> Flown:
    """Fly a plan to its end. `do` is called once, `after_s` into the first task named `in_task`."""

    async def flight() -> Flown:
        clock = VirtualClock()
        autopilot = FaultyAutopilot(clock, start_yaw_rad=START_YAW_RAD, wind_m_s=wind_m_s, seed=seed)
        camera = pinhole_intrinsics(plan.camera)
        eyes = GeometricEyes(autopilot.true_pose, clock, camera, LINE_POINT_NED_M, LINE_HEADING_RAD)
        computer = Computer()
        loop = asyncio.get_running_loop()
        has_done = False

        def on_record(item: object) -> None:
            nonlocal has_done
            if isinstance(item, TaskStarted) and item.task == in_task and do is not None and not has_done:
                has_done = True
                loop.call_later(after_s, do, Cockpit(executive, autopilot, eyes, computer))

        log = KeptLog(on_record)
        crew = Crew(autopilot, eyes, camera, log, Logbook(NoJournal(), PAPERS), lambda: computer.view)
        executive = Executive(plan, crew, clock)
        ended = await executive.run()
        if in_task is not None:
            assert has_done, f"the flight never came to {in_task}"
        return Flown(ended, log, autopilot)

    return run_virtually(flight())
