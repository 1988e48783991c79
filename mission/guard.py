"""The flight's end of its guard (mission.guard_process): starts it, and beats for as long as the control loop lives."""

import asyncio
import contextlib
import os
import select
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Self

from mission import guard_process

SILENCE_LIMIT_S = 0.4
"""With the guard's own slices and the end of a process, the stream of setpoints has ended half a second later."""

TICK_LIMIT_S = 7.0
"""A control tick may wait this long: a command has 5 s, a transition in the journal one. Then it counts as hung too."""

_PERIOD_S = 0.05
_START_LIMIT_S = 10.0
_END_LIMIT_S = 2.0


class GuardError(Exception):
    """The guard could not be started; the message is one sentence."""


class Guard:
    """A guard over this process. A context manager; raises GuardError when it cannot be started."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self.failure: str | None = None
        """Why nothing guards the control loop any more, in a sentence; None while something does."""

    def __enter__(self) -> Self:
        script = Path(guard_process.__file__)
        try:
            self._process = subprocess.Popen(  # noqa: S603  # our own file, by this interpreter
                [sys.executable, "-I", "-S", str(script), str(os.getpid()), f"{SILENCE_LIMIT_S}"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                start_new_session=True,
            )
            assert self._process.stdin is not None and self._process.stdout is not None  # noqa: S101, PT018  # for mypy
            os.set_blocking(self._process.stdin.fileno(), False)
            if not select.select([self._process.stdout], [], [], _START_LIMIT_S)[0] or not self._process.stdout.read(1):
                self._process.kill()
                raise GuardError("the guard of the control loop did not start; try again, and report it if it stays")
        except OSError as error:
            raise GuardError(f"the guard of the control loop cannot be started ({error.strerror})") from None
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._process is None:
            return
        for stream in (self._process.stdin, self._process.stdout):
            if stream is not None:
                with contextlib.suppress(OSError):
                    stream.close()
        try:
            self._process.wait(_END_LIMIT_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    async def beat(self, last_tick_s: Callable[[], float | None]) -> None:
        """Beat until cancelled; from the first control tick on the guard counts on it.

        `last_tick_s` is when the last control tick began, in the event loop's time [s], None while there is none to be
        expected. A blocked event loop does not beat, and for one whose control loop hangs nobody does.
        """
        loop = asyncio.get_running_loop()
        is_armed = False
        try:
            while True:
                tick_s = last_tick_s()
                if tick_s is None:
                    if is_armed:
                        self._say(guard_process.STAND_DOWN)
                    is_armed = False
                elif loop.time() - tick_s < TICK_LIMIT_S:
                    self._say(guard_process.BEAT if is_armed else guard_process.ARM)
                    is_armed = True
                await asyncio.sleep(_PERIOD_S)
        finally:
            self._say(guard_process.STAND_DOWN)

    def _say(self, word: bytes) -> None:
        if self._process is None or self._process.stdin is None or self.failure is not None:
            return
        try:
            os.write(self._process.stdin.fileno(), word)
        except OSError:
            self.failure = "nothing guards the control loop any more: the guard's process ended"
