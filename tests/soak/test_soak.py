"""Two hours of flight, in virtual time: nothing grows."""

import pytest
from tests.support.cores import on_all_cores

from tests.soak.long_flight import Held, fly_long, growth_per_hour

Flight = tuple[str, list[Held]]

WARM_UP_S = 500.0  # the trail of the last half kilometre is full then
MOST_PER_HOUR = {"n_blocks": 3600.0, "memory_mb": 10.0, "n_tasks": 0.0, "n_threads": 0.0, "n_files": 0.0}
"""A twentieth of one object kept by each control tick, 20 times a second; and 140 bytes by each."""


def grown(held: list[Held]) -> list[str]:
    """The figures that have grown since the warm-up."""
    kept = [one for one in held if one.at_s > WARM_UP_S]
    return [figure for figure, most in MOST_PER_HOUR.items() if growth_per_hour(kept, figure) > most]


@pytest.fixture(scope="module")
def flights() -> tuple[Flight, Flight]:
    """Two hours, and twenty minutes that leak; each in a process of its own, at the same time."""
    with on_all_cores(_fly, [(200, False), (34, True)]) as (long, leaking):
        return long.result(), leaking.result()


def _fly(n_tasks: int, is_leaking: bool) -> Flight:
    return fly_long(n_tasks, is_leaking=is_leaking)


def test_two_hours_of_flight_hold_no_more_than_its_beginning(flights: tuple[Flight, Flight]) -> None:
    result, held = flights[0]
    assert result == "completed"
    assert held[-1].at_s > 6900.0
    assert grown(held) == []


def test_a_leak_would_be_found(flights: tuple[Flight, Flight]) -> None:
    result, held = flights[1]
    assert result == "completed"
    assert grown(held) == list(MOST_PER_HOUR)
