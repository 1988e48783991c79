"""Fly follow_line over seeds and winds, and write what came out to docs/benchmarks.md.

    python -m benchmarks.flights [--speed K] [--seeds N] [--wind M_S ...] [--out FILE]

Each flight is a whole `lineflight dry-run`: simulated vehicle, rendered world, vision worker, MAVSDK over UDP. Flights
run one after the other, because two cores hold one flight and its renderer.
"""

import argparse
import json
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from benchmarks.page import PAGE, write_section

ROOT = Path(__file__).parents[1]
MISSION = ROOT / "missions" / "follow_line.yaml"
HEADER = """\
`make bench` regenerates this section. Every row is a whole dry-run of `missions/follow_line.yaml` in the world
`medium_voltage`, flown by MAVSDK over UDP with vision in the loop, at {speed:g} times real time. Wind is the mean at
20 ft; Dryden gusts come with it. Straightness is [Ceron] equations 6.3 to 6.5 (the thesis flew 0.04 to 0.22 m). The
distance from the line and the heading error are against the simulated truth, the landing against the take-off point.
"""
COLUMNS = (
    "wind [m/s]",
    "seed",
    "result",
    "straightness, leg 1 / 2 [m]",
    "distance from the line, mean / p95 [m]",
    "heading error, median [deg]",
    "setpoints [Hz]",
    "longest gap [ms]",
    "latency p50 / p95 [ms]",
    "landing [m]",
    "speed",
)


def fly(seed: int, wind_m_s: float, speed: float, log: Path) -> dict[str, Any]:
    """One dry-run; its JSON object."""
    command = [sys.executable, "-m", "mission.cli", "dry-run", str(MISSION), "--json"]
    options = {"--seed": seed, "--wind": wind_m_s, "--speed": speed, "--log": log}
    arguments = [str(part) for option in options.items() for part in option]
    done = subprocess.run([*command, *arguments], cwd=ROOT, capture_output=True, text=True, check=False)
    if not done.stdout:
        raise SystemExit(f"the dry-run said nothing: {done.stderr[-2000:]}")
    report: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return report


def shown(value: float | None, decimals: int) -> str:
    """A figure for the table; a dash for a flight that has none."""
    return "-" if value is None else f"{value:.{decimals}f}"


def row(seed: int, wind_m_s: float, report: dict[str, Any]) -> str:
    """A line of the table."""
    lateral, yaw, landing = (report[key] or {} for key in ("lateral", "yaw_error", "landing"))
    latency_ms, setpoints = report["vision"]["latency_ms"] or {}, report["setpoints"]
    cells = (
        f"{wind_m_s:g}",
        str(seed),
        report["result"],
        " / ".join(shown(leg["avg_error_m"], 2) for leg in report["legs"]),
        f"{shown(lateral.get('mean_m'), 2)} / {shown(lateral.get('p95_m'), 2)}",
        shown(yaw.get("median_deg"), 1),
        shown(setpoints["rate_hz"], 1),
        shown(setpoints["max_gap_ms"], 0),
        f"{shown(latency_ms.get('p50'), 0)} / {shown(latency_ms.get('p95'), 0)}",
        shown(landing.get("distance_m"), 2),
        shown(report["achieved_speed"], 2),
    )
    return "| " + " | ".join(cells) + " |"


def summary(flights: list[tuple[float, dict[str, Any]]]) -> str:
    """The sentence for each wind."""
    lines = []
    for wind_m_s in sorted({wind for wind, _ in flights}):
        reports = [report for wind, report in flights if wind == wind_m_s]
        n_completed = sum(report["result"] == "completed" for report in reports)
        legs_m = [leg["avg_error_m"] for report in reports for leg in report["legs"]] or [float("nan")]
        yaws_deg = [report["yaw_error"]["median_deg"] for report in reports if report["yaw_error"]] or [float("nan")]
        lines.append(
            f"- wind {wind_m_s:g} m/s: {n_completed} of {len(reports)} completed; straightness of a leg "
            f"{statistics.mean(legs_m):.2f} m in the mean, {max(legs_m):.2f} m at worst; "
            f"heading error {statistics.median(yaws_deg):.1f} degrees"
        )
    return "\n".join(lines)


def main() -> None:
    """Fly them all."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--speed", type=float, default=2.0)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--wind", type=float, nargs="+", default=[0.0, 4.0, 8.0])
    parser.add_argument("--out", type=Path, default=PAGE)
    options = parser.parse_args()
    flights: list[tuple[float, dict[str, Any]]] = []
    rows = []
    with tempfile.TemporaryDirectory() as logs:
        for wind_m_s in options.wind:
            for seed in range(1, options.seeds + 1):
                begin_s = time.monotonic()
                report = fly(seed, wind_m_s, options.speed, Path(logs))
                flights.append((wind_m_s, report))
                rows.append(row(seed, wind_m_s, report))
                print(f"{rows[-1]}  {time.monotonic() - begin_s:.0f} s wall", flush=True)
                table = ["| " + " | ".join(COLUMNS) + " |", "|" + " --- |" * len(COLUMNS), *rows]
                text = "\n".join([HEADER.format(speed=options.speed), summary(flights), "", *table, ""])
                write_section("Flights", text, options.out)
    print(summary(flights))


if __name__ == "__main__":
    main()
