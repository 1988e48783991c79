"""Fly for a quarter of an hour in real time, and say whether anything grows.

    python -m benchmarks.soak [--minutes M] [--out FILE]

The whole flight is real: MAVSDK over UDP, guard, recorder, journal and vision worker, against the simulated vehicle's
server. Only the frames are cheap (benchmarks/line_camera.py).
"""

import argparse
import asyncio
import multiprocessing
import os
import sys
import tempfile
import time
from dataclasses import astuple, dataclass, fields
from pathlib import Path

import numpy as np

from benchmarks.long_flight import long_flight
from benchmarks.page import PAGE, table, write_section
from mission.flight import FlightOutcome, FlightSetup, fly

FRAMES_HZ = 10.0
PERIOD_S = 10.0
WARM_UP_S = 420.0
"""Until then the trail of half a kilometre, caches and the allocator's arenas fill."""

COLUMNS = {
    "at_s": "time [s]",
    "flight_mb": "flight [MB]",
    "worker_mb": "vision worker [MB]",
    "guard_mb": "guard [MB]",
    "n_blocks": "Python's blocks",
    "n_threads": "threads",
    "n_worker_threads": "worker's threads",
    "n_handles": "handles",
    "n_worker_handles": "worker's handles",
    "n_tasks": "asyncio tasks",
}
MOST_PER_HOUR = {"flight_mb": 24.0, "worker_mb": 24.0, "guard_mb": 2.0, "n_blocks": 20_000.0}
"""What can be told from nothing in a quarter of an hour.

One record of 1 KB kept by each control tick is 72 MB and 72,000 blocks; the samples themselves are 2,500 blocks.
"""


@dataclass(frozen=True, slots=True)
class Sample:
    """What the flight's processes hold at a time [s] after the first sample."""

    at_s: float
    flight_mb: float
    worker_mb: float
    guard_mb: float
    n_blocks: int
    n_threads: int
    n_worker_threads: int
    n_handles: int
    n_worker_handles: int
    n_tasks: int


def main() -> None:
    """Fly, print, and write the section."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--minutes", type=float, default=15.0)
    parser.add_argument("--out", type=Path, default=PAGE)
    options = parser.parse_args()
    with (
        tempfile.TemporaryDirectory() as folder,
        long_flight(Path(folder), options.minutes * 60.0, FRAMES_HZ) as setup,
    ):
        samples, outcome = asyncio.run(_fly_and_sample(setup))
        log_mb = outcome.log.stat().st_size / 1e6
    text = soak_text(samples, outcome, log_mb)
    print(text)
    write_section("Soak", text, options.out)


async def _fly_and_sample(setup: FlightSetup) -> tuple[list[Sample], FlightOutcome]:
    samples: list[Sample] = []
    sampling = asyncio.create_task(_sample(samples))
    try:
        outcome = await fly(setup, lambda progress: None, lambda checks: None)
    finally:
        sampling.cancel()
    return samples, outcome


async def _sample(samples: list[Sample]) -> None:
    start_s = time.monotonic()
    while True:
        await asyncio.sleep(PERIOD_S)
        samples.append(take_sample(time.monotonic() - start_s))
        print(*(f"{name} {value:.8g}" for name, value in zip(COLUMNS, astuple(samples[-1]), strict=True)), flush=True)


def take_sample(at_s: float) -> Sample:
    """Look at this process, its vision worker and its guard."""
    worker = next((child.pid for child in multiprocessing.active_children() if "vision" in child.name), None)
    guard = next((pid for pid in _children() if "guard_process" in _command_line(pid)), None)
    me = os.getpid()
    return Sample(
        at_s=at_s,
        flight_mb=_resident_mb(me),
        worker_mb=_resident_mb(worker),
        guard_mb=_resident_mb(guard),
        n_blocks=sys.getallocatedblocks(),
        n_threads=_count(me, "task"),
        n_worker_threads=_count(worker, "task"),
        n_handles=_count(me, "fd"),
        n_worker_handles=_count(worker, "fd"),
        n_tasks=len(asyncio.all_tasks()),
    )


def slope_per_hour(samples: list[Sample], name: str) -> float:
    """By how much a figure grows in an hour, after the warm-up: the line of least squares."""
    kept = [sample for sample in samples if sample.at_s >= WARM_UP_S]
    at_h = np.array([sample.at_s for sample in kept]) / 3600.0
    return float(np.polyfit(at_h, [getattr(sample, name) for sample in kept], 1)[0]) if len(kept) > 2 else float("nan")


def verdict(samples: list[Sample]) -> list[str]:
    """What grew, in words; nothing where all stayed."""
    grown = []
    kept = [sample for sample in samples if sample.at_s >= WARM_UP_S]
    for name in (field.name for field in fields(Sample) if field.name != "at_s"):
        if name in MOST_PER_HOUR:
            slope = slope_per_hour(samples, name)
            if not slope < MOST_PER_HOUR[name]:
                grown.append(f"{COLUMNS[name]}: {slope:+.1f} an hour")
        elif kept:
            # Counts come and go by one or two; only one whose least value rises has grown.
            half = len(kept) // 2
            before, after = (min(getattr(s, name) for s in part) for part in (kept[:half], kept[half:]))
            if after > before:
                grown.append(f"{COLUMNS[name]}: {before} to {after}")
    return grown


def soak_text(samples: list[Sample], outcome: FlightOutcome, log_mb: float) -> str:
    """The section of the page."""
    grown = verdict(samples)
    every = max(1, len(samples) // 15)
    rows = [[f"{value:.1f}" if isinstance(value, float) else str(value) for value in astuple(sample)]
            for sample in samples[::every]]  # fmt: skip
    slopes = ", ".join(f"{COLUMNS[name]} {slope_per_hour(samples, name):+.1f}" for name in MOST_PER_HOUR)
    return (
        f"`make bench-soak` regenerates this section: one flight over MAVLink at 1x, with MAVSDK, guard, "
        f"recorder, journal and a vision worker on drawn 640 x 480 frames at {FRAMES_HZ:g} Hz, looked at every "
        f"{PERIOD_S:g} s. It {outcome.ended.result} after {samples[-1].at_s / 60:.1f} min; log {log_mb:.0f} MB.\n\n"
        f"**{'Nothing grows' if not grown else 'Grown: ' + '; '.join(grown)}.** "
        f"Growth in an hour, by least squares after {WARM_UP_S / 60:g} min: {slopes}.\n\n"
        + table(list(COLUMNS.values()), rows)
    )


def _children() -> list[int]:
    return [
        int(pid)
        for thread in Path("/proc/self/task").iterdir()
        for pid in (thread / "children").read_text(encoding="ascii").split()
    ]


def _command_line(pid: int) -> str:
    return Path(f"/proc/{pid}/cmdline").read_text(encoding="utf-8", errors="replace")


def _resident_mb(pid: int | None) -> float:
    if pid is None:
        return float("nan")
    n_pages = int(Path(f"/proc/{pid}/statm").read_text(encoding="ascii").split()[1])
    return n_pages * os.sysconf("SC_PAGESIZE") / 1e6


def _count(pid: int | None, what: str) -> int:
    return 0 if pid is None else sum(1 for _ in Path(f"/proc/{pid}/{what}").iterdir())


if __name__ == "__main__":
    main()
