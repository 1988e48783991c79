"""The guard by itself: it ends a process that falls silent, leaves one that speaks, and says when it is gone itself."""

import asyncio
import os
import signal
import subprocess
import sys

import pytest

from mission.guard import Guard
from tests.support.command_line import ROOT

pytestmark = pytest.mark.real_time

PROGRAM = """
import asyncio, sys, time
from mission.guard import Guard

async def main():
    with Guard() as guard:
        loop = asyncio.get_running_loop()
        tick = {"s": None}
        beating = asyncio.create_task(guard.beat(lambda: tick["s"]))
        await asyncio.sleep(0.1)
        if sys.argv[1] == "before":
            time.sleep(1.2)  # nothing flies yet
        tick["s"] = loop.time()
        await asyncio.sleep(0.2)
        if sys.argv[1] == "block":
            time.sleep(30)
        if sys.argv[1] == "hiccup":
            time.sleep(0.15)
        tick["s"] = loop.time()
        await asyncio.sleep(0.3)
        beating.cancel()
        await asyncio.gather(beating, return_exceptions=True)
        if sys.argv[1] == "after":
            time.sleep(1.2)  # nothing flies any more
    print("done")

asyncio.run(main())
"""


@pytest.mark.parametrize(
    ("how", "code"), [("block", -signal.SIGKILL), ("hiccup", 0), ("before", 0), ("after", 0), ("calm", 0)]
)
def test_only_a_loop_that_hangs_in_flight_is_ended(how: str, code: int) -> None:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, how], cwd=ROOT, capture_output=True, text=True, timeout=20, check=False
    )
    assert done.returncode == code, done.stderr
    assert ("done" in done.stdout) == (code == 0)
    assert ("was silent" in done.stderr) == (code != 0)


def test_a_guard_that_died_is_told() -> None:
    async def beat_without() -> str | None:
        with Guard() as guard:
            assert guard._process is not None
            guard._process.kill()
            guard._process.wait()
            loop = asyncio.get_running_loop()
            beating = asyncio.create_task(guard.beat(loop.time))
            await asyncio.sleep(0.2)
            beating.cancel()
            await asyncio.gather(beating, return_exceptions=True)
            return guard.failure

    failure = asyncio.run(beat_without())
    assert failure is not None
    assert "nothing guards" in failure


def test_a_guard_that_hangs_does_not_hold_up_the_end() -> None:
    with Guard() as guard:
        assert guard._process is not None
        os.kill(guard._process.pid, signal.SIGSTOP)
    assert guard._process.returncode == -signal.SIGKILL
