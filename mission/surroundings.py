"""How the companion computer does in flight: the log's disk, the log and the journal, the mission file, the guard."""

import asyncio
import hashlib
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from mission.hazards import ComputerView

_PERIOD_S = 1.0
_LOOK_LIMIT_S = 5.0


@dataclass(frozen=True, slots=True)
class Watched:
    """What is looked at: the log's folder, the mission file and what it held, and who can tell of a failure."""

    log_folder: Path
    mission_path: Path
    mission_sha256: str
    log_failure: Callable[[], str | None]
    journal_failure: Callable[[], str | None]
    guard_failure: Callable[[], str | None]


class Surroundings:
    """Looks about once a second, beside the control loop: a disk may make who asks it wait. `view` never does."""

    def __init__(self, watched: Watched) -> None:
        self._watched = watched
        self._free_bytes = free_bytes(watched.log_folder)
        self._mission_change: str | None = None

    def view(self) -> ComputerView:
        """How the computer does now."""
        watched = self._watched
        return ComputerView(
            free_disk_bytes=self._free_bytes,
            log_failure=watched.log_failure() or watched.journal_failure(),
            mission_change=self._mission_change,
            guard_failure=watched.guard_failure(),
        )

    async def watch(self) -> None:
        """Look again and again, until cancelled."""
        while True:
            try:
                await asyncio.wait_for(asyncio.to_thread(self._look), _LOOK_LIMIT_S)
            except TimeoutError:
                self._free_bytes = 0  # a disk that does not answer is as good as full
            await asyncio.sleep(_PERIOD_S)

    def _look(self) -> None:
        watched = self._watched
        self._free_bytes = free_bytes(watched.log_folder)
        try:
            is_same = sha256_of(watched.mission_path.read_bytes()) == watched.mission_sha256
        except OSError as error:
            self._mission_change = f"the mission file {watched.mission_path} is gone ({error.strerror})"
            return
        self._mission_change = None if is_same else f"the mission file {watched.mission_path} was changed; not flown"


def sha256_of(data: bytes) -> str:
    """The hex digest that tells one mission file from another."""
    return hashlib.sha256(data).hexdigest()


def free_bytes(folder: Path) -> int | None:
    """How much room a folder's disk has; None where that cannot be told."""
    try:
        return shutil.disk_usage(folder).free
    except OSError:
        return None
