"""Ask the autopilot how its clock stands to ours: MAVLink's TIMESYNC, once a second."""

import asyncio
import contextlib
from collections.abc import Awaitable, Callable, Mapping

from drivers.clock import Clock
from mission.autopilot import AutopilotError
from mission.records import ClockSync

_PERIOD_S = 1.0


class TimeSync:
    """Asks by `send`, which carries the fields of a TIMESYNC to the autopilot; `on_sync` hears each answer.

    `send` may raise AutopilotError. See https://mavlink.io/en/services/timesync.html.
    """

    def __init__(
        self, clock: Clock, send: Callable[[Mapping[str, int]], Awaitable[None]], on_sync: Callable[[ClockSync], None]
    ) -> None:
        self._clock = clock
        self._send = send
        self._on_sync = on_sync
        self._asked_ns = 0

    async def ask(self) -> None:
        """Ask until cancelled. Nobody waits for the answers."""
        while True:
            self._asked_ns = self._clock.now_ns()
            with contextlib.suppress(AutopilotError):
                await self._send({"tc1": 0, "ts1": self._asked_ns})
            await asyncio.sleep(_PERIOD_S)

    def take(self, fields: Mapping[str, int]) -> None:
        """Take a TIMESYNC's fields: what counts are answers to our newest question.

        The autopilot asks for our time, too (its `tc1` is 0 then); others' questions may be answered on our link.
        """
        boot_ns, asked_ns = int(fields["tc1"]), int(fields["ts1"])
        if boot_ns and asked_ns == self._asked_ns:
            now_ns = self._clock.now_ns()
            # It read its clock halfway between the question and its answer, as far as anybody can tell.
            self._on_sync(ClockSync(now_ns, boot_ns - (asked_ns + now_ns) // 2, now_ns - asked_ns))
