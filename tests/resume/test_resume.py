"""Resuming after a takeover, elsewhere, with another origin, again and again: in virtual time."""

import asyncio
import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import pytest

from mission.autopilot import GlobalPoint
from mission.journal import DiskJournal, JournalError, Transition, newest_journal, read_journal
from mission.operator import Wish
from mission.records import MissionEnded, Result, TaskEnded
from mission.resumption import CannotResumeError, explain_resumption, find_resumption
from mission.simulated.virtual_time import VirtualClock, run_virtually
from sitl.autopilot import SimAutopilot
from sitl.modes import Mode
from tests.faults.flight import clearance_m
from tests.resume.killed_flight import SHA256, Disk
from tests.support.faulty_autopilot import FaultyAutopilot
from tests.support.flights import ALL_TASKS_PLAN, PAPERS, START_YAW_RAD, KeptLog, bare_executive

CLEARANCE_M = 2.0
Act = Callable[[FaultyAutopilot], None]


@dataclass
class Stage:
    """One program: it is stopped `stop_s` after its start by `act` (a kill, if None); None: it ends by itself.

    With a `wish` the operator stops it.
    """

    stop_s: float | None = None
    act: Act | None = None
    pause_s: float = 3.0
    wish: Wish | None = None


@dataclass
class Story:
    """What came of it all."""

    ends: list[MissionEnded | None] = field(default_factory=list)
    tasks: list[str] = field(default_factory=list)
    commands: list[list[str]] = field(default_factory=list)
    refusal: str = ""
    least_clearance_m: float = math.inf
    sim: SimAutopilot | None = None


def fly_in_stages(folder: Path, *stages: Stage) -> Story:
    """Fly the mission by one program after the other, each with the journal of the one before."""

    async def flight() -> Story:
        clock, story = VirtualClock(), Story()
        link = FaultyAutopilot(clock, start_yaw_rad=START_YAW_RAD)
        sim = story.sim = link.sim
        plan, resumption = ALL_TASKS_PLAN, None
        for number, stage in enumerate(stages):
            if number > 0:
                link = FaultyAutopilot(clock, sim=sim)
                try:
                    begin, entries = read_journal(folder / f"{number - 1}.journal")
                    plan, resumption = find_resumption(begin, entries, ALL_TASKS_PLAN, SHA256)
                except (JournalError, CannotResumeError) as error:
                    story.refusal = str(error)
                    return story
            link.after_step.append(
                lambda: setattr(story, "least_clearance_m", min(story.least_clearance_m, clearance_m(sim)))
            )
            disk, log = Disk(), KeptLog(lambda _: None)
            journal = DiskJournal(folder / f"{number}.journal", disk.run)
            program = bare_executive(plan, link, clock, log=log, journal=journal, resumption=resumption)
            running = asyncio.create_task(program.run())
            if stage.stop_s is not None:
                await asyncio.sleep(stage.stop_s)
                if stage.wish is not None:
                    program.request(stage.wish)
                elif stage.act is None:
                    disk.is_alive = False
                    link.die()
                    running.cancel()
                else:
                    link.catch_up()
                    stage.act(link)
            (ended,) = await asyncio.gather(running, return_exceptions=True)
            await journal.close()
            await link.close()
            story.ends.append(ended if isinstance(ended, MissionEnded) else None)
            story.commands.append(link.commands)
            story.tasks += [
                item.task for item in log.items if isinstance(item, TaskEnded) and item.result == "completed"
            ]
            await asyncio.sleep(stage.pause_s)
            link.catch_up()
        return story

    return run_virtually(flight())


def take_over(link: FaultyAutopilot) -> None:
    """The pilot takes the vehicle, and leaves it hovering."""
    link.sim.set_mode(Mode.LOITER)


def sink(link: FaultyAutopilot) -> None:
    """The pilot takes the vehicle by the sticks, and brings it down by some metres."""
    link.sim.set_mode(Mode.LOITER)
    n, e, d = link.sim.vehicle.position_m
    link.sim.vehicle.position_m = (n, e, d + 3.0)


def all_once(tasks: list[str]) -> bool:
    wanted = [task.task for task in ALL_TASKS_PLAN.tasks if task.task != "takeoff"]
    return [task for task in tasks if task != "takeoff"] == wanted


@pytest.mark.parametrize("act", [take_over, sink])
@pytest.mark.parametrize("stop_s", [18.0, 28.0, 38.0, 44.0])
def test_a_pilot_hands_back_and_the_mission_goes_on(stop_s: float, act: Act, tmp_path: Path) -> None:
    story = fly_in_stages(tmp_path, Stage(stop_s, act), Stage())
    assert [end.result for end in story.ends if end] == [Result.TAKEN_OVER, Result.COMPLETED]
    assert all_once(story.tasks)
    assert "arm" not in story.commands[1]
    assert story.least_clearance_m > CLEARANCE_M


@pytest.mark.parametrize("stop_s", [18.0, 28.0, 38.0, 44.0])
def test_an_operator_holds_and_the_mission_goes_on(stop_s: float, tmp_path: Path) -> None:
    story = fly_in_stages(tmp_path, Stage(stop_s, wish=Wish.HOLD), Stage())
    assert [end.result for end in story.ends if end] == [Result.INTERRUPTED, Result.COMPLETED]
    assert all_once(story.tasks)
    assert "arm" not in story.commands[1]
    assert story.least_clearance_m > CLEARANCE_M


def test_a_resume_that_was_itself_interrupted_is_resumed(tmp_path: Path) -> None:
    story = fly_in_stages(tmp_path, Stage(40.0), Stage(55.0), Stage(8.0, take_over), Stage())
    assert story.ends[-1] is not None
    assert story.ends[-1].result is Result.COMPLETED, story.ends[-1].reason
    assert all_once(story.tasks)
    assert story.least_clearance_m > CLEARANCE_M


def test_a_pilot_who_takes_it_back_before_the_first_command_keeps_it(tmp_path: Path) -> None:
    class Quick(FaultyAutopilot):
        async def read_origin(self) -> GlobalPoint | None:
            self.sim.set_sticks(0.0, 0.0, 0.5, 0.0)
            self.sim.set_mode(Mode.POSCTL)
            for _ in range(30):
                self.sim.set_sticks(0.0, 0.0, 0.5, 0.0)
                await asyncio.sleep(0.05)
            return await super().read_origin()

    async def flight() -> tuple[MissionEnded, list[str], Mode]:
        clock = VirtualClock()
        link = FaultyAutopilot(clock, start_yaw_rad=START_YAW_RAD)
        journal = DiskJournal(tmp_path / "first.journal", Disk().run)
        first = asyncio.create_task(bare_executive(ALL_TASKS_PLAN, link, clock, journal=journal).run())
        await asyncio.sleep(30.0)
        link.catch_up()
        link.sim.set_mode(Mode.LOITER)
        await first
        await journal.close()
        await link.close()
        plan, resumption = find_resumption(*read_journal(tmp_path / "first.journal"), ALL_TASKS_PLAN, SHA256)
        quick = Quick(clock, sim=link.sim)
        ended = await bare_executive(plan, quick, clock, resumption=resumption).run()
        return ended, quick.commands, quick.sim.intended if hasattr(quick.sim, "intended") else quick.sim.mode

    ended, commands, _ = run_virtually(flight())
    assert ended.result is Result.TAKEN_OVER
    assert commands == []


def _land_there(link: FaultyAutopilot) -> None:
    link.sim.set_mode(Mode.LAND)


def test_from_another_place_it_is_refused(tmp_path: Path) -> None:
    """The autopilot's way home ends where it takes off: that would be beside the line, or on it."""
    story = fly_in_stages(tmp_path, Stage(40.0, _land_there, pause_s=60.0), Stage())
    assert story.ends[-1] is not None
    assert story.ends[-1].result is Result.FAILED
    assert "carry it back" in story.ends[-1].reason
    assert story.commands[-1] == ["hold"]  # PX4 stands in offboard after that, where it would not arm


@pytest.mark.parametrize("error_m", [-6.0, 6.0])
def test_an_altitude_that_gps_gives_otherwise_after_a_restart_changes_no_height(error_m: float, tmp_path: Path) -> None:
    def restart(link: FaultyAutopilot) -> None:
        origin = link.sim.origin
        link.sim.origin = replace(origin, altitude_m=origin.altitude_m + error_m)

    story = fly_in_stages(tmp_path, Stage(40.0, None, pause_s=90.0), Stage(0.1, restart))
    assert story.ends[-1] is not None
    assert story.ends[-1].result is Result.COMPLETED, story.ends[-1].reason
    assert story.least_clearance_m > CLEARANCE_M


def test_a_vehicle_in_the_air_whose_autopilot_was_started_anew_is_refused(tmp_path: Path) -> None:
    def restart(link: FaultyAutopilot) -> None:
        origin = link.sim.origin
        link.sim.origin = replace(origin, altitude_m=origin.altitude_m + 6.0)

    story = fly_in_stages(tmp_path, Stage(40.0, take_over), Stage(0.1, restart))
    assert story.ends[-1] is not None
    assert "started anew" in story.ends[-1].reason
    assert story.commands[-1] == []


@pytest.fixture
def journal(tmp_path: Path) -> Path:
    """The journal of a mission that was killed while it followed the line."""
    fly_in_stages(tmp_path, Stage(40.0))
    return tmp_path / "0.journal"


def test_it_explains_what_it_would_do(journal: Path) -> None:
    begin, entries = read_journal(journal)
    plan, resumption = find_resumption(begin, entries, ALL_TASKS_PLAN, SHA256)
    lines = "\n".join(explain_resumption(plan, resumption, begin))
    assert "follow_lines" in lines
    assert "m of it done" in lines
    assert "left     follow_lines, rotate, move_forward, descend, return" in lines
    assert resumption.height_m == 16.0


def test_a_changed_mission_and_another_vehicle_are_refused(journal: Path) -> None:
    begin, entries = read_journal(journal)
    with pytest.raises(CannotResumeError, match="has changed since"):
        find_resumption(begin, entries, ALL_TASKS_PLAN, "another")
    plan, resumption = find_resumption(begin, entries, ALL_TASKS_PLAN, SHA256)
    state = FaultyAutopilot.__new__  # not needed: identity is looked at first
    origin = resumption.origin.point
    refusal = resumption.refusal(plan, state, "another", origin, is_flying=True)  # type: ignore[arg-type]
    assert refusal is not None
    assert "but the mission was begun by" in refusal


def test_a_mission_with_fewer_tasks_than_the_journal_s_is_refused(journal: Path) -> None:
    begin, entries = read_journal(journal)
    short = ALL_TASKS_PLAN.model_copy(update={"tasks": ALL_TASKS_PLAN.tasks[:3]})
    with pytest.raises(CannotResumeError, match="but the mission has 3"):
        find_resumption(begin, entries, short, SHA256)


def test_a_journal_cut_anywhere_is_read_up_to_the_cut(journal: Path, tmp_path: Path) -> None:
    data = journal.read_bytes()
    whole = read_journal(journal)[1]
    cut = tmp_path / "cut.journal"
    for length in range(len(data) // 20, len(data), max(1, len(data) // 60)):
        cut.write_bytes(data[:length])
        _, entries = read_journal(cut)
        assert entries == whole[: len(entries)]
        assert len(entries) >= data[:length].count(b"\n") - 1


def test_a_damaged_line_spoils_only_itself(journal: Path) -> None:
    lines = journal.read_bytes().split(b"\n")
    whole = read_journal(journal)[1]
    lines[3] = lines[3][:20]
    journal.write_bytes(b"\n".join(lines))
    assert read_journal(journal)[1] == whole[:2] + whole[3:]


def test_each_task_that_was_reached_is_in_the_journal(journal: Path) -> None:
    targets = [entry.target for entry in read_journal(journal)[1] if isinstance(entry, Transition)]
    assert targets == ["1_takeoff", "2_ascend", "3_hold", "4_move_until", "5_align", "6_follow_lines"]


@pytest.mark.parametrize(
    "content",
    [b"", b"\n", b"nonsense\n", b"{}\n", b'{"kind":"standing"}\n', b"\xff\xfe\x00", b"[" * 10000 + b"\n"],
)
def test_what_is_no_journal_is_refused_in_a_sentence(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "x.journal"
    path.write_bytes(content)
    with pytest.raises(JournalError, match="not a journal"):
        read_journal(path)


def test_the_newest_journal_passes_over_what_cannot_be_resumed(journal: Path, tmp_path: Path) -> None:
    (tmp_path / "later.journal").write_bytes(b"")
    (tmp_path / "dangling.journal").symlink_to(tmp_path / "nowhere")
    dry = journal.read_text().replace(f'"camera":"{PAPERS.camera}"', '"camera":"dry-run"')
    (tmp_path / "dry.journal").write_text(dry)
    assert newest_journal(tmp_path) == journal
    with pytest.raises(JournalError, match="name the folder"):
        newest_journal(tmp_path / "empty")


def test_a_flight_that_never_began_leaves_no_journal(tmp_path: Path) -> None:
    fly_in_stages(tmp_path, Stage(1.0))
    assert not (tmp_path / "0.journal").exists()


def test_a_pilot_who_takes_over_while_the_journal_waits_for_its_disk_is_not_fought(tmp_path: Path) -> None:
    async def slow(work: Callable[[], None]) -> None:
        work()
        await asyncio.sleep(0.9)

    async def flight() -> tuple[MissionEnded, list[str], Mode]:
        clock = VirtualClock()
        link = FaultyAutopilot(clock, start_yaw_rad=START_YAW_RAD)
        journal = DiskJournal(tmp_path / "slow.journal", slow)
        program = bare_executive(ALL_TASKS_PLAN, link, clock, journal=journal)
        running = asyncio.create_task(program.run())
        await asyncio.sleep(45.0)
        program.request_stop()
        await asyncio.sleep(0.3)  # the transition is on its way to the disk
        link.catch_up()
        link.sim.set_mode(Mode.RTL)
        link._heartbeat_s -= 1.0  # the next heartbeat comes at once
        ended = await running
        await journal.close()
        return ended, link.commands, link.sim.mode

    ended, commands, mode = run_virtually(flight())
    assert ended.result is Result.TAKEN_OVER
    assert commands[-1] == "offboard", "neither hold nor return was sent after the takeover"
    assert mode is Mode.RTL
