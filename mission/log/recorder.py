"""Write a flight to an MCAP log, from a thread of its own so that the flight never waits for the disk."""

import hashlib
import threading
import time
from pathlib import Path
from types import TracebackType
from typing import Self

from drivers.clock import Clock, ScaledClock
from mission.autopilot import Setpoint
from mission.log.backlog import Backlog
from mission.log.disk import LogFile
from mission.log.errors import LogError
from mission.log.mcap_log import McapLog
from mission.log.records import LoggedMission, LogHealth, SentSetpoint, StatusText

_MAX_RECORDS = 20_000  # a minute or more of all streams
_MAX_IMAGES = 50
_FLUSH_PERIOD_S = 1.0
_OPEN_TIMEOUT_S = 5.0  # a disk that hangs is no reason to wait for ever, on the ground neither
_CLOSE_TIMEOUT_S = 10.0


class Recorder:
    """Records a flight; a context manager, which opens the file and closes it.

    Entering raises LogError when the file cannot be made (it must not exist yet) or the disk does not take it, and
    waits until the mission is on the disk: whenever the program is killed then, the log opens. From then on no method
    raises or waits: when the disk will not take more, `failure` says so in a sentence and the flight goes on. `clock`
    ties flight time to Unix time once, at the start, which `mission` keeps; `metadata` is kept beside the mission file.
    """

    def __init__(
        self,
        path: Path,
        *,
        mission_text: str,
        mission_name: str,
        metadata: dict[str, str],
        clock: Clock | None = None,
    ) -> None:
        self.path = path
        self._clock = ScaledClock() if clock is None else clock
        start_ns = self._clock.now_ns()
        self.mission = LoggedMission(
            name=mission_name,
            text=mission_text,
            sha256=hashlib.sha256(mission_text.encode()).hexdigest(),
            start_ns=start_ns,
            unix_minus_flight_ns=time.time_ns() - start_ns,
            metadata=dict(metadata),
        )
        self._backlog = Backlog(_MAX_RECORDS, _MAX_IMAGES)
        self._thread = threading.Thread(target=self._write_all, name="flight log", daemon=True)
        self._is_begun = threading.Event()
        self._file: LogFile | None = None
        self._fault: str | None = None

    @property
    def failure(self) -> str | None:
        """Why the log is not complete, in a sentence; None while it is."""
        if self._fault is not None:
            return self._fault
        if self._file is not None and self._file.failure is not None:
            return self._file.failure
        if self._backlog.n_dropped_records or self._backlog.n_dropped_images:
            return (
                f"The disk was too slow for the log {self.path}: {self._backlog.n_dropped_records} records and "
                f"{self._backlog.n_dropped_images} images are missing."
            )
        return None

    def record(self, item: object) -> None:
        """Log a record: any type of mission.log.channels, a VisionReport, the camera's Intrinsics, an Attachment."""
        self._backlog.put(item)

    def record_setpoint(self, t_ns: int, setpoint: Setpoint) -> None:
        """Log a setpoint that was sent at `t_ns`."""
        sent = SentSetpoint(t_ns, setpoint.north_m, setpoint.east_m, setpoint.down_m, setpoint.yaw_rad)
        self._backlog.put(sent)

    def record_status_text(self, t_ns: int, text: str) -> None:
        """Log the autopilot's own words, which came at `t_ns`."""
        self._backlog.put(StatusText(t_ns, text))

    def __enter__(self) -> Self:
        self._file = LogFile(self.path)
        self._backlog.put(self.mission)
        self._thread.start()
        is_begun = self._is_begun.wait(_OPEN_TIMEOUT_S)
        if not is_begun or self.failure is not None:
            self._backlog.close()
            why = self.failure or f"The disk did not take the log {self.path} within {_OPEN_TIMEOUT_S:g} s."
            raise LogError(f"{why} Name a folder on another disk.")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._backlog.close()
        self._thread.join(_CLOSE_TIMEOUT_S)
        if self._thread.is_alive() and self._fault is None:
            self._fault = f"The log {self.path} was not finished: the disk did not take it in {_CLOSE_TIMEOUT_S:g} s."

    def _write_all(self) -> None:
        # Whatever goes wrong here, a bug included, must not end a flight: it becomes `failure`.
        assert self._file is not None  # noqa: S101
        try:
            log = McapLog(self._file, self.mission)
            next_flush_s = time.monotonic()  # at once
            while (records := self._backlog.take(_FLUSH_PERIOD_S)) is not None:
                for record in records:
                    if self._file.failure is None:
                        self._write(log, record)
                if time.monotonic() >= next_flush_s:
                    self._write(log, self._health(log.newest_ns, self._file))
                    log.flush()
                    self._is_begun.set()
                    next_flush_s = time.monotonic() + _FLUSH_PERIOD_S
            log.flush()
            self._write(log, self._health(log.newest_ns, self._file))  # once more, of the whole log
            log.close()
        except Exception as error:
            self._fault = f"The log {self.path} was given up: {type(error).__name__}: {error}."
        finally:
            self._is_begun.set()
            self._file.close()

    def _health(self, t_ns: int, file: LogFile) -> LogHealth:
        backlog = self._backlog
        return LogHealth(
            t_ns,
            file.n_bytes,
            backlog.n_waiting,
            backlog.n_dropped_images,
            backlog.n_dropped_records,
            time.thread_time(),
        )

    def _write(self, log: McapLog, record: object) -> None:
        try:
            log.write(record)
        except Exception as error:  # whatever one record is, the others are worth keeping
            name = type(record).__name__
            self._fault = f"The log {self.path} lacks a {name} that it could not encode ({error})."
