"""The flight's journal: what a mission needs to go on after a crash, on disk before it is acted on.

A text file of JSON lines beside the log. The first tells the mission and the vehicle; each transition of the flight's
state machine is a line, written and synchronised to the disk before the transition happens; and about once a second a
line says how far the task has come. A line that a crash cut off is ignored.
"""

import asyncio
import os
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Annotated, Any, Literal, Protocol

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from mission.autopilot import GlobalPoint

SUFFIX = ".journal"
WRITE_LIMIT_S = 1.0


class _Entry(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class Place(_Entry):
    """Where the vehicle was: on Earth [rad, m above mean sea level], above the take-off point [m], heading [rad]."""

    latitude_rad: float
    longitude_rad: float
    altitude_m: float
    height_m: float
    yaw_rad: float

    @property
    def point(self) -> GlobalPoint:
        """The place on Earth."""
        return GlobalPoint(self.latitude_rad, self.longitude_rad, self.altitude_m)


class Begin(_Entry):
    """What is flown, by what, from where. `unix_s` is the time of day; `start` None where GPS told no origin."""

    kind: Literal["begin"] = "begin"
    unix_s: float
    mission: str
    mission_path: str
    mission_sha256: str
    vehicle_uid: str
    connection: str
    camera: str
    log: str
    start: Place | None
    theta_0_rad: float
    resumed: "Standing | None" = None
    """What was left when this flight took an interrupted mission up again."""


class Transition(_Entry):
    """The flight goes from one state of its machine to another. `task_index` (from 0) is of the task that it leaves."""

    kind: Literal["transition"] = "transition"
    unix_s: float
    source: str
    target: str
    task_index: int | None
    progress: float
    move_until_m: float | None
    place: Place | None


class Standing(_Entry):
    """How far the task has come: metres flown, radians turned or seconds held."""

    kind: Literal["standing"] = "standing"
    unix_s: float
    task_index: int
    progress: float
    move_until_m: float | None
    place: Place | None


Entry = Annotated[Begin | Transition | Standing, Field(discriminator="kind")]
_ENTRY: TypeAdapter[Begin | Transition | Standing] = TypeAdapter(Entry)


class Journal(Protocol):
    """Where the executive writes. Neither method raises: a journal that fails says so in `failure`."""

    @property
    def failure(self) -> str | None:
        """Why the journal is not whole, in a sentence; None while it is."""
        ...

    async def write(self, entry: Begin | Transition) -> None:
        """Put an entry on the disk; returns when it is there, or when it takes too long."""
        ...

    def note(self, entry: Standing) -> None:
        """Put an entry on the disk soon; dropped while another is on its way."""
        ...


async def in_thread(work: Callable[[], None]) -> None:
    """Run what may wait for a disk beside the event loop, within WRITE_LIMIT_S."""
    await asyncio.wait_for(asyncio.to_thread(work), WRITE_LIMIT_S)


class DiskJournal:
    """A journal in a new file. `run` runs what waits for the disk; raises OSError when the file cannot be made."""

    def __init__(self, path: Path, run: Callable[[Callable[[], None]], Awaitable[None]] = in_thread) -> None:
        self.path = path
        self.failure: str | None = None
        self._run = run
        path.parent.mkdir(parents=True, exist_ok=True)
        self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND, 0o644)
        _sync_folder(path.parent)
        self._noting: asyncio.Task[None] | None = None

    async def write(self, entry: Begin | Transition) -> None:
        """Put an entry on the disk; returns when it is there, or after WRITE_LIMIT_S: a flight does not wait longer."""
        await self._append(entry)

    def note(self, entry: Standing) -> None:
        """Put an entry on the disk soon; dropped while another is on its way."""
        if self._noting is None or self._noting.done():
            self._noting = asyncio.ensure_future(self._append(entry))

    async def close(self) -> None:
        """Wait for what is on its way, and close the file."""
        if self._noting is not None:
            await self._noting
        os.close(self._file)

    async def _append(self, entry: BaseModel) -> None:
        line = entry.model_dump_json().encode() + b"\n"

        def append() -> None:
            # One write: lines of two threads do not mix in a file that is opened for appending.
            os.write(self._file, line)
            os.fsync(self._file)

        try:
            await self._run(append)
        except TimeoutError:
            self.failure = f"The journal {self.path} is not on the disk after {WRITE_LIMIT_S:g} s."
        except OSError as error:
            self.failure = f"The journal {self.path} cannot be written any more ({error.strerror})."
        else:
            self.failure = None


class NoJournal:
    """The journal of a flight that nobody will resume."""

    failure = None

    async def write(self, entry: Begin | Transition) -> None:
        """Keep nothing."""

    def note(self, entry: Standing) -> None:
        """Keep nothing."""


class JournalError(Exception):
    """A journal cannot be read; the message is one sentence that says why and what to do."""


def read_journal(path: Path) -> tuple[Begin, list[Transition | Standing]]:
    """How the journal begins, and its further entries, oldest first. A last line that was cut off is left out.

    Raises JournalError.
    """
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise JournalError(f"The journal {path} cannot be read ({error.strerror}).") from None
    entries: list[Any] = []
    lines = text.splitlines(keepends=True)
    for number, line in enumerate(lines, start=1):
        if not line.endswith("\n"):
            break
        try:
            entries.append(_ENTRY.validate_json(line))
        except ValidationError:
            raise JournalError(f"Line {number} of {path} is not a journal's; name a *{SUFFIX} of lineflight.") from None
    begin, *others = entries or [None]
    if not isinstance(begin, Begin) or any(isinstance(entry, Begin) for entry in others):
        raise JournalError(f"The journal {path} does not say which mission was flown; nothing can be resumed from it.")
    return begin, others


def newest_journal(folder: Path) -> Path:
    """The journal in a folder that was written last. Raises JournalError where there is none."""
    journals = sorted(folder.glob(f"*{SUFFIX}"), key=lambda path: path.stat().st_mtime)
    if not journals:
        raise JournalError(f"There is no *{SUFFIX} in {folder}; name the folder of your logs with --log.")
    return journals[-1]


def _sync_folder(folder: Path) -> None:
    """Without this a power cut could leave the file without a name."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
