"""How late a control tick begins, while all that a companion computer runs is running.

    python -m benchmarks.jitter [--minutes M] [--out FILE] [--profile]

The flight is real (MAVSDK over UDP, guard, recorder, journal) against the simulated vehicle at 1x; the vision worker
works on drawn 640 x 480 frames 30 times a second (benchmarks/line_camera.py), so that no renderer takes the processor
that an aircraft would not spend on it. The simulated vehicle itself stands in for the autopilot's own processor.
"""

import argparse
import asyncio
import cProfile
import gc
import os
import pstats
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.long_flight import long_flight
from benchmarks.page import PAGE, table, write_section
from mission import situation
from mission.executive import CONTROL_RATE_HZ, Executive
from mission.flight import fly
from mission.watchers import Pace

FRAMES_HZ = 30.0
TARGET_P99_MS = 5.0
_OLDEST = 2  # the generation of a full garbage collection
_TICKS_PER_COLLECTION = 600
_PERIOD_MS = 1e3 / CONTROL_RATE_HZ


@dataclass(slots=True)
class Timings:
    """What was measured of the control ticks: when and how late each began, how long it and garbage collections took.

    `full_pauses_ms` are those of collections that were asked for, because they seldom come by themselves.
    """

    begun_s: list[float] = field(default_factory=list)
    late_ms: list[float] = field(default_factory=list)
    work_ms: list[float] = field(default_factory=list)
    processor_ms: list[float] = field(default_factory=list)
    pauses_ms: list[float] = field(default_factory=list)
    full_pauses_ms: list[float] = field(default_factory=list)


def listen_in(timings: Timings, profile: cProfile.Profile | None) -> None:
    """Keep what the control loop itself measures, and take the time of each tick."""

    class KeptPace(Pace):
        def tick(self, late_s: float) -> None:
            timings.late_ms.append(1e3 * late_s)
            super().tick(late_s)

    fly_tick = Executive._tick

    async def timed(self: Executive, now_ns: int, dt_s: float) -> None:
        begin_s, begin_processor_s = time.perf_counter(), time.thread_time()
        timings.begun_s.append(begin_s)
        if profile is not None:
            profile.enable()
        try:
            await fly_tick(self, now_ns, dt_s)
        finally:
            if profile is not None:
                profile.disable()
            timings.work_ms.append(1e3 * (time.perf_counter() - begin_s))
            timings.processor_ms.append(1e3 * (time.thread_time() - begin_processor_s))
            if len(timings.work_ms) % _TICKS_PER_COLLECTION == 0:
                gc.collect()

    begun_s = 0.0

    def on_collection(phase: str, info: dict[str, Any]) -> None:
        nonlocal begun_s
        if phase == "start":
            begun_s = time.perf_counter()
        elif timings.begun_s:  # before the first tick nothing can be late
            is_full = info["generation"] == _OLDEST
            (timings.full_pauses_ms if is_full else timings.pauses_ms).append(1e3 * (time.perf_counter() - begun_s))

    situation.Pace = KeptPace  # type: ignore[misc]
    Executive._tick = timed  # type: ignore[method-assign]
    gc.callbacks.append(on_collection)


def row(name: str, values: list[float]) -> list[str]:
    """A line of the table [ms]."""
    figures = (*np.percentile(values, (50, 95, 99)), max(values))
    return [name, str(len(values)), *(f"{figure:.2f}" for figure in figures)]


def jitter_text(timings: Timings, result: str) -> str:
    """The section of the page."""
    p99_ms = float(np.percentile(timings.late_ms, 99))
    rows = [
        row("a tick begins after its deadline", timings.late_ms),
        # The loop forgives a tick that took too long: its successor is then late without having missed a deadline.
        row("from tick to tick, over the period", [max(0.0, ms) for ms in 1e3 * np.diff(timings.begun_s) - _PERIOD_MS]),
        row("a tick takes", timings.work_ms),
        row("of the event loop's processor time", timings.processor_ms),
        row("a garbage collection takes", timings.pauses_ms),
    ]
    return (
        f"`make bench-jitter` regenerates this section: the executive at {CONTROL_RATE_HZ:g} Hz over MAVLink at 1x, "
        f"with guard, recorder and journal, and the vision worker on 640 x 480 frames at {FRAMES_HZ:g} Hz. The frames "
        "are drawn, not rendered: only what a companion computer runs is running, and the simulated vehicle. "
        f"{os.cpu_count()} cores; the flight {result}. "
        f"A full garbage collection in flight takes {max(timings.full_pauses_ms, default=0.0):.1f} ms at most.\n\n"
        f"**p99 {p99_ms:.2f} ms; the target is below {TARGET_P99_MS:g} ms.**\n\n"
        + table(("[ms]", "n", "median", "p95", "p99", "max"), rows)
    )


def main() -> None:
    """Fly, print, and write the section."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--minutes", type=float, default=3.0)
    parser.add_argument("--out", type=Path, default=PAGE)
    parser.add_argument("--profile", action="store_true", help="print what ticks spend their time on; write nothing")
    options = parser.parse_args()
    timings, profile = Timings(), cProfile.Profile() if options.profile else None
    listen_in(timings, profile)
    with (
        tempfile.TemporaryDirectory() as folder,
        long_flight(Path(folder), options.minutes * 60.0, FRAMES_HZ) as setup,
    ):
        outcome = asyncio.run(fly(setup, lambda progress: None, lambda checks: None))
    text = jitter_text(timings, str(outcome.ended.result))
    print(text)
    if profile is not None:
        print(f"\n{len(timings.work_ms)} ticks")
        pstats.Stats(profile).sort_stats("tottime").print_stats(30)
        return
    write_section("Control tick", text, options.out)


if __name__ == "__main__":
    main()
