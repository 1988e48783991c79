"""Press Ctrl-C in each task of a real dry-run, and say how each flight ended.

python benchmarks/interrupts.py [--speed K]
"""

import argparse
import tempfile

from mission.plan_file import read_mission
from tests.support.command_line import ROOT, lineflight_stopped

MISSIONS = (ROOT / "tests" / "data" / "all_tasks.yaml", ROOT / "missions" / "follow_line.yaml")


def main() -> None:
    """Interrupt each kind of task once."""
    parser = argparse.ArgumentParser(description="Press Ctrl-C in each task of a dry-run.")
    parser.add_argument("--speed", type=float, default=3.0)
    options = parser.parse_args()
    done: set[str] = set()
    for mission in MISSIONS:
        tasks = [task.task for task in read_mission(mission).plan.tasks]
        for number, task in enumerate(tasks, start=1):
            if task in done:
                continue
            done.add(task)
            with tempfile.TemporaryDirectory() as logs:
                ran = lineflight_stopped(
                    "dry-run", mission, "--speed", str(options.speed), "--log", logs, "--json",
                    at=f"{number}/{len(tasks)} {task}",
                )  # fmt: skip
            landing = ran.json["landing"]
            print(
                f"{task:14s} exit {ran.code}  {ran.json['result']:12s} "
                f"disarmed {landing['is_disarmed']}  {landing['distance_m']:.1f} m from the take-off point",
                flush=True,
            )


if __name__ == "__main__":
    main()
