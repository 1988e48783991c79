"""The flight's journal: what a mission needs to go on after a crash, on disk before it is acted on.

A text file of JSON lines beside the log. The first tells the mission and the vehicle; each transition of the flight's
state machine is a line, written and synchronised to the disk before the transition happens; and about once a second a
line says how far the task has come. A line that a crash cut off is ignored.
"""

import asyncio
import contextlib
import errno
import fcntl
import math
import os
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Annotated, Literal, Protocol

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from mission.autopilot import GlobalPoint

SUFFIX = ".journal"
DRY_RUN = "dry-run"
"""What stands for the camera of a flight whose vehicle was simulated with it."""

WRITE_LIMIT_S = 1.0


UnixS = Annotated[float, Field(ge=0, le=1e11)]
TaskIndex = Annotated[int, Field(ge=0)]


class _Entry(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Place(_Entry):
    """Where the vehicle was: on Earth [rad, m above mean sea level], above the take-off point [m], heading [rad]."""

    latitude_rad: float = Field(ge=-math.pi / 2, le=math.pi / 2)
    longitude_rad: float = Field(ge=-math.pi, le=math.pi)
    altitude_m: float
    height_m: float
    yaw_rad: float

    @property
    def point(self) -> GlobalPoint:
        """The place on Earth."""
        return GlobalPoint(self.latitude_rad, self.longitude_rad, self.altitude_m)


class Begin(_Entry):
    """What is flown, by what, from where. `unix_s` is the time of day; `start` None where GPS told no origin.

    `origin` is the local frame's own: a vehicle that was not started anew in between still has the same.
    """

    kind: Literal["begin"] = "begin"
    unix_s: UnixS
    mission: str
    mission_path: str
    mission_sha256: str
    vehicle_uid: str
    connection: str
    camera: str
    log: str
    start: Place | None
    origin: Place | None
    theta_0_rad: float
    resumed: "Standing | None" = None
    """What was left when this flight took an interrupted mission up again."""


class Transition(_Entry):
    """The flight goes from one state of its machine to another. `task_index` (from 0) is of the task that it leaves."""

    kind: Literal["transition"] = "transition"
    unix_s: UnixS
    source: str
    target: str
    task_index: TaskIndex | None
    progress: float
    move_until_m: float | None
    place: Place | None


class Standing(_Entry):
    """How far the task has come: metres flown, radians turned or seconds held."""

    kind: Literal["standing"] = "standing"
    unix_s: UnixS
    task_index: TaskIndex
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
    """A journal in a new file, made when the flight begins: one that never did leaves none to be resumed.

    `run` runs what waits for the disk. Raises OSError when nothing can be written in its folder.
    """

    def __init__(self, path: Path, run: Callable[[Callable[[], None]], Awaitable[None]] = in_thread) -> None:
        self.path = path
        self.failure: str | None = None
        self._run = run
        path.parent.mkdir(parents=True, exist_ok=True)
        if not os.access(path.parent, os.W_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path.parent))
        self._file: int | None = None
        self._is_torn = False
        self._noting: asyncio.Task[None] | None = None

    async def write(self, entry: Begin | Transition) -> None:
        """Put an entry on the disk; returns when it is there, or after WRITE_LIMIT_S: a flight does not wait longer."""
        if self._noting is not None:  # an older note must not come after it
            await self._noting
        if self._file is not None or isinstance(entry, Begin):
            await self._append(entry)

    def note(self, entry: Standing) -> None:
        """Put an entry on the disk soon; dropped while another is on its way."""
        if self._file is not None and (self._noting is None or self._noting.done()):
            self._noting = asyncio.ensure_future(self._append(entry))

    async def close(self) -> None:
        """Wait for what is on its way, and close the file."""
        if self._noting is not None:
            await self._noting
        if self._file is not None:
            os.close(self._file)

    async def _append(self, entry: BaseModel) -> None:
        try:
            line = entry.model_dump_json().encode() + b"\n"
            await self._run(lambda: self._put(line))
        except TimeoutError:
            self.failure = f"The journal {self.path} is not on the disk after {WRITE_LIMIT_S:g} s."
        except OSError as error:
            self.failure = f"The journal {self.path} cannot be written any more ({error.strerror})."
        except ValueError as error:  # a name that is no text
            self.failure = f"The journal {self.path} cannot hold this flight ({type(error).__name__})."

    def _put(self, line: bytes) -> None:
        if self._file is None:
            self._file = os.open(self.path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND, 0o644)
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)  # until this program ends, however it ends
            _sync_folder(self.path.parent)
        # A line that did not go on a full disk whole must not spoil the next one.
        rest = b"\n" + line if self._is_torn else line
        self._is_torn = True
        while rest:
            rest = rest[os.write(self._file, rest) :]
        os.fsync(self._file)
        self._is_torn = False


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
    """How the journal begins, and its further entries, oldest first. Lines that are not whole are left out.

    A crash cuts off the last line, and a full disk one in the middle. Raises JournalError.
    """
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "no such name"
        raise JournalError(f"The journal {path} cannot be read ({reason}).") from None
    entries: list[Begin | Transition | Standing] = []
    for line in text.split("\n"):
        with contextlib.suppress(ValidationError):
            entries.append(_ENTRY.validate_json(line))
    begin = entries[0] if entries else None
    others = [entry for entry in entries[1:] if not isinstance(entry, Begin)]
    if not isinstance(begin, Begin) or len(others) != len(entries) - 1:
        raise JournalError(
            f"{path} is not a journal that says which mission was flown; name a *{SUFFIX} of lineflight run."
        )
    return begin, others


def check_ended(path: Path) -> None:
    """See that the program which wrote a journal has ended: two must not fly one vehicle. Raises JournalError."""
    try:
        with path.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise JournalError(f"The flight of {path} is still going on; end its program before you resume it.") from None
    except OSError as error:
        raise JournalError(f"The journal {path} cannot be read ({error.strerror}).") from None


def newest_journal(folder: Path) -> Path:
    """The journal in a folder that was written last; dry-runs are left out, their vehicles are gone.

    Raises JournalError where there is none.
    """
    found: list[tuple[float, Path]] = []
    for path in folder.glob(f"*{SUFFIX}"):
        with contextlib.suppress(OSError, JournalError):
            if read_journal(path)[0].camera != DRY_RUN:
                found.append((path.stat().st_mtime, path))
    if not found:
        raise JournalError(f"There is no *{SUFFIX} of a flight in {folder}; name the folder of your logs with --log.")
    return max(found)[1]


def _sync_folder(folder: Path) -> None:
    """Without this a power cut could leave the file without a name."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
