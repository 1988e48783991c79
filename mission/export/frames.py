"""The photographs that a log holds, in order."""

from collections.abc import Iterator
from dataclasses import dataclass

from mission.export.errors import ExportError
from mission.log.reader import Flight, read_images
from mission.log.task_spans import task_spans


@dataclass(frozen=True, slots=True)
class Photograph:
    """A frame of the log, taken at `t_ns` [ns, flight]; its name is the same in every export of this log."""

    name: str
    t_ns: int
    jpeg: bytes


def photographs(flight: Flight, *, task: str | None = None, every: int = 1) -> Iterator[Photograph]:
    """Yield each frame that the log holds, or of those taken while `task` was flown, every `every`th.

    Raises LogError when the log cannot be read any more, ExportError when `task` was not flown.
    """
    spans = task_spans(flight)
    if task is not None and task not in {span.task for span in spans}:
        flown = ", ".join(dict.fromkeys(span.task for span in spans)) or "none"
        raise ExportError(f"No task {task} was flown in {flight.path}; the tasks flown are: {flown}.")
    windows_ns = [
        (span.start_ns, flight.end_ns if span.end_ns is None else span.end_ns) for span in spans if span.task == task
    ]
    n_taken = 0
    for index, (t_ns, jpeg) in enumerate(read_images(flight)):
        if task is not None and not any(start_ns <= t_ns <= end_ns for start_ns, end_ns in windows_ns):
            continue
        if n_taken % every == 0:
            yield Photograph(f"frame_{index:06d}.jpg", t_ns, jpeg)
        n_taken += 1
