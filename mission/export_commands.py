"""`lineflight export`: a flight log for other programs."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mission.ending import EXIT_FAILED_FILE, fail, refuse, tell_flaws
from mission.export.errors import ExportError, OutputError
from mission.log.errors import LogError
from mission.log.wording import counted

if TYPE_CHECKING:
    from mission.export.flight_map import FlightMap

app = typer.Typer(help="Give a flight log to other programs.", no_args_is_help=True)

LogArgument = Annotated[Path, typer.Argument(metavar="LOG", help="A flight log (.mcap).")]
FolderArgument = Annotated[Path, typer.Argument(metavar="FOLDER", help="A new or empty folder.")]
FileArgument = Annotated[Path, typer.Argument(metavar="FILE", help="A new file.")]


@app.command("csv")
def export_csv(log: LogArgument, folder: FolderArgument) -> None:
    """Write a table for each stream of records, as CSV."""
    from mission.export.tables import CsvTable, export_tables

    with _sentences(log), _progress("records") as advance:
        n_rows = export_tables(log, folder, ".csv", CsvTable, advance)
    _say_tables(folder, n_rows)


@app.command("parquet")
def export_parquet(log: LogArgument, folder: FolderArgument) -> None:
    """Write a table for each stream of records, as Parquet."""
    try:
        from mission.export.parquet import ParquetTable
    except ModuleNotFoundError:
        refuse("Parquet needs pyarrow, which is not installed; install it with: pip install 'lineflight[parquet]'.")
    from mission.export.tables import export_tables

    with _sentences(log), _progress("records") as advance:
        n_rows = export_tables(log, folder, ".parquet", ParquetTable, advance)
    _say_tables(folder, n_rows)


@app.command("kml")
def export_kml(log: LogArgument, file: FileArgument) -> None:
    """Write the track, the photographs' places, the events and the line as KML, for Google Earth."""
    from mission.export.kml import kml

    _write_map(log, file, (".kml",), kml)


@app.command("geojson")
def export_geojson(log: LogArgument, file: FileArgument) -> None:
    """Write the track, the photographs' places, the events and the line as GeoJSON, for maps."""
    from mission.export.geojson import geojson

    _write_map(log, file, (".geojson", ".json"), geojson)


@app.command("images")
def export_images(
    log: LogArgument,
    folder: FolderArgument,
    every: Annotated[int, typer.Option(min=1, metavar="N", help="Take only every Nth frame.")] = 1,
    task: Annotated[str | None, typer.Option(help="Take the frames of this task only, e.g. follow_lines.")] = None,
) -> None:
    """Write the frames with EXIF, and their poses for COLMAP, for 3D reconstruction."""
    try:
        from mission.export.images import export_images
    except ModuleNotFoundError:
        refuse("EXIF needs Pillow, which is not installed; install it with: pip install 'lineflight[export]'.")
    with _sentences(log), _progress("images") as advance:
        written = export_images(log, folder, task=task, every=every, on_image=advance)
    whose = "its pose" if written.n_images == 1 else "their poses"
    typer.echo(f"{folder}: {counted(written.n_images, 'image')}, and {whose} for COLMAP in {folder / 'sparse' / '0'}")
    if written.n_without_pose:
        typer.echo(f"{counted(written.n_without_pose, 'frame')} left out: the log does not tell where they were taken")
    if not written.has_gps:
        typer.echo("the images carry no GPS position: the log does not tell where on Earth the local frame lies")


def _write_map(log: Path, file: Path, suffixes: tuple[str, ...], written: "Callable[[FlightMap], bytes]") -> None:
    from mission.export.flight_map import read_map
    from mission.export.output import write_new_file

    if file.suffix.lower() not in suffixes:
        refuse(f"FILE is '{file}'; name a file that ends in {' or '.join(suffixes)}.")
    with _sentences(log):
        with _progress("map"):
            flight_map = read_map(log)
        write_new_file(file, written(flight_map))
    typer.echo(f"{file}: {_counted(flight_map)}")


def _counted(flight_map: "FlightMap") -> str:
    from mission.export.flight_map import Kind

    words = {
        Kind.TRACK: ("piece of track", "pieces of track"),
        Kind.PHOTOGRAPH: ("photograph", "photographs"),
        Kind.EVENT: ("event", "events"),
        Kind.KNOWN_LINE: ("piece of the line as known", "pieces of the line as known"),
        Kind.TRUE_LINE: ("true conductor", "true conductors"),
    }
    counts = {kind: sum(feature.kind is kind for feature in flight_map.features) for kind in words}
    return ", ".join(f"{n} {words[kind][n != 1]}" for kind, n in counts.items() if n)


def _say_tables(folder: Path, n_rows: dict[str, int]) -> None:
    typer.echo(f"{folder}: {counted(len(n_rows), 'table')} with {counted(sum(n_rows.values()), 'record')}")


@contextmanager
def _sentences(log: Path) -> Iterator[None]:
    """End the command with the sentence and the exit code that an error of the export stands for.

    What the log lacks, and so was not exported, is said too: it may be why there is no export.
    """
    from mission.log.reader import find_flaws

    try:
        yield
        tell_flaws(log, find_flaws(log))
    except ExportError as error:
        with suppress(LogError):
            tell_flaws(log, find_flaws(log))
        refuse(str(error))
    except LogError as error:
        with suppress(LogError):  # which says itself where too little is left
            tell_flaws(log, replace(find_flaws(log), is_cut_off=False))
        refuse(str(error))
    except OutputError as error:
        fail(str(error), EXIT_FAILED_FILE)


@contextmanager
def _progress(what: str) -> Iterator[Callable[[], None]]:
    """Count on the terminal what is done, while it is done."""
    from rich.console import Console
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    columns = (SpinnerColumn(), TextColumn("{task.completed:.0f} {task.description}"), TimeElapsedColumn())
    console = Console(stderr=True)
    with Progress(*columns, console=console, transient=True, disable=not sys.stderr.isatty()) as progress:
        task = progress.add_task(what, total=None)
        yield lambda: progress.advance(task)
