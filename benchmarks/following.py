"""Fly every world in every wind and light, and write what came out to docs/benchmarks-following.md.

    python -m benchmarks.following [--worlds W ...] [--winds M_S ...] [--lights L ...] [--seeds N] [--processes N]

Each flight is a dry-run in virtual time: the same command gives the same flight again, and stands beside each failure.
"""

import argparse
import json
import math
import multiprocessing
import os
import tempfile
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from drivers.clock import NS_PER_S
from mission.log.measures import nearest_on_axis, true_axis
from mission.log.reader import Flight, read_flight
from mission.log.summary import summarise
from mission.log.task_spans import task_spans
from mission.plan import FollowLines, MissionPlan
from mission.plan_file import read_mission
from mission.simulated.scenario import Scenario
from mission.simulated.virtual_flight import fly_virtually
from sitl.world.light import LIGHT_NAMES

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "benchmarks-following.md"
MISSIONS = {
    "medium_voltage": "follow_line",
    "forest": "follow_line",
    "village": "follow_line",
    "crossing": "follow_line",
    "corner": "follow_corner",
    "hills": "follow_hills",
    "high_voltage": "follow_high_voltage",
}
WINDS_M_S = (0.0, 4.0, 8.0, 12.0)
OFF_THE_LINE = ("align", "follow_lines")
WRONG_M = 3.0  # so far beside the line, and for so long, a vehicle that follows follows something else
WRONG_S = 1.0
LEAST_WAY = 0.8  # of the distance to follow, from end to end: less has turned back, or gone in circles


@dataclass(frozen=True, slots=True)
class Case:
    """One flight of the benchmark."""

    world: str
    light: str
    wind_m_s: float
    seed: int

    @property
    def mission(self) -> Path:
        """The mission that is flown in this world."""
        return ROOT / "missions" / f"{MISSIONS[self.world]}.yaml"

    @property
    def scenario(self) -> Scenario:
        """What it is flown in."""
        return Scenario(world=self.world, light=self.light, seed=self.seed, wind_m_s=self.wind_m_s)  # type: ignore[arg-type]

    @property
    def command(self) -> str:
        """What flies it again."""
        options = " ".join(self.scenario.options)
        return f"lineflight dry-run missions/{self.mission.name} --virtual-time {options}"


@dataclass(frozen=True, slots=True)
class Flown:
    """What came of a case; distances [m] are horizontal and to the true axis of the line, while following it.

    `held` is the share of its frames that showed the line; `found_again_s` the longest time [s] that it was not in
    sight; `way` how far it came, as a share of the distances it was to follow; `wrong_m` how far off the line the
    vehicle was for WRONG_S and more, 0 below WRONG_M; clearances are from the vehicle's centre.
    """

    world: str
    light: str
    wind_m_s: float
    seed: int
    result: str
    reason: str
    lateral_m: tuple[float, float, float] | None
    samples_m: tuple[float, ...]
    yaw_deg: float | None
    held: float | None
    found_again_s: float | None
    way: float
    wrong_m: float
    conductor_m: float | None
    support_m: float | None
    contact: str | None
    speed: float
    command: str

    @property
    def is_good(self) -> bool:
        """Completed, all along the right line, and nothing touched."""
        is_along = self.wrong_m == 0.0 and self.way >= LEAST_WAY
        return self.result == "completed" and self.contact is None and is_along

    @property
    def failing(self) -> str:
        """What was wrong, in a few words."""
        words = [f"{self.result}: {self.contact or self.reason}"]
        if self.wrong_m:
            words.append(f"{self.wrong_m:.1f} m off the line")
        if self.way < LEAST_WAY:
            words.append(f"came {100 * self.way:.0f} % of the way")
        return "; ".join(words)


def fly(case: Case) -> Flown:
    """Fly one case."""
    with tempfile.TemporaryDirectory() as folder:
        mission = read_mission(case.mission)
        outcome, aftermath = fly_virtually(mission, case.scenario, Path(folder), lambda _: None, lambda _: None)
        flight = read_flight(outcome.log)
    report, clearance = summarise(flight), aftermath.to_json()["clearance_m"]
    held, found_again_s = sight_of_the_line(flight)
    lateral = report.lateral
    return Flown(
        **asdict(case),
        result=report.result,
        reason=report.reason,
        lateral_m=None if lateral is None else (lateral.mean_m, lateral.p95_m, lateral.max_m),
        samples_m=tuple(round(float(value), 3) for value in distances_m(flight)[1]),
        yaw_deg=None if report.yaw_error is None else report.yaw_error.median_deg,
        held=held,
        found_again_s=found_again_s,
        way=way_along(flight, mission.plan),
        wrong_m=wrong_way_m(flight),
        conductor_m=clearance["conductor"],
        support_m=clearance["support"],
        contact=aftermath.contact,
        speed=aftermath.speed or math.nan,
        command=case.command,
    )


def distances_m(flight: Flight) -> tuple[np.ndarray, np.ndarray]:
    """Times [s] and distances from the line [m] of the true poses while the line was aligned with and followed."""
    end_ns = flight.end_ns
    spans = [(s.start_ns, s.end_ns or end_ns) for s in task_spans(flight) if s.task in OFF_THE_LINE]
    poses = [pose for pose in flight.truth if any(start <= pose.t_ns <= end for start, end in spans)]
    if not poses or flight.line is None:
        return np.empty(0), np.empty(0)
    points = np.array([(pose.north_m, pose.east_m) for pose in poses])
    distance_m, _ = nearest_on_axis(points, true_axis(flight.line))
    return np.array([pose.t_ns for pose in poses]) / NS_PER_S, np.abs(distance_m)


def wrong_way_m(flight: Flight) -> float:
    """How far off the line the vehicle was at worst over WRONG_S without a break; 0 where never WRONG_M and more."""
    times_s, off_m = distances_m(flight)
    worst, since_s, least = 0.0, None, math.inf
    for t_s, distance in zip(times_s.tolist(), off_m.tolist(), strict=True):
        if distance < WRONG_M:
            since_s, least = None, math.inf
            continue
        since_s, least = (t_s if since_s is None else since_s), min(least, distance)
        if t_s - since_s >= WRONG_S:
            worst = max(worst, least)
    return worst


def way_along(flight: Flight, plan: MissionPlan) -> float:
    """How far the vehicle came while it followed, from end to end, as a share of what it was to follow: the least."""
    end_ns, shares = flight.end_ns, []
    spans = [span for span in task_spans(flight) if span.task == "follow_lines"]
    for span, task in zip(spans, (task for task in plan.tasks if isinstance(task, FollowLines)), strict=False):
        poses = [pose for pose in flight.truth if span.start_ns <= pose.t_ns <= (span.end_ns or end_ns)]
        if poses:
            ends = poses[0], poses[-1]
            came_m = math.hypot(ends[1].north_m - ends[0].north_m, ends[1].east_m - ends[0].east_m)
            shares.append(came_m / task.distance_m)
    return min(shares, default=0.0)


def sight_of_the_line(flight: Flight) -> tuple[float | None, float | None]:
    """The share of frames that showed the line while it was followed, and the longest time without [s]."""
    fixed_ns = {fix.t_ns for fix in flight.fixes}
    n_frames = n_seen = 0
    longest_s = 0.0
    for span in task_spans(flight):
        if span.task != "follow_lines":
            continue
        last_ns = span.start_ns
        for report in flight.reports:
            if not span.start_ns <= report.t_capture_ns <= (span.end_ns or flight.end_ns):
                continue
            n_frames += 1
            longest_s = max(longest_s, (report.t_capture_ns - last_ns) / NS_PER_S)
            if report.t_capture_ns in fixed_ns:
                n_seen += 1
                last_ns = report.t_capture_ns
    return (n_seen / n_frames, longest_s) if n_frames else (None, None)


def wilson(n_good: int, n: int) -> tuple[float, float]:
    """Wilson's 95 % interval of a share (Wilson 1927)."""
    if n == 0:
        return 0.0, 1.0
    z, share = 1.96, n_good / n
    middle = (share + z * z / (2 * n)) / (1 + z * z / n)
    half = z * math.sqrt(share * (1 - share) / n + z * z / (4 * n * n)) / (1 + z * z / n)
    return max(0.0, middle - half), min(1.0, middle + half)


def row(name: str, flights: list[Flown]) -> str:
    """A line of a table: one group of flights."""
    samples_m = np.array([value for flown in flights for value in flown.samples_m])
    n_good = sum(flown.is_good for flown in flights)
    low, high = wilson(n_good, len(flights))

    def least(values: Iterable[float | None]) -> str:
        known = [value for value in values if value is not None]
        return f"{min(known):.1f}" if known else "-"

    def middle(values: Iterable[float | None]) -> str:
        known = [value for value in values if value is not None]
        return f"{np.median(known):.2f}" if known else "-"

    lateral = "-"
    if samples_m.size:
        lateral = f"{samples_m.mean():.2f} / {np.percentile(samples_m, 95):.2f} / {samples_m.max():.2f}"
    cells = (
        name,
        f"{n_good} of {len(flights)} ({100 * low:.0f} to {100 * high:.0f} %)",
        lateral,
        middle(flown.yaw_deg for flown in flights),
        middle(flown.held for flown in flights),
        f"{max((flown.found_again_s or 0.0 for flown in flights), default=0.0):.1f}",
        str(sum(flown.wrong_m > 0 for flown in flights)),
        str(sum(flown.contact is not None for flown in flights)),
        f"{least(flown.conductor_m for flown in flights)} / {least(flown.support_m for flown in flights)}",
    )
    return "| " + " | ".join(cells) + " |"


COLUMNS = (
    "completed, on the line (Wilson 95 %)",
    "off the line, mean / p95 / max [m]",
    "heading error, median [deg]",
    "frames with the line",
    "out of sight, longest [s]",
    "followed something else",
    "contacts",
    "nearest conductor / support [m]",
)


def grouped(title: str, flights: list[Flown], key: Callable[[Flown], object]) -> list[str]:
    """A table with a line for each value of a key."""
    lines = ["| " + " | ".join((title, *COLUMNS)) + " |", "|" + " --- |" * (len(COLUMNS) + 1)]
    values = dict.fromkeys(key(flown) for flown in flights)
    rows = [row(str(value), [flown for flown in flights if key(flown) == value]) for value in values]
    return [*lines, *rows, ""]


def kept(file: Path) -> list[Flown]:
    """The flights that `--keep` has kept; of one case flown more than once the last."""
    flights = {}
    for line in file.read_text(encoding="utf-8").splitlines():
        words = json.loads(line)
        flown = Flown(**words | {"samples_m": tuple(words["samples_m"])})
        flights[flown.command] = flown
    return in_order(list(flights.values()))


def in_order(flights: list[Flown]) -> list[Flown]:
    """The flights as the page tells of them."""
    return sorted(flights, key=lambda one: (list(MISSIONS).index(one.world), one.wind_m_s, one.light, one.seed))


def page(flights: list[Flown], note: str) -> str:
    """The whole page; `note` is a sentence about the run."""
    calm = [flown for flown in flights if flown.wind_m_s <= 8.0]
    failures = [flown for flown in flights if not flown.is_good]
    speed = float(np.median([flown.speed for flown in flights]))
    lines = [
        "# Following, benchmarked",
        "",
        "`make bench-following` regenerates this page. Each flight is a dry-run in virtual time with rendered frames "
        "and vision in the loop; wind is the mean at 20 ft with its Dryden gusts. All distances are to the simulated "
        f"truth, while aligning and following. A vehicle {WRONG_M:g} m off the line for {WRONG_S:g} s has followed "
        f"something else, one that came less than {100 * LEAST_WAY:.0f} % of the way has not followed; one that never "
        f"got to align with the line has no distances. {len(flights)} flights, {speed:.1f} times real time each in the "
        f"median, several at a time. {note}".rstrip(),
        "",
        *grouped("", calm, lambda flown: "all, up to 8 m/s"),
        "## By wind",
        "",
        *grouped("wind [m/s]", flights, lambda flown: f"{flown.wind_m_s:g}"),
        "## By world, up to 8 m/s",
        "",
        *grouped("world", calm, lambda flown: flown.world),
        "## By light, up to 8 m/s",
        "",
        *grouped("light", calm, lambda flown: flown.light),
        "## Failures",
        "",
    ]
    if not failures:
        lines.append("None.")
    lines += [f"- {flown.failing}  \n  `{flown.command}`" for flown in failures]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Fly them all."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--worlds", nargs="+", choices=list(MISSIONS), default=list(MISSIONS))
    parser.add_argument("--winds", nargs="+", type=float, default=list(WINDS_M_S))
    parser.add_argument("--lights", nargs="+", choices=list(LIGHT_NAMES), default=list(LIGHT_NAMES))
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--first-seed", type=int, default=1)
    parser.add_argument("--processes", type=int, default=max(1, len(os.sched_getaffinity(0))))
    parser.add_argument("--out", type=Path, default=PAGE)
    parser.add_argument("--keep", type=Path, help="a file that flights are added to, as JSON lines")
    parser.add_argument("--page-of", type=Path, help="fly nothing; write the page of the flights in this file")
    parser.add_argument("--note", default="", help="a sentence about this run for the page")
    options = parser.parse_args()
    if options.page_of:
        flights = kept(options.page_of)
        options.out.write_text(page(flights, options.note), encoding="utf-8")
        return
    cases = [
        Case(world, light, wind_m_s, seed)
        for seed in range(options.first_seed, options.first_seed + options.seeds)
        for wind_m_s in options.winds
        for light in options.lights
        for world in options.worlds
    ]
    flights: list[Flown] = []
    with multiprocessing.get_context("spawn").Pool(options.processes, maxtasksperchild=8) as pool:
        for flown in pool.imap_unordered(fly, cases):
            flights.append(flown)
            if options.keep:
                with options.keep.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(asdict(flown)) + "\n")
            lateral = "-" if flown.lateral_m is None else "/".join(f"{value:.2f}" for value in flown.lateral_m)
            words = "ok" if flown.is_good else flown.failing
            what = f"{flown.world} {flown.light} {flown.wind_m_s:g} m/s seed {flown.seed}"
            print(f"{len(flights)}/{len(cases)}  {what}  {lateral} m  {flown.speed:.1f}x  {words}", flush=True)
            options.out.write_text(page(in_order(flights), options.note), encoding="utf-8")


if __name__ == "__main__":
    main()
