"""A program that flies one short mission with all that a real flight has, and says what it sees as JSON lines.

python -m tests.link_fuzz.pilot_program MISSION PORT SPEED EPOCH_NS
"""

import asyncio
import functools
import gc
import json
import sys
from pathlib import Path

from drivers.camera.camera import Frame
from drivers.clock import ScaledClock
from mission.flight import FlightSetup, fly
from mission.log.reader import read_flight
from mission.plan_file import read_mission
from mission.reporting import Progress
from tests.vision_worker.worker_cameras import EndlessCamera, make_frame


class ClockedCamera(EndlessCamera):
    """Gives a frame as often as it is asked, at the flight's time."""

    def __init__(self, clock: ScaledClock) -> None:
        super().__init__()
        self._clock = clock

    def read(self, timeout_s: float) -> Frame | None:
        frame = super().read(timeout_s)
        return None if frame is None else make_frame(frame.seq, self._clock.now_ns())


def say(**words: object) -> None:
    """Tell the test."""
    sys.stdout.write(json.dumps(words) + "\n")
    sys.stdout.flush()


def count_streams() -> int:
    """How many subscriptions are listened to."""
    return sum("_pump" in repr(task.get_coro()) for task in asyncio.all_tasks())


def main(path: Path, port: int, clock: ScaledClock) -> None:
    """Fly, and tell stages, results and hazards."""
    faults: list[str] = []
    stages: list[str] = []

    def on_progress(progress: Progress) -> None:
        if progress.stage not in stages[-1:]:
            stages.append(progress.stage)
            say(stage=progress.stage, n_streams=count_streams(), n_frozen=gc.get_freeze_count())

    async def flight() -> object:
        # What asyncio would write to nobody: an exception in a callback, or in a task whose result nobody took.
        asyncio.get_running_loop().set_exception_handler(lambda loop, context: faults.append(str(context)))
        setup = FlightSetup(
            mission=read_mission(path),
            connection=f"udpin://127.0.0.1:{port}",
            open_camera=functools.partial(ClockedCamera, clock),
            clock=clock,
            log_folder=path.parent,
            metadata={"command": "test"},
        )
        return await fly(setup, on_progress, lambda checks: None)

    outcome = asyncio.run(flight())
    events = read_flight(outcome.log).events
    say(
        result=outcome.ended.result,
        reason=outcome.ended.reason,
        log_failure=outcome.log_failure,
        events=[event.name for event in events],
        faults=faults,
    )


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]), ScaledClock(float(sys.argv[3]), int(sys.argv[4])))
