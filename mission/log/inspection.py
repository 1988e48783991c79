"""All that is told of a flight: its figures, and what went wrong and whose fault it was."""

from dataclasses import replace

from drivers.clock import NS_PER_S
from mission.log.blame.blame import DEFAULT_LIMITS, find_excursions
from mission.log.blame.records import Limits
from mission.log.reader import Flight
from mission.log.summary import ExcursionSummary, FlightReport, flight_start_ns, summarise


def inspect_flight(flight: Flight, limits: Limits = DEFAULT_LIMITS) -> FlightReport:
    """Work out a flight's report, its excursions beyond `limits` with it."""
    start_ns = flight_start_ns(flight)
    return replace(
        summarise(flight),
        excursions=tuple(
            ExcursionSummary(
                str(excursion.kind),
                excursion.task,
                (excursion.start_ns - start_ns) / NS_PER_S,
                (excursion.end_ns - start_ns) / NS_PER_S,
                excursion.peak,
                excursion.unit,
                str(excursion.culprit),
                str(excursion.fault),
                excursion.shares,
                excursion.evidence,
            )
            for excursion in find_excursions(flight, limits)
        ),
    )
