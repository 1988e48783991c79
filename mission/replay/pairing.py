"""What each control tick of a flight saw: its state, and the vision reports that it took."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from mission.autopilot import VehicleState
from mission.log.reader import Flight, stream_log
from mission.log.records import VisionEntry
from mission.records import ControlTick
from vision.records import VisionReport


@dataclass(frozen=True, slots=True)
class Moment:
    """A control tick with the state and the reports, oldest first, that it saw; None: no state was there yet."""

    tick: ControlTick
    state: VehicleState | None
    reports: tuple[VisionReport, ...]


@dataclass(frozen=True, slots=True)
class Moments:
    """A flight's ticks in their order. `is_by_order` says that the log's own order paired them, which is exact."""

    moments: tuple[Moment, ...]
    is_by_order: bool


def moments_of(flight: Flight) -> Moments:
    """Pair a flight's ticks with what they saw; reads the log once more.

    A flight writes each tick first, and then what the tick takes: so the order of the file tells, where it is still the
    one in which the flight wrote it. Other tools may have sorted it by time. A report stands at the time of its frame,
    which lies before the tick that took it; then it counts from when it was made (its latency) on, which may be a tick
    too early, since it still had its way to go. In a damaged log what stands behind a hole belongs to a tick that is
    lost: none is given what is younger than it, nor what follows that. Raises LogError when the log cannot be read any
    more.
    """
    reports = {frame_of(report): report for report in flight.reports}
    moments: list[Moment] = []
    newest_ns = 0
    was_sorted = True
    is_lost = False  # the tick to which belongs what comes
    for log_time_ns, record in _ticks_and_what_they_take(flight):
        was_sorted = was_sorted and log_time_ns >= newest_ns
        newest_ns = log_time_ns
        if isinstance(record, ControlTick):
            moments.append(Moment(record, None, ()))
            is_lost = False
        elif moments and not is_lost:  # before the first tick there is pre-flight
            tick, state, taken = moments[-1].tick, moments[-1].state, moments[-1].reports
            is_lost = record.t_ns > tick.t_ns
            if is_lost:
                continue
            if isinstance(record, VehicleState):
                moments[-1] = Moment(tick, record, taken)
            else:
                moments[-1] = Moment(tick, state, (*taken, reports[record.t_ns, record.seq]))
    if was_sorted:
        return Moments(tuple(_paired_by_time(flight.ticks, flight.states, flight.reports)), is_by_order=False)
    return Moments(tuple(moments), is_by_order=True)


def frame_of(report: VisionReport) -> tuple[int, int]:
    """Which frame a report is of. A loaded computer may stamp two frames with one time, a new camera counts anew."""
    return report.t_capture_ns, report.seq


def _ticks_and_what_they_take(flight: Flight) -> Iterator[tuple[int, ControlTick | VehicleState | VisionEntry]]:
    for _, log_time_ns, record in stream_log(flight.path):
        if isinstance(record, ControlTick | VehicleState | VisionEntry):
            yield log_time_ns, record


def _paired_by_time(
    ticks: Sequence[ControlTick], states: Sequence[VehicleState], reports: Sequence[VisionReport]
) -> Iterator[Moment]:
    """Each tick with the reports that were made by then, and with its state.

    Each tick logs a state, so they are paired by their order where none is missing; else it is the newest there was.
    """
    made = sorted(reports, key=lambda report: (report.t_capture_ns + report.latency_ns, report.t_capture_ns))
    n_taken = n_states = 0
    for index, tick in enumerate(ticks):
        first = n_taken
        while n_taken < len(made) and made[n_taken].t_capture_ns + made[n_taken].latency_ns <= tick.t_ns:
            n_taken += 1
        while n_states < len(states) and states[n_states].t_ns <= tick.t_ns:
            n_states += 1
        newest = states[n_states - 1] if n_states else None
        state = states[index] if len(states) == len(ticks) else newest
        yield Moment(tick, state, tuple(made[first:n_taken]))
