"""kill -9 a flying program at random moments over real MAVLink, resume its mission, and say how each ended.

python -m benchmarks.kills [--n 50] [--seed 1] [--jobs 1]
"""

import argparse
import random
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from tests.over_mavlink.observed_flight import kill_and_resume

MISSION = "missions/follow_line.yaml"
FIRST_S, LAST_S = 8.0, 95.0


def main() -> None:
    """Kill, resume, count."""
    parser = argparse.ArgumentParser(description="Kill a flying program at random moments, and resume its mission.")
    parser.add_argument("--n", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=1)
    options = parser.parse_args()
    draw = random.Random(options.seed)
    moments = [(draw.uniform(FIRST_S, LAST_S), draw.choice([1.0, 20.0, 90.0])) for _ in range(options.n)]

    def one(moment: tuple[float, float]) -> str:
        with tempfile.TemporaryDirectory() as folder:
            after = kill_and_resume(Path(folder), MISSION, *moment)
        last = after.words.strip().splitlines()[-1] if after.words.strip() else "nothing was said"
        return f"killed at {moment[0]:5.1f} s, back {moment[1]:4.0f} s later: {last}, down {after.is_down}"

    n_completed = 0
    with ThreadPoolExecutor(options.jobs) as pool:
        for line in pool.map(one, moments):
            n_completed += "ended completed" in line
            print(line, flush=True)
    print(f"{n_completed} of {options.n} completed; the others say why not")


if __name__ == "__main__":
    main()
