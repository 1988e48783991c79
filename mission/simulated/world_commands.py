"""`lineflight world`: which worlds there are, what is in one, and one made from a map of power lines."""

from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mission.ending import refuse

if TYPE_CHECKING:
    from rich.console import Console

    from sitl.world.line_models import LineModel
    from sitl.world.models import WorldModel
    from sitl.world.records import PowerLine, World

app = typer.Typer(help="List and look at simulated worlds, and make them from maps.", no_args_is_help=True)


@app.command("list")
def list_worlds() -> None:
    """Say which worlds come with lineflight."""
    from sitl.world.file import DEFAULT_WORLD, WorldError, read_world_file, shipped_worlds

    names = shipped_worlds()
    width = max(len(name) for name in names)
    for name in names:
        try:
            description = read_world_file(name).description
        except WorldError as error:
            refuse(str(error))
        by_default = " (the default)" if name == DEFAULT_WORLD else ""
        typer.echo(f"{name:<{width}}  {description}{by_default}")


@app.command()
def show(world: Annotated[str, typer.Argument(help="A world's name or file.")]) -> None:
    """Say what is in a world: its extent, its lines with spans and sags, what else stands there, and its light."""
    from rich.console import Console

    from sitl.world.file import WorldError, load_world, read_world_file

    try:
        model, loaded = read_world_file(world), load_world(world)
    except WorldError as error:
        refuse(str(error))
    _print_world(model, loaded, Console())


@app.command("import")
def import_map(
    file: Annotated[Path, typer.Argument(help="GeoJSON, or Overpass data (JSON), with power lines.")],
    out: Annotated[Path, typer.Option(help="The world file to write.")] = Path("world.yaml"),
    start_support: Annotated[
        int | None, typer.Option(help="Start beside the span after this support of the longest line, counted from 1.")
    ] = None,
    radius: Annotated[float, typer.Option(min=100.0, max=5000.0, help="Leave out what is farther away [m].")] = 1000.0,
) -> None:
    """Make a world of the power lines of OpenStreetMap: the longest line first, the start 15 m beside it."""
    from sitl.world.file import WorldError, load_world
    from sitl.world.power_import import world_text
    from sitl.world.power_map import PowerMapError, read_power_map

    try:
        text = world_text(read_power_map(file), file, start_support, radius)
    except PowerMapError as error:
        refuse(str(error))
    if out.suffix not in (".yaml", ".yml"):
        refuse(f"--out is '{out}'; name a file that ends in .yaml.")
    try:
        out.write_text(text, encoding="utf-8")
    except OSError as error:
        refuse(f"The world file {out} cannot be written: {error.strerror}.")
    try:
        loaded = load_world(str(out))
    except WorldError as error:
        refuse(f"{error} It is kept for mending.")
    lines = "1 line" if len(loaded.lines) == 1 else f"{len(loaded.lines)} lines"
    typer.echo(f"{out}: {lines} on {len(loaded.supports)} supports")


def _print_world(model: "WorldModel", world: "World", console: "Console") -> None:
    from rich import box
    from rich.table import Table

    def say(words: str) -> None:
        console.print(words, highlight=False, soft_wrap=True, markup=False)

    south, west, north, east = world.terrain.bounds_ne_m
    up_m = world.terrain.up_m
    say(f"{world.name}  {model.description}")
    say(f"{north - south:.0f} m from south to north, {east - west:.0f} m from west to east")
    if float(up_m.max()) > float(up_m.min()):
        say(f"terrain {model.terrain.kind}: {up_m.min():.1f} to {up_m.max():.1f} m, 0 at the start")
    else:
        say("flat terrain")
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for column in ("line", "supports"):
        table.add_column(column)
    for column in ("wires", "spans", "sag", "over ground"):
        table.add_column(column, justify="right", no_wrap=True)
    for k, (line, of_file) in enumerate(zip(world.lines, model.lines, strict=True), start=1):
        of_file_n = of_file.conductors.n * of_file.conductors.n_bundle
        n_shield = of_file.shield_wires.n if of_file.shield_wires is not None else 0
        table.add_row(
            of_file.name or str(k),
            f"{len(line.supports)} {line.supports[0].kind.replace('_', ' ')}s, {of_file.support.height_m:g} m",
            f"{of_file_n} + {n_shield}" if n_shield else str(of_file_n),
            *_line_figures(world, line, of_file),
        )
    console.print(table)
    things = Counter([*(strip.kind for strip in world.strips), *(tree.kind for tree in world.trees)])
    words = [f"{count} {kind}" for kind, count in sorted(things.items())]
    if world.buildings:
        words.append(f"{len(world.buildings)} buildings")
    if words:
        say(", ".join(words))
    say(f"ground {world.ground.style}, light {model.light}")


def _line_figures(world: "World", line: "PowerLine", of_file: "LineModel") -> tuple[str, str, str]:
    """Spans, sags and the least height over ground, in words."""
    from sitl.world.clearance import least_clearance_m, spans_m
    from sitl.world.route import stands
    from sitl.world.stringing import runs, sags_m

    laid = [
        replace(stand, up_m=-support.base_ned_m[2])
        for stand, support in zip(stands(of_file, "lines", world.start_yaw_rad), line.supports, strict=True)
    ]
    return (
        _range(spans_m(line), 0),
        _range(sags_m(laid, runs(of_file.n_spans, of_file.missing_spans), of_file.conductors), 1),
        f"{least_clearance_m(line, world.terrain):.1f} m",
    )


def _range(values_m: list[float], digits: int) -> str:
    low, high = (f"{value:.{digits}f}" for value in (min(values_m), max(values_m)))
    return f"{low} m" if low == high else f"{low}-{high} m"
