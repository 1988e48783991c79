"""Print a comparison for a person."""

from collections.abc import Iterator

from rich.console import Console
from rich.table import Table
from rich.text import Text

from mission.compare.comparison import Comparison
from mission.compare.figure_words import change_words, label_of, value_words
from mission.compare.figures import TaskPair
from mission.log.paper import Part, put, table
from mission.log.wording import words_of


def print_comparison(comparison: Comparison, console: Console) -> None:
    """Print what the flights were flown with, how each ended, every figure, and the tasks that went otherwise."""
    put(_parts(comparison), console)


def _parts(comparison: Comparison) -> Iterator[Part]:
    yield Text()
    for number, (name, report) in enumerate(zip(comparison.names, comparison.reports, strict=True), start=1):
        yield Text.assemble(
            (f"{number}  ", "bold"), f"{name}: {report.mission}, {report.headline}: ", (report.reason, "dim")
        )
    yield Text()
    circumstances = comparison.circumstances
    if circumstances.differing:
        yield _circumstances_table(comparison)
        if circumstances.n_not_shown:
            yield Text(f"{circumstances.n_not_shown} more differ: --json tells them all.")
            yield Text()
    if circumstances.alike:
        words = ", ".join(f"{name} {value}" for name, value in circumstances.alike.items())
        yield Text(f"{'Otherwise the' if circumstances.differing else 'The'} same for all: {words}.", style="dim")
        yield Text()
    yield _figure_table(comparison)
    lines = [
        line
        for other, pairs in enumerate(comparison.tasks, start=2)
        for pair in pairs
        if (line := task_line(pair, other)) is not None
    ]
    for line in lines:
        yield Text(line, style="yellow")


def _numbered(found: Table, comparison: Comparison, justify: str) -> None:
    for number in range(1, len(comparison.names) + 1):
        found.add_column(str(number), justify=justify, overflow="fold")  # type: ignore[arg-type]


def _circumstances_table(comparison: Comparison) -> Table:
    found = table("What they were flown with differs")
    found.add_column("", no_wrap=True)
    _numbered(found, comparison, "left")
    for name, values in comparison.circumstances.shown.items():
        found.add_row(Text(name, style="yellow"), *map(Text, values))
    return found


def _figure_table(comparison: Comparison) -> Table:
    found = table("Figures")
    found.add_column("for --fail-if", no_wrap=True, style="dim")
    found.add_column("figure")
    _numbered(found, comparison, "right")
    for other in range(1, len(comparison.names)):
        found.add_column("change" if len(comparison.names) == 2 else f"change {other + 1}", justify="right")
    for name in comparison.figure_names:
        values = [figures.get(name) for figures in comparison.figures]
        if any(value is not None for value in values):
            changes = [comparison.change(name, other) for other in range(1, len(values))]
            spelled = [value_words(name, value) for value in values]
            found.add_row(name, label_of(name), *spelled, *(change_words(name, change) for change in changes))
    return found


def task_line(pair: TaskPair, number: int) -> str | None:
    """What went otherwise with a task in flight `number` than in the first; None where nothing did."""
    first, other = pair.first, pair.other
    if first is not None and other is not None:
        if first.result == other.result:
            return None
        return f"{words_of(first.task)}: {words_of(first.result)} in 1, {words_of(other.result)} in {number}"
    if first is not None:
        return f"{words_of(first.task)}: flown in 1, not in {number}"
    return None if other is None else f"{words_of(other.task)}: flown in {number}, not in 1"
