"""Print for a person where a replay differs."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from rich.console import Console
from rich.table import Table
from rich.text import Text

from mission.log.paper import Part, put
from mission.replay.differences import Differences, Spread, Tolerance

_BY_TIME = (
    "The log was sorted by time since it was flown: which estimate a control tick used is told by latencies, which may "
    "err by a tick. Replay the log as it was recorded."
)
_DAMAGED = "The log is damaged: what came before a hole is not remembered, so that differences after it tell nothing."


def print_differences(
    found: Differences, beyond: Sequence[str], tolerance: Tolerance, console: Console, *, is_damaged: bool = False
) -> None:
    """Print the differences, and first whether they are within the tolerance: what of them is `beyond` it."""
    put(_parts(found, beyond, tolerance, is_damaged=is_damaged), console)


def _parts(found: Differences, beyond: Sequence[str], tolerance: Tolerance, *, is_damaged: bool) -> Iterator[Part]:
    against = "the reference in the log" if found.is_reference else "the flight"
    yield Text()
    yield Text(f"Replayed, and held against {against}", style="bold")
    if found.is_reference:
        within, style = ("differs by more than", "bold red") if beyond else ("the same, within", "green")
        yield Text(f"  {within} the tolerance of {_tolerance(tolerance)}", style=style)
    for line in beyond:
        yield Text("  " + line, style="bold red")
    if is_damaged:
        yield Text(f"  {_DAMAGED}", style="yellow")
    if not found.is_by_order:
        yield Text(f"  {_BY_TIME}", style="yellow")
    estimates, setpoints = found.estimates, found.setpoints
    table = Table(box=None, show_header=False)
    table.add_column(no_wrap=True, style="dim")
    table.add_column()
    flipped = f"{estimates.n_only_now} show a line only now, {estimates.n_only_then} only then"
    table.add_row("  estimates", f"{estimates.n_same} of {estimates.n} the same to the bit; {flipped}")
    table.add_row("  angle", _words(estimates.angle_deg, _DEGREES))
    table.add_row("  offset", _words(estimates.offset_px, _PIXELS))
    table.add_row("  setpoints", f"{setpoints.n_same} of {setpoints.n} the same to the bit")
    table.add_row("  place", _words(setpoints.distance_m, _MILLIMETRES))
    table.add_row("  yaw", _words(setpoints.yaw_deg, _DEGREES))
    yield table


@dataclass(frozen=True, slots=True)
class _Unit:
    """How a size is spelt: in units of `scale`, with so many digits, of which the last is the least that is told."""

    name: str
    scale: float
    digits: int

    def spell(self, value: float) -> str:
        """A size with its unit."""
        least = 10.0**-self.digits
        in_units = value / self.scale
        if 0.0 < in_units < least:
            return f"under {least:g} {self.name}"
        return f"{in_units:.{self.digits}f} {self.name}" if in_units else f"0 {self.name}"


_DEGREES, _PIXELS, _MILLIMETRES = _Unit("degrees", 1.0, 3), _Unit("px", 1.0, 2), _Unit("mm", 1e-3, 1)


def _words(spread: Spread | None, unit: _Unit) -> str:
    if spread is None:
        return "nothing to compare"
    if spread.max == 0.0:
        return "no difference"
    at = "" if spread.max_s is None else f" at {spread.max_s:.1f} s"
    median, p95, largest = (unit.spell(value) for value in (spread.median, spread.p95, spread.max))
    return f"differs by {median} median, {p95} p95, {largest} at most{at}"


def _tolerance(tolerance: Tolerance) -> str:
    return (
        f"{tolerance.setpoint_m * 1e3:g} mm, {tolerance.angle_deg:g} degrees and {tolerance.offset_px:g} px (p95), "
        f"and {tolerance.flipped_share:.0%} of the frames"
    )
