"""Showing a flight while it goes on: a live line in a terminal, else a line for each stage."""

import math
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.live import Live
from rich.text import Text

from mission.plan import MissionPlan
from mission.reporting import Progress


class Watch:
    """A context manager; `show` is called a few times a second."""

    def __init__(self, plan: MissionPlan, console: Console) -> None:
        self._plan = plan
        self._console = console
        self._stage: str | None = None
        self._waiting_for: tuple[str, ...] = ()
        self._live = Live(console=console, auto_refresh=False, transient=True) if console.is_terminal else None

    def __enter__(self) -> Self:
        if self._live is not None:
            self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._live is not None:
            self._live.stop()

    def show(self, progress: Progress) -> None:
        """Show where the flight stands."""
        if self._live is not None:
            self._live.update(self._line(progress), refresh=True)
        if progress.stage != self._stage or progress.waiting_for != self._waiting_for:
            is_news = progress.stage != self._stage or bool(progress.waiting_for)
            self._stage, self._waiting_for = progress.stage, progress.waiting_for
            if is_news:
                self._console.print(self._line(progress), soft_wrap=True, highlight=False)

    def _line(self, progress: Progress) -> Text:
        number = "" if progress.task_index is None else f"{progress.task_index + 1}/{len(self._plan.tasks)} "
        name = progress.stage if progress.task_index is None else self._plan.tasks[progress.task_index].task
        line = Text.assemble((f"{number:>6}", "dim"), (f"{name:<14}", "bold"))
        if progress.waiting_for:
            line.append("waiting for " + ", ".join(progress.waiting_for), "yellow")
        elif progress.state is not None:
            state = progress.state
            line.append(f"{-state.down_m:5.1f} m up  {math.hypot(state.north_m, state.east_m):5.1f} m out", "cyan")
            line.append(f"  heading {math.degrees(state.yaw_rad) % 360:3.0f}", "cyan")
            estimate = None if progress.sight is None else progress.sight.estimate
            if estimate is not None:
                line.append(f"  line at {math.degrees(estimate.angle_rad):+5.1f}", "green")
        return line
