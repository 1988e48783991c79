"""The command line: the composition root. Heavy rooms are imported by the command that needs them."""

import sys
import tempfile
import traceback
from pathlib import Path
from typing import Annotated, Literal

import typer

from mission import fly_commands, import_commands, inspect_commands
from mission.camera_commands import app as camera_app
from mission.ending import EXIT_BAD_INPUT, EXIT_FAILED_FILE, EXIT_FAULT, fail, read_mission
from mission.export_commands import app as export_app
from mission.fly_commands import MissionArgument
from mission.simulated.world_commands import app as world_app
from mission.simulated.world_pictures import app as pictures_app
from mission.terminal import OutputLostError, forget_output, watch_output

app = typer.Typer(
    help="Fly a multirotor along a power line by sight.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

app.add_typer(camera_app, name="camera")
app.add_typer(export_app, name="export")
world_app.add_typer(pictures_app)  # without a name of its own: its commands stand beside the others
app.add_typer(world_app, name="world")

# vision.pipeline.Detector, without its import
DetectorName = Literal["projection", "cbs", "steerable", "hough", "lsd", "edlines"]

app.command("dry-run")(fly_commands.dry_run)
app.command()(fly_commands.run)
app.command()(fly_commands.resume)
app.command()(fly_commands.sitl)
app.command()(inspect_commands.inspect)
app.command()(inspect_commands.compare)
app.command()(inspect_commands.replay)
app.command("import")(import_commands.import_log)


def main() -> None:
    """Run the command line. A fault of our own ends in a sentence too, and its traceback in a file."""
    watch_output()
    try:
        try:
            app()
        finally:
            if sys.stdout is not None:  # it was closed before we began
                sys.stdout.flush()
    except BrokenPipeError:
        forget_output()
        sys.exit(EXIT_FAILED_FILE)
    except OutputLostError as error:
        forget_output()
        sys.stderr.write(f"{error}\n")
        sys.exit(EXIT_FAILED_FILE)
    except Exception as error:
        trace = Path(tempfile.gettempdir()) / "lineflight-fault.txt"
        trace.write_text(traceback.format_exc(), encoding="utf-8")
        sys.stderr.write(
            f"lineflight met a fault of its own ({type(error).__name__}: {error}); a vehicle that was under its "
            f"setpoints has been told to hold. Please send {trace} to the developers.\n"
        )
        sys.exit(EXIT_FAULT)


@app.command()
def check(
    mission: MissionArgument,
    diagram: Annotated[
        bool, typer.Option("--diagram", help="Draw the flight's state machine instead (Mermaid).")
    ] = False,
) -> None:
    """Validate a mission file, explain it, and estimate its flight."""
    mission_file = read_mission(mission)
    if diagram:
        from mission.machine_drawing import draw_mission

        typer.echo(draw_mission(mission_file.plan), nl=False)
        return
    from rich.console import Console

    from mission.explain import print_plan
    from mission.offline_checks import check_offline

    checks = check_offline(mission_file.plan)
    print_plan(mission_file.plan, checks, Console())
    if any(check.is_final for check in checks):
        fail(f"{mission}: this mission is refused; see what failed above", EXIT_BAD_INPUT)


@app.command()
def detect(
    source: Annotated[Path, typer.Argument(metavar="IMAGE|FOLDER|VIDEO", help="What to look at.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object a line.")] = False,
    draw: Annotated[Path | None, typer.Option(help="Draw the lines: a file for one image, else a folder.")] = None,
    detector: Annotated[
        DetectorName, typer.Option(help="What finds the edges; flights use projection.")
    ] = "projection",
) -> None:
    """Find the power lines in photographs or a video."""
    from mission.detect import DetectError, detect_all

    try:
        n_unreadable = detect_all(source, detector, as_json=as_json, draw_to=draw)
    except DetectError as error:
        fail(str(error), EXIT_BAD_INPUT)
    if n_unreadable:
        raise typer.Exit(EXIT_FAILED_FILE)


if __name__ == "__main__":
    main()
