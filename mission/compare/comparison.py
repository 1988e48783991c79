"""Two or more flights, figure by figure and task by task. Pure."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mission.compare.circumstances import Circumstances
from mission.compare.figures import Figures, TaskPair, figures_of, pair_tasks
from mission.log.flight_report import FlightReport


@dataclass(frozen=True, slots=True)
class Comparison:
    """Flights held against the first of them.

    All figures by name, what was flown with, and the tasks of each other one beside those of the first.
    """

    names: tuple[str, ...]
    reports: tuple[FlightReport, ...]
    circumstances: Circumstances
    figures: tuple[Figures, ...]
    tasks: tuple[list[TaskPair], ...]

    def change(self, name: str, flight: int) -> float | None:
        """By how much a figure of a flight differs from the first one's."""
        first, other = self.figures[0].get(name), self.figures[flight].get(name)
        return None if first is None or other is None else other - first

    @property
    def figure_names(self) -> list[str]:
        """The figures of all flights, in their order."""
        return list(dict.fromkeys(name for figures in self.figures for name in figures))

    def to_json(self) -> dict[str, Any]:
        """As plain dicts, ready for json.dump."""
        return {
            "logs": list(self.names),
            "flown_with": {
                "differing": {name: list(values) for name, values in self.circumstances.differing.items()},
                "alike": self.circumstances.alike,
            },
            "results": [report.result for report in self.reports],
            "figures": {name: [figures.get(name) for figures in self.figures] for name in self.figure_names},
            "changes": {name: [self.change(name, k) for k in range(1, len(self.names))] for name in self.figure_names},
            "tasks": [
                [
                    {
                        "task": (pair.first or pair.other).task,  # type: ignore[union-attr]
                        "took_s": [_took_s(pair.first), _took_s(pair.other)],
                        "results": [
                            None if pair.first is None else pair.first.result,
                            None if pair.other is None else pair.other.result,
                        ],
                    }
                    for pair in pairs
                ]
                for pairs in self.tasks
            ],
        }


def compare_reports(names: Sequence[str], reports: Sequence[FlightReport], circumstances: Circumstances) -> Comparison:
    """Hold reports, two at least, against the first."""
    return Comparison(
        tuple(names),
        tuple(reports),
        circumstances,
        tuple(figures_of(report) for report in reports),
        tuple(pair_tasks(reports[0].tasks, report.tasks) for report in reports[1:]),
    )


def distinct_names(logs: Sequence[Path]) -> list[str]:
    """What each log is called: its name without its ending, with its folders where others are called alike."""
    stems = [log.stem for log in dict.fromkeys(logs)]
    return [str(log.with_suffix("")) if stems.count(log.stem) > 1 else log.stem for log in logs]


def _took_s(task: Any) -> float | None:
    return None if task is None or task.end_s is None else task.end_s - task.start_s
