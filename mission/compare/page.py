"""Flights compared on one page: their tracks over each other, their legs beside each other, every figure."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from drivers.clock import NS_PER_S
from mission.compare.comparison import Comparison
from mission.compare.figure_words import change_words, label_of, value_words
from mission.log.blame.signals import knowledge_of, lateral_of, motion_of
from mission.log.page.curves import listed
from mission.log.page.page import fill
from mission.log.page.thinning import evenly
from mission.log.reader import Flight
from mission.log.task_spans import FOLLOW_TASK, task_spans

_TRACK_POINTS = 2_000
_LEG_POINTS = 1_000


def comparison_page(comparison: Comparison, flights: Sequence[Flight]) -> str:
    """The page as HTML; `flights` are those compared, in the same order."""
    tracks, legs = [], [_legs(flight) for flight in flights]
    for flight in flights:
        states = [flight.states[k] for k in evenly(len(flight.states), _TRACK_POINTS).tolist()]
        tracks.append({"north": [round(s.north_m, 3) for s in states], "east": [round(s.east_m, 3) for s in states]})
    n_legs = max((len(of_flight) for of_flight in legs), default=0)
    data: dict[str, Any] = comparison.to_json() | {
        "names": list(comparison.names),
        "headlines": [report.headline for report in comparison.reports],
        "reasons": [report.reason for report in comparison.reports],
        "differing": [[name, *values] for name, values in comparison.circumstances.shown.items()],
        "n_not_shown": comparison.circumstances.n_not_shown,
        "alike": [f"{name} {value}" for name, value in comparison.circumstances.alike.items()],
        "figure_rows": _figure_rows(comparison),
        "tracks": tracks,
        "lines": _lines(flights),
        "legs": [
            {
                "title": f"Leg {k + 1}: off the line, by the time since the leg's start",
                "curves": [
                    {"flight": flight} | of_flight[k] for flight, of_flight in enumerate(legs) if k < len(of_flight)
                ],
            }
            for k in range(n_legs)
        ],
    }
    return fill("compare", "Flights compared", data)


def _lines(flights: Sequence[Flight]) -> list[dict[str, Any]]:
    """The true lines, each once, with the flights (from 0) that were flown there."""
    known = [(k, flight.line) for k, flight in enumerate(flights) if flight.line is not None]
    found = []
    for place in dict.fromkeys(line.axis_ne_m for _, line in known):
        here = [(k, line) for k, line in known if line.axis_ne_m == place]
        line = here[0][1]
        found.append(
            {
                "flights": [k for k, _ in here],
                "conductors": [[list(point[:2]) for point in conductor] for conductor in line.conductors_ned_m],
                "supports": [list(support[:2]) for support in line.supports_ned_m],
            }
        )
    return found


def _figure_rows(comparison: Comparison) -> list[list[str]]:
    """A row of words for each figure that any flight has: what it is called, the values, the changes."""
    rows = []
    for name in comparison.figure_names:
        values = [figures.get(name) for figures in comparison.figures]
        if any(value is not None for value in values):
            changes = [comparison.change(name, other) for other in range(1, len(values))]
            spelled = [value_words(name, value) for value in values]
            rows.append([label_of(name), *spelled, *(change_words(name, change) for change in changes)])
    return rows


def _legs(flight: Flight) -> list[dict[str, Any]]:
    """For each leg that follows the line: times since its start [s], and the way off the line [m]."""
    if not flight.states:
        return []
    motion, known = motion_of(flight), knowledge_of(flight)
    legs = []
    for span in task_spans(flight):
        if span.task != FOLLOW_TASK:
            continue
        part = motion.slice(span.start_ns, flight.end_ns if span.end_ns is None else span.end_ns)
        off_m = lateral_of(known, part).off_m
        kept = evenly(len(part.t_ns), _LEG_POINTS)
        t_s = np.asarray((part.t_ns[kept] - span.start_ns) / NS_PER_S)
        legs.append({"t": listed(t_s), "y": listed(off_m[kept])})
    return legs
