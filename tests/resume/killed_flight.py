"""A mission whose program is killed, and taken up again from its journal, in virtual time."""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from mission.journal import DiskJournal, JournalError, Transition, read_journal
from mission.records import MissionEnded, TaskEnded
from mission.resumption import CannotResumeError, find_resumption
from mission.simulated.virtual_time import VirtualClock, run_virtually
from tests.support.faulty_autopilot import FaultyAutopilot
from tests.support.flights import ALL_TASKS_PLAN, PAPERS, START_YAW_RAD, KeptLog, bare_executive

SHA256 = PAPERS.mission_sha256


class Disk:
    """Runs what waits for the disk at once, until the program is dead."""

    def __init__(self) -> None:
        self.is_alive = True

    async def run(self, work: Callable[[], None]) -> None:
        if self.is_alive:
            work()


@dataclass
class Aftermath:
    """What a killed flight left, and what came of it. `refusal` is why nothing was resumed."""

    reached: list[str]
    """The states that the first program's machine was in."""
    journalled: list[str]
    killed_in: str
    refusal: str | None
    ended: MissionEnded | None
    tasks: list[str]
    """The tasks that were completed, by either program, in order."""
    is_down: bool


def kill_and_resume(folder: Path, kill_s: float, away_s: float) -> Aftermath:
    """Kill the program `kill_s` after its start; start it again `away_s` later with what its journal holds."""

    async def flight() -> Aftermath:
        clock = VirtualClock()
        autopilot = FaultyAutopilot(clock, start_yaw_rad=START_YAW_RAD)
        disk, first_log, second_log = Disk(), KeptLog(lambda _: None), KeptLog(lambda _: None)
        journal = DiskJournal(folder / "first.journal", disk.run)
        first = bare_executive(ALL_TASKS_PLAN, autopilot, clock, log=first_log, journal=journal)
        reached: list[str] = []
        first._flow.machine._after = reached.append  # besides what the executive does with it
        running = asyncio.create_task(first.run())
        await asyncio.sleep(kill_s)
        killed_in = first._flow.machine.state
        disk.is_alive = False
        autopilot.die()
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)
        await journal.close()
        await asyncio.sleep(away_s)

        refusal, ended = None, None
        journalled: list[str] = []
        second_link = FaultyAutopilot(clock, sim=autopilot.sim)
        try:
            begin, entries = read_journal(folder / "first.journal")
            journalled = [entry.target for entry in entries if isinstance(entry, Transition)]
            plan, resumption = find_resumption(begin, entries, ALL_TASKS_PLAN, SHA256)
        except (JournalError, CannotResumeError) as error:
            refusal = str(error)
        else:
            second = bare_executive(plan, second_link, clock, log=second_log, resumption=resumption)
            ended = await second.run()
        sim = autopilot.sim
        is_down = not sim.is_armed and sim.vehicle.is_on_ground
        done = [item.task for log in (first_log, second_log) for item in log.items if isinstance(item, TaskEnded)]
        return Aftermath(reached, journalled, killed_in, refusal, ended, done, is_down)

    return run_virtually(flight())
