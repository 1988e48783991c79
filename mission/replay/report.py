"""Print for a person where a replay differs."""

from collections.abc import Sequence

from rich.console import Console
from rich.table import Table
from rich.text import Text

from mission.replay.differences import Differences, Spread

_BY_TIME = (
    "The log was sorted by time since it was flown: which estimate a control tick used is told by latencies, which may "
    "err by a tick. Replay the log as it was recorded."
)


def print_differences(found: Differences, beyond: Sequence[str], console: Console) -> None:
    """Print the differences, and first what of them is `beyond` the tolerance."""
    against = "the reference in the log" if found.is_reference else "the flight"
    console.print()
    console.print(Text(f"Replayed, and held against {against}", style="bold"))
    for line in beyond:
        console.print(Text("  " + line, style="bold red"))
    if not found.is_by_order:
        console.print(Text(f"  {_BY_TIME}", style="yellow"))
    estimates, setpoints = found.estimates, found.setpoints
    table = Table(box=None, show_header=False)
    table.add_column(no_wrap=True, style="dim")
    table.add_column()
    flipped = f"{estimates.n_only_now} show a line only now, {estimates.n_only_then} only then"
    table.add_row("  estimates", f"{estimates.n_same} of {estimates.n} the same to the bit; {flipped}")
    table.add_row("  angle", _words(estimates.angle_deg, "degrees"))
    table.add_row("  offset", _words(estimates.offset_px, "px"))
    table.add_row("  setpoints", f"{setpoints.n_same} of {setpoints.n} the same to the bit")
    table.add_row("  place", _words(setpoints.distance_m, "m"))
    table.add_row("  yaw", _words(setpoints.yaw_deg, "degrees"))
    console.print(table)
    console.print()


def _words(spread: Spread | None, unit: str) -> str:
    if spread is None:
        return "nothing to compare"
    return f"differs by {spread.median:.3g} {unit} median, {spread.p95:.3g} {unit} p95, {spread.max:.3g} {unit} at most"
