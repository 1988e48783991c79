"""The flight's end of the live view: hands records over without ever waiting, and hears the operator's wishes."""

import contextlib
import multiprocessing
import os
import pickle
import threading
from multiprocessing.util import Finalize
from types import TracebackType
from typing import Self

from mission.autopilot import Setpoint
from mission.live.server import WORDS, serve
from mission.live.settings import Batch, LiveError, LiveSettings, Serving
from mission.log.backlog import Backlog
from mission.log.records import SentSetpoint, StatusText
from mission.operator import Wish
from mission.reporting import FlightLog, Progress

_MAX_RECORDS = 2000  # ten seconds of all streams
_MAX_IMAGES = 4
_PERIOD_S = 0.05  # records go in batches: pickling them one by one would take the flight's time
_START_LIMIT_S = 30.0
_LAST_WORD_S = 1.0
_END_LIMIT_S = 3.0
_WISHES = {word: wish for wish, word in WORDS.items()}


class LiveFeed:
    """Starts the live view's process and feeds it; a context manager, and a mission.reporting.FlightLog.

    Entering raises LiveError when the page cannot be served. From then on no method raises or waits: records go through
    a bounded backlog and a thread, and what a slow or stopped process does not take is dropped and counted. When the
    process has died, `failure` says so in a sentence, and the flight goes on without.
    """

    def __init__(self, settings: LiveSettings) -> None:
        context = multiprocessing.get_context("spawn")
        self._settings = settings
        self._child_records, self._records = context.Pipe(duplex=False)
        self._wishes, self._child_wishes = context.Pipe(duplex=False)
        self._process = context.Process(
            target=serve,
            args=(settings, self._child_records, self._child_wishes),
            name="lineflight-live",
            daemon=True,
        )
        # Should this program end without leaving the context: the process ends when we hang up, not by a signal.
        self._hang_up = Finalize(self, self._records.close, exitpriority=10)
        self._backlog = Backlog(_MAX_RECORDS, _MAX_IMAGES)
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._send_all, name="live feed", daemon=True)
        self._serving = Serving(0, 0)
        self.failure: str | None = None

    @property
    def url(self) -> str:
        """The page's address, with the token."""
        return self._settings.url(self._serving.port)

    @property
    def serving(self) -> Serving:
        """The ports that are listened on."""
        return self._serving

    @property
    def pid(self) -> int | None:
        """The process's id."""
        return self._process.pid

    @property
    def n_dropped(self) -> int:
        """How many records the process did not take in time."""
        return self._backlog.n_dropped_records

    def record(self, item: object) -> None:
        """Show a record."""
        self._backlog.put(item)

    def record_setpoint(self, t_ns: int, setpoint: Setpoint) -> None:
        """Show a setpoint that was sent."""
        self.record(SentSetpoint(t_ns, setpoint.north_m, setpoint.east_m, setpoint.down_m, setpoint.yaw_rad))

    def record_status_text(self, t_ns: int, text: str) -> None:
        """Show the autopilot's own words."""
        self.record(StatusText(t_ns, text))

    def show(self, progress: Progress) -> None:
        """Show where the flight stands."""
        self.record(progress)

    def wishes(self) -> list[Wish]:
        """What the operator asked for since the last call, oldest first; never waits."""
        try:
            said = os.read(self._wishes.fileno(), 256)
        except BlockingIOError:
            return []
        except OSError:
            said = b""
        if not said:
            self._note_end()
        return [_WISHES[said[place : place + 1]] for place in range(len(said)) if said[place : place + 1] in _WISHES]

    def __enter__(self) -> Self:
        self._process.start()
        self._child_records.close()
        self._child_wishes.close()
        try:
            self._serving = self._hear_serving()
        except BaseException:
            self._end()
            raise
        os.set_blocking(self._wishes.fileno(), False)
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._closing.set()
        self._backlog.close()
        self._thread.join(_LAST_WORD_S)
        if self._thread.is_alive():  # it waits for a process that takes nothing
            self._process.kill()
            self._thread.join()
        self._end()

    def _hear_serving(self) -> Serving:
        word = None
        with contextlib.suppress(EOFError, OSError):
            if self._wishes.poll(_START_LIMIT_S):
                word = self._wishes.recv()
        if not isinstance(word, Serving):
            raise LiveError("The live view's process did not start; fly without --live, and report it if it stays.")
        if word.failure is not None:
            raise LiveError(word.failure)
        return word

    def _end(self) -> None:
        self._hang_up()
        self._process.join(_END_LIMIT_S)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()
        self._wishes.close()

    def _send_all(self) -> None:
        try:
            while (records := self._backlog.take(1.0)) is not None:
                if records:
                    batch = Batch(self.n_dropped, tuple(records))
                    self._records.send_bytes(pickle.dumps(batch, pickle.HIGHEST_PROTOCOL))
                self._closing.wait(_PERIOD_S)
        except Exception:  # whatever it is, a bug included, must not end a flight
            self._note_end()
            self._backlog.close()

    def _note_end(self) -> None:
        if self.failure is None and not self._closing.is_set():
            self.failure = "the live view ended; the flight goes on without it"


class WatchedLog:
    """A mission.reporting.FlightLog that keeps everything in one log and shows it in another."""

    def __init__(self, kept: FlightLog, shown: FlightLog) -> None:
        self._logs = (kept, shown)

    def record(self, item: object) -> None:
        """Keep and show a record."""
        for log in self._logs:
            log.record(item)

    def record_setpoint(self, t_ns: int, setpoint: Setpoint) -> None:
        """Keep and show a setpoint that was sent."""
        for log in self._logs:
            log.record_setpoint(t_ns, setpoint)

    def record_status_text(self, t_ns: int, text: str) -> None:
        """Keep and show the autopilot's own words."""
        for log in self._logs:
            log.record_status_text(t_ns, text)
