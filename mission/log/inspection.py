"""All that is told of a flight: its figures, and what went wrong and whose fault it was."""

from dataclasses import replace

from drivers.clock import NS_PER_S
from mission.log.blame.blame import DEFAULT_LIMITS, find_excursions
from mission.log.blame.records import Excursion, Kind, Limits
from mission.log.flight_report import ExcursionSummary, FlightReport
from mission.log.reader import Flight
from mission.log.summary import summarise
from mission.log.task_spans import flight_start_ns


def inspect_flight(flight: Flight, limits: Limits = DEFAULT_LIMITS) -> FlightReport:
    """Work out a flight's report, its excursions beyond `limits` with it.

    Where the log is damaged, nobody is blamed for what stood there: `FlightReport.damage` tells of it.
    """
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
            if not _is_for_want_of_records(excursion, flight)
        ),
    )


def _is_for_want_of_records(excursion: Excursion, flight: Flight) -> bool:
    """Whether a hole in the log is all that it tells of, or most."""
    lacking_ns = sum(
        max(min(excursion.end_ns, end_ns) - max(excursion.start_ns, begin_ns), 0)
        for begin_ns, end_ns in flight.holes_ns
    )
    least_ns = 0 if excursion.kind is Kind.UNSEEN else (excursion.end_ns - excursion.start_ns) // 2
    return lacking_ns > least_ns
