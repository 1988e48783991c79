"""An event loop whose time jumps to the next thing due, so that a flight of minutes takes as long as its work."""

import asyncio
import selectors
from collections.abc import Coroutine
from typing import Any, TypeVar

T = TypeVar("T")


class _JumpingSelector(selectors.SelectSelector):
    """Never waits: what asyncio would have slept is added to the virtual time."""

    def __init__(self) -> None:
        super().__init__()
        self.now_s = 0.0

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        if timeout is None:
            raise RuntimeError("nothing is scheduled: the program would wait for ever")
        self.now_s += max(0.0, timeout)
        return super().select(0)


class VirtualTimeLoop(asyncio.SelectorEventLoop):
    """asyncio's loop on a virtual clock that starts at 0 s."""

    def __init__(self) -> None:
        self._jumping = _JumpingSelector()
        super().__init__(self._jumping)

    def time(self) -> float:
        """Virtual time now [s]."""
        return self._jumping.now_s

    def block(self, wall_s: float) -> None:
        """Let time pass as if the callback that calls this took so long."""
        self._jumping.now_s += wall_s


class VirtualClock:
    """The flight's clock on the running virtual loop."""

    def now_ns(self) -> int:
        """Flight time now [ns]."""
        return round(asyncio.get_running_loop().time() * 1e9)

    def wall_s(self, flight_s: float) -> float:
        """How long to sleep [s, virtual] until `flight_s` [s, flight] have passed."""
        return max(0.0, flight_s)


def run_virtually(main: Coroutine[Any, Any, T]) -> T:
    """Run a coroutine on a virtual loop; raises RuntimeError when it leaves tasks behind."""

    async def guarded() -> T:
        result = await main
        left = [task for task in asyncio.all_tasks() if task is not asyncio.current_task()]
        if left:
            raise RuntimeError(f"tasks left behind: {left}")
        return result

    with asyncio.Runner(loop_factory=VirtualTimeLoop) as runner:
        return runner.run(guarded())
