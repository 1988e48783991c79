"""Print a comparison for a person."""

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table
from rich.text import Text

from mission.compare.comparison import Comparison
from mission.log.wording import words_of


def print_comparison(comparison: Comparison, console: Console) -> None:
    """Print how each flight ended, every figure that any has, and the tasks whose results differ or that one lacks."""
    for name, report in zip(comparison.names, comparison.reports, strict=True):
        console.print(Text(f"{name}: {report.mission}, {words_of(report.result)}: {report.reason}"))
    if len({report.mission for report in comparison.reports}) > 1:
        console.print(Text("These are different missions.", style="yellow"))
    table = Table(box=SIMPLE_HEAD, title="Figures", title_justify="left", title_style="bold")
    table.add_column("figure", no_wrap=True)
    for name in comparison.names:
        table.add_column(name, justify="right", overflow="fold")
    for other in range(1, len(comparison.names)):
        table.add_column("change" if len(comparison.names) == 2 else f"change {other + 1}", justify="right")
    for name in comparison.figure_names:
        values = [figures.get(name) for figures in comparison.figures]
        if all(value is None for value in values):
            continue
        changes = [comparison.change(name, other) for other in range(1, len(values))]
        table.add_row(name, *map(_number, values), *(_signed(change) for change in changes))
    console.print(table)
    for other, pairs in enumerate(comparison.tasks, start=1):
        for pair in pairs:
            line = _task_line(comparison, other, pair.first, pair.other)
            if line is not None:
                console.print(Text(line, style="yellow"))


def _task_line(comparison: Comparison, other: int, first: object, second: object) -> str | None:
    a, b = (getattr(task, "task", None) for task in (first, second))
    first_log, other_log = comparison.names[0], comparison.names[other]
    if a is None or b is None:
        flew, lacks, name = (other_log, first_log, b) if a is None else (first_log, other_log, a)
        return f"{flew} flew {words_of(str(name))}, {lacks} did not"
    results = [str(getattr(task, "result", "")) for task in (first, second)]
    if results[0] == results[1]:
        return None
    return f"{words_of(a)} {words_of(results[0])} in {first_log}, {words_of(results[1])} in {other_log}"


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.4g}"


def _signed(value: float | None) -> str:
    return "-" if value is None else f"{value:+.4g}" if abs(value) > 1e-12 else "0"
