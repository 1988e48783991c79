"""How long an hour's log takes to be inspected, and a page of 20 minutes to be usable.

    python -m benchmarks.inspection [--out FILE]

A rendered flight of a minute and a half is flown once in virtual time; the long logs are its records again and again,
frames included, as if it had gone on. `inspect` runs as a command of its own, whose memory is what the kernel says.
"""

import argparse
import os
import statistics
import sys
import tempfile
import time
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from mcap.writer import Writer

from benchmarks.page import PAGE, table, write_section
from drivers.clock import NS_PER_S
from drivers.mcap_stream import McapFile
from mission.log import channels
from mission.log.copying import Copier
from mission.log.reader import read_flight
from mission.log.records import LoggedMission
from mission.plan_file import read_mission
from mission.records import MissionEnded, TrueLine
from mission.simulated.scenario import Scenario
from mission.simulated.virtual_flight import fly_virtually
from tests.page_browser.browser import Browser, find_chromium

MISSION = Path(__file__).parents[1] / "missions" / "follow_line.yaml"
LONG_MIN, PAGE_MIN = 60.0, 20.0
REPEATS = 3
_ONCE = (LoggedMission, TrueLine, MissionEnded)


@dataclass(frozen=True, slots=True)
class Run:
    """A command's wall time [s] and its largest memory [MB]."""

    wall_s: float
    memory_mb: float


def stretch(log: Path, out: Path, minutes: float) -> None:
    """Write a log's records again and again, until they last `minutes`."""
    flight = read_flight(log)
    span_ns = flight.end_ns - flight.tasks_started[0].t_ns
    n_times = round(minutes * 60 * NS_PER_S / span_ns)
    with out.open("wb") as target:
        writer = Writer(target)
        copier = Copier(writer)
        for k in range(n_times):
            later_ns = k * span_ns
            shifted = partial(_shifted, later_ns, is_first=k == 0, is_last=k == n_times - 1)
            with log.open("rb") as source:
                for record in McapFile(source).records():
                    copier.copy(record, shifted, later_ns)
        writer.finish()


def _shifted(
    shift_ns: int, topic: str, _log_time_ns: int, data: bytes, *, is_first: bool, is_last: bool
) -> bytes | None:
    """A message at a later time; None for what a log holds once, and has already."""
    if topic not in channels.CHANNEL_AT:
        return data
    record: Any = channels.decode(topic, data)
    if isinstance(record, _ONCE) and not (is_last if isinstance(record, MissionEnded) else is_first):
        return None
    if not hasattr(record, "t_ns"):
        return data
    record = replace(record, t_ns=record.t_ns + shift_ns)
    if getattr(record, "estimate", None) is not None:
        record = replace(record, estimate=replace(record.estimate, t_capture_ns=record.t_ns))
    return channels.encode(record)


def run(*arguments: str) -> Run:
    """Run a command of lineflight's."""
    began_s = time.monotonic()
    nowhere = os.open(os.devnull, os.O_WRONLY)
    pid = os.posix_spawn(
        sys.executable,
        [sys.executable, "-m", "mission.cli", *arguments],
        os.environ,
        file_actions=[(os.POSIX_SPAWN_DUP2, nowhere, 1), (os.POSIX_SPAWN_DUP2, nowhere, 2)],
    )
    _, status, usage = os.wait4(pid, 0)
    os.close(nowhere)
    if os.waitstatus_to_exitcode(status) != 0:
        raise RuntimeError(f"lineflight {' '.join(arguments)} ended with {os.waitstatus_to_exitcode(status)}")
    return Run(time.monotonic() - began_s, usage.ru_maxrss / 1e3)


def marks_s(page: Path) -> tuple[float, float]:
    """From the page's opening until it can be used, and until its plots in view are drawn [s, the browser's clock]."""
    with Browser(1440, 1100) as browser:
        browser.open(page)
        usable, drawn = (
            float(browser.evaluate(f"performance.getEntriesByName('{name}')[0].startTime")) / 1e3
            for name in ("usable", "drawn")
        )
        return usable, drawn


def main() -> None:
    """Fly, stretch, inspect, and write the section."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=PAGE)
    out: Path = parser.parse_args().out
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        scenario = Scenario(seed=2, wind_m_s=4.0)
        outcome, _ = fly_virtually(read_mission(MISSION), scenario, folder, lambda _: None, lambda _: None)
        long, page_log, page = folder / "long.mcap", folder / "page.mcap", folder / "page.html"
        stretch(outcome.log, long, LONG_MIN)
        stretch(outcome.log, page_log, PAGE_MIN)
        rows = []
        for words, log, *options in (
            (f"inspect, {LONG_MIN:g} min", long),
            (f"inspect --html, {LONG_MIN:g} min", long, "--html", str(folder / "long.html")),
            (f"inspect --html, {PAGE_MIN:g} min", page_log, "--html", str(page)),
        ):
            runs = [run("inspect", str(log), *options) for _ in range(REPEATS)]
            rows.append(
                [
                    words,
                    f"{log.stat().st_size / 1e6:.0f}",
                    f"{statistics.median(one.wall_s for one in runs):.1f}",
                    f"{max(one.memory_mb for one in runs):.0f}",
                ]
            )
        words = "its times were not measured: there is no Chromium here."
        if find_chromium() is not None:
            usable, drawn = zip(*(marks_s(page) for _ in range(REPEATS)), strict=True)
            words = (
                f"its slider, frames, blame and tables can be used {statistics.median(usable):.1f} s after it is "
                f"opened, its plots are drawn after {statistics.median(drawn):.1f} s (no graphics card)."
            )
        text = (
            "`make bench-inspection` regenerates this section: a flight of a minute and a half, repeated.\n\n"
            + table(["what", "log [MB]", "wall [s], median", "memory [MB], most"], rows)
            + f"\n\nThe page of {PAGE_MIN:g} minutes has {page.stat().st_size / 1e6:.1f} MB; {words}"
        )
    write_section("Inspection", text, out)
    print(text)


if __name__ == "__main__":
    main()
