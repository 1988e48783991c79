"""What was flown when: each task from its start to its end, and what was flown outside the tasks. Pure."""

from dataclasses import dataclass
from itertools import zip_longest

from drivers.clock import NS_PER_S
from mission.log.reader import Flight
from mission.records import Result, TaskEnded, TaskStarted

FOLLOW_TASK = "follow_lines"
UNFINISHED = "unfinished"
REJOINING_EVENT = "rejoining"

_LOST = "Its end stood in a part of the log that is damaged."
_LEAST_STAGE_NS = NS_PER_S // 2  # who takes the vehicle over ends the flight at once: nothing comes after that


@dataclass(frozen=True, slots=True)
class TaskSpan:
    """A task as flown, flight time [ns]; one that the log does not see end has no `end_ns`."""

    task: str
    start_ns: int
    end_ns: int | None
    result: str
    reason: str


def flight_start_ns(flight: Flight) -> int:
    """When the first task began; the log's start where none did. Getting ready before it is not flight."""
    return flight.tasks_started[0].t_ns if flight.tasks_started else flight.mission.start_ns


def task_spans(flight: Flight) -> tuple[TaskSpan, ...]:
    """Pair each task's start with its end, in the order flown.

    One whose end stood in a damaged part of the log counts for as long as it is sure to have gone on.
    """
    unpaired: list[TaskEnded] = list(flight.tasks_ended)
    spans = []
    for started, following in zip_longest(flight.tasks_started, flight.tasks_started[1:]):
        ended = next((end for end in unpaired if end.index == started.index and end.t_ns >= started.t_ns), None)
        if ended is not None:
            unpaired.remove(ended)
            spans.append(TaskSpan(started.task, started.t_ns, ended.t_ns, str(ended.result), ended.reason))
            continue
        end_ns = _lost_end_ns(started, following, flight)
        why = "The log breaks off before its end." if end_ns is None else _LOST
        spans.append(TaskSpan(started.task, started.t_ns, end_ns, UNFINISHED, why))
    return tuple(spans)


def _lost_end_ns(started: TaskStarted, following: TaskStarted | None, flight: Flight) -> int | None:
    """Until when a task whose end the log lacks surely went on; None: the log breaks off while it does.

    A task ends just before the next one starts: where that start is known, the end stood in the hole before it. Else it
    stood in any of the holes since the task began.
    """
    holes_ns = [hole for hole in flight.holes_ns if hole[1] > started.t_ns]
    if following is not None and following.index == started.index + 1:
        before_ns = [begin_ns for begin_ns, _ in holes_ns if begin_ns < following.t_ns]
        return max(before_ns[-1], started.t_ns) if before_ns else following.t_ns
    if holes_ns:
        return max(holes_ns[0][0], started.t_ns)
    return None if following is None else following.t_ns


def stages(flight: Flight, spans: tuple[TaskSpan, ...], end_ns: int) -> list[tuple[str, int, int]]:
    """What was flown outside the tasks: name, start and end [ns, flight].

    On the way to where a mission is resumed, and from the end of a task that was not completed to the flight's end.
    """
    if not spans:
        return []
    found = []
    rejoining = next((event for event in flight.events if event.name == REJOINING_EVENT), None)
    if rejoining is not None:  # a mission that is resumed flies to where it was interrupted first
        later_ns = [span.start_ns for span in spans if span.start_ns > rejoining.t_ns]
        found.append(("rejoining", rejoining.t_ns, min(later_ns, default=end_ns)))
    last = spans[-1]
    if last.end_ns is not None and last.result != Result.COMPLETED and end_ns - last.end_ns >= _LEAST_STAGE_NS:
        found.append(("going down", last.end_ns, end_ns))
    return found
