"""The log's file on disk: its name, and writes that remember what went wrong and never raise."""

import os
import re
from datetime import UTC, datetime
from pathlib import Path

from mission.log.errors import LogError


def log_path(folder: Path, mission_name: str, start: datetime) -> Path:
    """Where a flight that began at `start` is logged: `<mission>-<UTC yyyymmddThhmmssZ>.mcap` in `folder`."""
    name = re.sub(r"[^\w-]+", "-", mission_name).strip("-") or "mission"
    return folder / f"{name}-{start.astimezone(UTC):%Y%m%dT%H%M%SZ}.mcap"


class LogFile:
    """A new file that only grows. After the first write that fails it keeps what it has and swallows the rest.

    Raises LogError when the file cannot be made.
    """

    def __init__(self, path: Path) -> None:
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = path.open("xb", buffering=0)
        except OSError as error:
            reason = error.strerror or str(error)
            raise LogError(f"The log {path} cannot be made ({reason}); name a folder that can be written.") from error
        self._path = path
        self.n_bytes = 0
        self.failure: str | None = None

    def write(self, data: bytes | bytearray) -> int:
        """Append `data`; returns its length even when the disk would not take it."""
        if self.failure is None:
            try:
                rest = memoryview(data)
                while rest:
                    n_written = self._file.write(rest)
                    self.n_bytes += n_written
                    rest = rest[n_written:]
            except OSError as error:
                self._fail(error)
        return len(data)

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Tell where the end is; the log's writer never moves away from it."""
        return self._file.seek(offset, whence)

    def flush(self) -> None:
        """Wait until the disk has all that was written: a flight may end with the battery torn off."""
        if self.failure is None:
            try:
                os.fdatasync(self._file.fileno())
            except OSError as error:
                self._fail(error)

    def close(self) -> None:
        """Close the file."""
        try:
            self._file.close()
        except OSError as error:
            self._fail(error)

    def _fail(self, error: OSError) -> None:
        self.failure = f"The log {self._path} cannot be written any more ({error.strerror}); what it holds stays."
