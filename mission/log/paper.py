"""Print tables and lines where they go: a terminal has a width and colours, a file or a pipe has neither."""

import io
from collections.abc import Iterable, Iterator

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.measure import Measurement
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

Part = Text | Table | Padding

_MOST_COLUMNS = 100
_WIDE = 10_000  # more than any line needs: into a file there is nothing to wrap at


def table(title: str, *, has_head: bool = True) -> Table:
    """An empty table under its title."""
    return Table(
        title=title,
        title_justify="left",
        title_style="bold",
        box=SIMPLE_HEAD if has_head else None,
        show_header=has_head,
    )


def columns_of(console: Console) -> int:
    """How many columns a table may take on `console` without being wrapped."""
    return min(console.width, _MOST_COLUMNS) if console.is_terminal else _WIDE


def width_of(found: Table) -> int:
    """How many columns a table takes in a terminal where nothing of it is wrapped."""
    ruler = Console(file=io.StringIO(), width=_WIDE)
    return Measurement.get(ruler, ruler.options, found).maximum


def put(parts: Iterable[Part], console: Console) -> None:
    """Print `parts` on `console`: in a terminal, at most 100 columns wide; elsewhere, each row on one line of its own.

    What is no terminal gets no colours, no drawn rules and no spaces at the ends of lines.
    """
    if console.is_terminal:
        width = columns_of(console)
        for part in _untitled(parts):
            if isinstance(part, Table):
                part.expand = True
            console.print(part, width=width)
        return
    paper = Console(file=io.StringIO(), width=_WIDE, color_system=None, force_terminal=False, legacy_windows=False)
    for part in _untitled(parts):
        if isinstance(part, Table):
            part.box, part.pad_edge = None, False
        with paper.capture() as captured:
            paper.print(part)
        console.file.writelines(line.rstrip() + "\n" for line in captured.get().splitlines())
        if isinstance(part, Table):
            console.file.write("\n")


def _untitled(parts: Iterable[Part]) -> Iterator[Part]:
    """The parts, each table's title as a line of its own: a narrow table would wrap it at its own width."""
    for part in parts:
        if isinstance(part, Table) and part.title:
            yield Text(str(part.title), style=part.title_style or "")
            part.title = None
        yield part
