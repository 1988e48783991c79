"""Print a comparison for a person."""

from collections.abc import Iterator

from rich.console import Console
from rich.table import Table
from rich.text import Text

from mission.compare.comparison import Comparison
from mission.compare.figure_words import change_words, label_of, value_words
from mission.compare.figures import TaskPair
from mission.log.paper import Part, columns_of, put, table, width_of
from mission.log.wording import words_of

_Columns = dict[str, list[str]]
_NARROWEST = 16  # columns of a terminal for what one flight was flown with


def print_comparison(comparison: Comparison, console: Console) -> None:
    """Print what the flights were flown with, how each ended, every figure, and the tasks that went otherwise."""
    put(_parts(comparison, columns_of(console)), console)


def _parts(comparison: Comparison, width: int) -> Iterator[Part]:
    yield Text()
    for number, (name, report) in enumerate(zip(comparison.names, comparison.reports, strict=True), start=1):
        yield Text.assemble(
            (f"{number}  ", "bold"), f"{name}: {report.mission}, {report.headline}: ", (report.reason, "dim")
        )
    yield Text()
    circumstances = comparison.circumstances
    if circumstances.differing:
        yield from _circumstances_tables(comparison, width)
        if circumstances.n_not_shown:
            yield Text(f"{circumstances.n_not_shown} more differ: --json tells them all.")
            yield Text()
    if circumstances.alike:
        words = ", ".join(f"{name} {value}" for name, value in circumstances.alike.items())
        yield Text(f"{'Otherwise the' if circumstances.differing else 'The'} same for all: {words}.", style="dim")
        yield Text()
    yield from _figure_tables(comparison, width)
    lines = [
        line
        for other, pairs in enumerate(comparison.tasks, start=2)
        for pair in pairs
        if (line := task_line(pair, other)) is not None
    ]
    for line in lines:
        yield Text(line, style="yellow")


def _circumstances_tables(comparison: Comparison, width: int) -> Iterator[Table]:
    shown = comparison.circumstances.shown
    n_flights = len(comparison.names)
    n_beside = max(2, (width - max(map(len, shown))) // _NARROWEST)
    for start in range(0, n_flights, n_beside):
        found = table(_titled("What they were flown with differs", start))
        found.add_column("", no_wrap=True)
        for number in range(start, min(start + n_beside, n_flights)):
            found.add_column(str(number + 1), overflow="fold")
        for name, values in shown.items():
            found.add_row(Text(name, style="yellow"), *map(Text, values[start : start + n_beside]))
        yield found


def _figure_tables(comparison: Comparison, width: int) -> Iterator[Table]:
    """Every figure, in one table where that is at most `width` columns wide: no number is wrapped or cut.

    Else without the names in words, then changes in a table of their own, then fewer flights beside each other.
    """
    n_flights = len(comparison.names)
    names = [name for name in comparison.figure_names if any(of.get(name) is not None for of in comparison.figures)]
    heads = {"for --fail-if": names}
    words = {"figure": [label_of(name) for name in names]}
    values = {
        str(k + 1): [value_words(name, figures.get(name)) for name in names]
        for k, figures in enumerate(comparison.figures)
    }
    changes = {
        "change" if n_flights == 2 else f"change {k + 1}": [
            change_words(name, comparison.change(name, k)) for name in names
        ]
        for k in range(1, n_flights)
    }
    for left in (heads | words, heads):
        whole = _figure_table("Figures", left, values | changes)
        if width_of(whole) <= width:
            yield whole
            return
    yield from _beside_each_other("Figures", heads, values, width)
    yield from _beside_each_other("Changes from 1", heads, changes, width)


def _beside_each_other(title: str, left: _Columns, numbers: _Columns, width: int) -> Iterator[Table]:
    """The columns of numbers in as few tables as are not too wide, each with those at the left."""
    waiting = list(numbers)
    while waiting:
        n_beside = len(waiting)
        while n_beside > 1 and width_of(_figure_table("", left, {h: numbers[h] for h in waiting[:n_beside]})) > width:
            n_beside -= 1
        start = len(numbers) - len(waiting)
        yield _figure_table(_titled(title, start), left, {head: numbers[head] for head in waiting[:n_beside]})
        waiting = waiting[n_beside:]


def _figure_table(title: str, left: _Columns, numbers: _Columns) -> Table:
    found = table(title)
    for head in left:
        found.add_column(head, style="dim" if head == next(iter(left)) else "", overflow="fold")
    for head in numbers:
        found.add_column(head, justify="right", overflow="fold")
    for row in zip(*left.values(), *numbers.values(), strict=True):
        found.add_row(*row)
    return found


def _titled(title: str, start: int) -> str:
    return f"{title}, continued" if start else title


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
