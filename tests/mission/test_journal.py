"""The journal on a disk that is full, slow, or not to be written."""

import asyncio
from collections.abc import Callable
from pathlib import Path

import pytest

from mission.journal import Begin, DiskJournal, JournalError, Transition, check_ended, read_journal

BEGIN = Begin(
    unix_s=1.0,
    mission="m",
    mission_path="m.yaml",
    mission_sha256="00",
    vehicle_uid="1",
    connection="udp",
    camera="v4l2:/dev/video0",
    log="m.mcap",
    start=None,
    origin=None,
    theta_0_rad=0.0,
)


def transition(target: str) -> Transition:
    return Transition(
        unix_s=2.0, source="a", target=target, task_index=None, progress=0.0, move_until_m=None, place=None
    )


async def at_once(work: Callable[[], None]) -> None:
    work()


def test_entries_come_back_in_order(tmp_path: Path) -> None:
    async def write() -> None:
        journal = DiskJournal(tmp_path / "a.journal", at_once)
        for entry in (BEGIN, transition("b"), transition("c")):
            await journal.write(entry)
        await journal.close()

    asyncio.run(write())
    begin, entries = read_journal(tmp_path / "a.journal")
    assert begin == BEGIN
    assert [entry.target for entry in entries if isinstance(entry, Transition)] == ["b", "c"]


def test_a_write_that_fails_is_told_and_the_next_line_is_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import mission.journal as module

    real = module.os.write
    taken: list[int] = []

    def full_disk(handle: int, data: bytes) -> int:
        if len(taken) == 2:
            taken.append(0)
            raise OSError(28, "No space left on device")
        taken.append(0)
        return real(handle, data[:30] if len(taken) == 2 else data)

    async def write() -> list[str | None]:
        journal = DiskJournal(tmp_path / "a.journal", at_once)
        await journal.write(BEGIN)
        monkeypatch.setattr(module.os, "write", full_disk)
        failures = []
        for target in ("b", "c", "d"):
            await journal.write(transition(target))
            failures.append(journal.failure)
        await journal.close()
        return failures

    taken.append(0)
    first, *later = asyncio.run(write())
    assert first is not None
    assert "No space left" in first
    assert all(failure is not None for failure in later), "a journal with a hole says so"
    _, entries = read_journal(tmp_path / "a.journal")
    assert [entry.target for entry in entries if isinstance(entry, Transition)] == ["c", "d"]


def test_a_disk_that_does_not_answer_holds_up_nobody(tmp_path: Path) -> None:
    async def never(work: Callable[[], None]) -> None:
        raise TimeoutError

    async def write() -> str | None:
        journal = DiskJournal(tmp_path / "a.journal", never)
        await journal.write(BEGIN)
        return journal.failure

    failure = asyncio.run(write())
    assert failure is not None
    assert "not on the disk" in failure


def test_before_the_flight_begins_there_is_no_file(tmp_path: Path) -> None:
    async def write() -> None:
        journal = DiskJournal(tmp_path / "a.journal", at_once)
        await journal.write(transition("failed"))
        await journal.close()

    asyncio.run(write())
    assert list(tmp_path.iterdir()) == []


def test_a_flight_that_goes_on_cannot_be_resumed(tmp_path: Path) -> None:
    async def fly() -> None:
        journal = DiskJournal(tmp_path / "a.journal", at_once)
        await journal.write(BEGIN)
        with pytest.raises(JournalError, match="still going on"):
            check_ended(tmp_path / "a.journal")
        await journal.close()

    asyncio.run(fly())
    check_ended(tmp_path / "a.journal")


def test_a_name_that_is_no_text_is_a_failure_and_no_exception(tmp_path: Path) -> None:
    async def write() -> str | None:
        journal = DiskJournal(tmp_path / "a.journal", at_once)
        await journal.write(BEGIN.model_copy(update={"log": "\udcff"}))
        return journal.failure

    failure = asyncio.run(write())
    assert failure is not None
    assert "cannot hold this flight" in failure
