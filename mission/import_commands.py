"""`lineflight import`: put an autopilot's own log beside ours."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mission.ending import EXIT_FAILED_FILE, fail, refuse, tell_flaws
from mission.log.errors import LogError

if TYPE_CHECKING:
    from collections.abc import Callable

    from mission.imports.autopilot_log import AutopilotLog
    from mission.log.imported import ImportedLog
    from mission.log.reader import Flight

_FAR_M = 0.5  # one estimate does not differ by so much from itself


def import_log(
    log: Annotated[Path, typer.Argument(help="A flight log (.mcap).")],
    autopilot_log: Annotated[Path, typer.Argument(help="PX4's .ulg, ArduPilot's .bin, or a .tlog or .tlog.xz.")],
    out: Annotated[
        Path | None, typer.Option(metavar="OUT.mcap", help="The new log; by default <name>-with-autopilot.mcap.")
    ] = None,
) -> None:
    """Put an autopilot's own log beside ours, in a new log."""
    from mission.imports.errors import AutopilotLogError, NoMatchError
    from mission.imports.lay_beside import align_best, imported_log, on_our_time_line
    from mission.imports.open import digest, read_autopilot_log
    from mission.log.copying import CopyError, write_copy

    out = log.with_name(f"{log.stem}-with-autopilot.mcap") if out is None else out
    if out.exists():
        refuse(f"{out} exists already; name another file by --out, or remove it.")
    try:
        flight = _read_ours(log)
        tell_flaws(log, flight.flaws)
        with _progress(f"reading {autopilot_log.name}") as tell:
            logs = read_autopilot_log(autopilot_log, tell)
        alignment = align_best(flight, logs)
        entry = imported_log(alignment, autopilot_log.name, digest(autopilot_log), was_cut_off=flight.is_truncated)
        offset_ns = flight.mission.unix_minus_flight_ns
        records = [(record.t_ns + offset_ns, record) for record in on_our_time_line(alignment)]
        with _progress(f"writing {out.name}") as tell:
            write_copy(log, out, [(flight.mission.start_ns + offset_ns, entry), *records], tell)
    except (LogError, AutopilotLogError) as error:
        refuse(str(error))
    except NoMatchError as error:
        refuse(f"{autopilot_log} cannot be laid beside {log}: {error}.")
    except CopyError as error:
        fail(str(error), EXIT_FAILED_FILE)
    if alignment.log.breaks_off:
        sys.stderr.write(f"{autopilot_log} breaks off; what there is of it was imported.\n")
    if alignment.log.is_damaged:
        sys.stderr.write(f"{autopilot_log} is damaged in places; what could be read of it was imported.\n")
    if alignment.unexplained_shift_m > _FAR_M:
        sys.stderr.write(
            f"{autopilot_log} has its positions {alignment.unexplained_shift_m:.1f} m away from ours on average, and "
            "they were left there; did the autopilot set its origin anew?\n"
        )
    _print(entry, alignment.log, len(logs))
    typer.echo(f"log        {out}")


def _read_ours(path: Path) -> "Flight":
    """Read our own log, which must not hold an autopilot's yet; raises LogError."""
    from mission.log.reader import read_flight

    flight = read_flight(path)
    if flight.imported is not None:
        raise LogError(
            f"{path} holds the autopilot's log {flight.imported.log.file} already; name the log as it was recorded."
        )
    return flight


def _print(entry: "ImportedLog", log: "AutopilotLog", n_logs: int) -> None:
    """Say how the clocks were aligned, and how well it fits."""
    from collections import Counter

    autopilot = " · ".join(part for part in (entry.version or entry.kind, entry.vehicle) if part)
    if n_logs > 1:
        autopilot += f" · one of {n_logs} starts in the file"
    typer.echo(f"autopilot  {autopilot}")
    by = {"time_sync": "time sync", "boot_times": "telemetry's boot times"}.get(entry.aligned_by, "motion")
    drift = f"{entry.drift_ppm:+.1f} ppm" if entry.drift_ppm else "none estimated"
    typer.echo(f"clocks     by {by}: flight time = autopilot time {entry.offset_s:+.3f} s, drift {drift}")
    if entry.telemetry_lag_s is not None:
        typer.echo(f"telemetry  came {entry.telemetry_lag_s * 1e3:.0f} ms late into our log, on average")
    typer.echo(
        f"fit        correlation {entry.correlation:.3f} over {entry.overlap_s:.0f} s; rms differences "
        f"{entry.velocity_rms_m_s:.2f} m/s and {entry.position_rms_m:.2f} m"
    )
    if any(entry.shift_ned_m):
        north_m, east_m, down_m = entry.shift_ned_m
        typer.echo(
            f"frame      the autopilot's positions were moved by {north_m:+.2f} m north, {east_m:+.2f} m east, "
            f"{down_m:+.2f} m down, so that they match ours on average"
        )
    counts = Counter(type(record).__name__.removeprefix("Imported").lower() for record in log.records)
    typer.echo("imported   " + ", ".join(f"{counts[name]} {of}" for name, of in _PLURALS.items() if counts[name]))


_PLURALS = {
    "state": "states", "setpoint": "setpoints", "actuators": "motor outputs", "power": "battery readings",
    "text": "messages", "mode": "modes",
}  # fmt: skip


@contextmanager
def _progress(what: str) -> Iterator["Callable[[float], None]"]:
    """A bar on the terminal that its block can move, from 0 to 1; it pulses until it hears of anything."""
    from rich.console import Console
    from rich.progress import Progress

    # The stream by name, since a library's own words are kept off sys.stderr while it reads.
    with Progress(console=Console(file=sys.stderr), transient=True, disable=not sys.stderr.isatty()) as progress:
        task = progress.add_task(what, total=None)
        yield lambda share: progress.update(task, total=1.0, completed=share)
