"""Two hours of flight, in virtual time: nothing grows."""

import functools
import multiprocessing
from concurrent.futures import ProcessPoolExecutor

from tests.soak.long_flight import Held, fly_long, growth_per_hour

WARM_UP_S = 500.0  # the trail of the last half kilometre is full then
MOST_PER_HOUR = {"n_blocks": 3600.0, "memory_mb": 10.0, "n_tasks": 0.0, "n_threads": 0.0, "n_files": 0.0}
"""A twentieth of one object kept by each control tick, 20 times a second; and 140 bytes by each."""


def grown(held: list[Held]) -> list[str]:
    """The figures that have grown since the warm-up."""
    kept = [one for one in held if one.at_s > WARM_UP_S]
    return [figure for figure, most in MOST_PER_HOUR.items() if growth_per_hour(kept, figure) > most]


def fly_apart(n_tasks: int, *, is_leaking: bool) -> tuple[str, list[Held]]:
    """Fly in a process of its own, which holds nothing of other tests."""
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        return pool.submit(functools.partial(fly_long, n_tasks, is_leaking=is_leaking)).result()


def test_two_hours_of_flight_hold_no_more_than_its_beginning() -> None:
    result, held = fly_apart(200, is_leaking=False)
    assert result == "completed"
    assert held[-1].at_s > 6900.0
    assert grown(held) == []


def test_a_leak_would_be_found() -> None:
    result, held = fly_apart(34, is_leaking=True)
    assert result == "completed"
    assert grown(held) == list(MOST_PER_HOUR)
