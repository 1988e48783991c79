"""Showing a flight while it goes on: a live line in a terminal, else a line for each stage."""

import contextlib
import math
import queue
import threading
from collections.abc import Sequence
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.live import Live
from rich.text import Text

from drivers.camera.mailbox import Mailbox
from mission.checks import Check
from mission.plan import MissionPlan
from mission.records import CheckResult
from mission.reporting import Progress

_POLL_S = 0.2
_LAST_WORD_S = 1.0
_STYLES = {CheckResult.WARNING: "yellow", CheckResult.FAILED: "bold red"}


class Watch:
    """A context manager; `show` may be called as often as one likes.

    It prints from a thread of its own and keeps the newest progress only: a terminal that does not take its output, as
    after Ctrl-S or on a stalled SSH link, must never hold up the control loop.
    """

    def __init__(self, plan: MissionPlan, console: Console) -> None:
        self._plan = plan
        self._console = console
        self._shown: tuple[str, tuple[str, ...]] = ("", ())
        self._live = Live(console=console, auto_refresh=False, transient=True) if console.is_terminal else None
        self._news: Mailbox[Progress] = Mailbox()
        self._checks: queue.SimpleQueue[Check] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._print_all, name="watch", daemon=True)

    def show(self, progress: Progress) -> None:
        """Show where the flight stands, soon; never waits."""
        self._news.put(progress)

    def tell_checks(self, checks: Sequence[Check]) -> None:
        """Print what pre-flight warns of, and what it found wrong, soon; never waits."""
        for check in checks:
            if check.result is not CheckResult.OK:
                self._checks.put(check)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._news.close()
        self._thread.join(_LAST_WORD_S)

    def _print_all(self) -> None:
        # EOFError: closed. OSError: the terminal is gone, and nobody watches any more.
        with contextlib.suppress(OSError), self._live or contextlib.nullcontext():
            with contextlib.suppress(EOFError):
                while True:
                    progress = self._news.get(_POLL_S)
                    self._print_checks()
                    if progress is not None:
                        self._print(progress)
            self._print_checks()  # a flight that was refused ends right after they were told

    def _print_checks(self) -> None:
        while not self._checks.empty():
            check = self._checks.get()
            label, style = ("not yet", "yellow") if check.waits_for else (str(check.result), _STYLES[check.result])
            text = Text.assemble((f"       {label:<14}", style), check.line)
            self._console.print(text, soft_wrap=True, highlight=False)

    def _print(self, progress: Progress) -> None:
        if self._live is not None:
            self._live.update(self._line(progress), refresh=True)
        # In a terminal, what is waited for stands in the live line alone.
        now = (progress.stage, progress.waiting_for if self._live is None else ())
        if now != self._shown:
            self._shown = now
            self._console.print(self._line(progress), soft_wrap=True, highlight=False)

    def _line(self, progress: Progress) -> Text:
        number = "" if progress.task_index is None else f"{progress.task_index + 1}/{len(self._plan.tasks)} "
        name = progress.stage if progress.task_index is None else self._plan.tasks[progress.task_index].task
        line = Text.assemble((f"{number:>6}", "dim"), (f"{name:<14}", "bold"))
        if progress.waiting_for:
            line.append("waiting for " + ", ".join(progress.waiting_for), "yellow")
        elif progress.height_m is not None and progress.distance_m is not None:
            line.append(f"{progress.height_m:5.1f} m up  {progress.distance_m:5.1f} m out", "cyan")
            if progress.heading_rad is not None:
                line.append(f"  heading {math.degrees(progress.heading_rad) % 360:3.0f}°", "cyan")
        return line
