"""The command line: the composition root. Heavy rooms are imported by the command that needs them.

Exit codes: 0 done · 1 a log could not be written, or some of the images not read · 2 bad input (a mission, world,
camera, log or option that cannot be used), nothing was connected · 3 not ready, the vehicle was never armed · 4 the
mission ended early · 5 the pilot, or the autopilot's failsafe, has the vehicle · 70 a fault of lineflight's own ·
130 stopped by the operator.
"""

import asyncio
import json
import sys
import tempfile
import traceback
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, NoReturn

import typer

from mission.camera_commands import app as camera_app
from mission.log.errors import LogError

if TYPE_CHECKING:
    from mission.flight import FlightOutcome, FlightSetup
    from mission.log.summary import FlightReport
    from mission.plan import MissionPlan
    from mission.plan_file import MissionFile
    from mission.resumption import Resumption
    from mission.simulated.simulation import Simulation

EXIT_FAILED_FILE = 1
EXIT_BAD_INPUT = 2
EXIT_NOT_READY = 3
EXIT_ENDED_EARLY = 4
EXIT_TAKEN_OVER = 5
EXIT_FAULT = 70
EXIT_INTERRUPTED = 130

app = typer.Typer(
    help="Fly a multirotor along a power line by sight.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

app.add_typer(camera_app, name="camera")

MissionArgument = Annotated[Path, typer.Argument(help="The mission file (YAML); missions/ holds examples.")]
SpeedOption = Annotated[float, typer.Option(min=0.1, max=20, help="Times faster than real time.")]
SeedOption = Annotated[int, typer.Option(min=0, help="Seed of wind, sensors and image noise.")]
WindOption = Annotated[float, typer.Option(min=0, max=20, help="Mean wind in m/s, with the gusts that belong to it.")]
WorldOption = Annotated[str | None, typer.Option(help="A world's name or file; by default medium_voltage.")]
LogOption = Annotated[Path, typer.Option(help="The folder for logs.")]
# vision.pipeline.Detector, without its import
DetectorName = Literal["projection", "cbs", "steerable", "hough", "lsd", "edlines"]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON instead of tables.")]


def main() -> None:
    """Run the command line. A fault of our own ends in a sentence too, and its traceback in a file."""
    try:
        app()
    except Exception as error:
        trace = Path(tempfile.gettempdir()) / "lineflight-fault.txt"
        trace.write_text(traceback.format_exc(), encoding="utf-8")
        sys.stderr.write(
            f"lineflight met a fault of its own ({type(error).__name__}: {error}); a vehicle that was under its "
            f"setpoints has been told to hold. Please send {trace} to the developers.\n"
        )
        sys.exit(EXIT_FAULT)


@app.command("dry-run")
def dry_run(
    mission: MissionArgument,
    speed: SpeedOption = 1.0,
    seed: SeedOption = 1,
    wind: WindOption = 0.0,
    world: WorldOption = None,
    log: LogOption = Path("logs"),
    as_json: JsonOption = False,
) -> None:
    """Fly a mission with the simulated vehicle in a rendered world."""
    mission_file = _read_mission(mission)
    from drivers.clock import ScaledClock
    from mission.flight import FlightSetup
    from mission.simulated.simulation import Simulation, WorldError, true_line, world_path_or_name

    clock = ScaledClock(speed, ScaledClock().now_ns())
    try:
        simulation = Simulation(world_path_or_name(world), clock, seed, wind)
    except WorldError as error:
        _fail(str(error), EXIT_BAD_INPUT)
    with simulation:
        setup = FlightSetup(
            mission=mission_file,
            connection=simulation.connection,
            open_camera=simulation.camera_opener(mission_file.camera, mission_file.plan.camera.rate_hz),
            clock=clock,
            log_folder=log,
            metadata={
                "command": "dry-run",
                "world": simulation.world.name,
                "seed": str(seed),
                "wind_m_s": f"{wind:g}",
                "speed": f"{speed:g}",
            },
            true_line=true_line(simulation.world),
            true_pose=simulation.true_pose,
        )
        outcome = _fly(setup)
    _finish(outcome, as_json=as_json, simulation=simulation)


@app.command()
def run(
    mission: MissionArgument,
    connection: Annotated[
        str | None, typer.Option(help="MAVSDK URL, e.g. serial:///dev/ttyAMA0:921600; else the mission's.")
    ] = None,
    camera: Annotated[str | None, typer.Option(help="v4l2:DEVICE, file:PATH or sim:WORLD; else the mission's.")] = None,
    log: LogOption = Path("logs"),
    as_json: JsonOption = False,
) -> None:
    """Fly a mission with a real vehicle, PX4 SITL, or `lineflight sitl`."""
    mission_file = _read_mission(mission)
    plan = mission_file.plan
    _run(mission_file, connection or plan.vehicle.connection, camera or plan.camera.source, log, as_json, None)


def _run(
    mission_file: "MissionFile",
    connection: str,
    camera: str,
    log: Path,
    as_json: bool,
    resumed: "tuple[MissionPlan, Resumption] | None",
) -> NoReturn:
    """Fly a mission, or what is left of it, with a vehicle that flies elsewhere."""
    from mission.flight import FlightSetup
    from mission.live_camera import CameraError, LiveCamera

    try:
        source = LiveCamera(camera, mission_file.plan.camera, mission_file.camera)
    except CameraError as error:
        _fail(str(error), EXIT_BAD_INPUT)
    with source:
        setup = FlightSetup(
            mission=mission_file,
            connection=connection,
            open_camera=source.open_camera,
            clock=source.clock,
            log_folder=log,
            metadata={"command": "run" if resumed is None else "resume", "camera": camera},
            feed_pose=source.feed_pose,
            remaining=None if resumed is None else resumed[0],
            resumption=None if resumed is None else resumed[1],
        )
        outcome = _fly(setup)
    _finish(outcome, as_json=as_json, simulation=None)


@app.command()
def resume(
    journal: Annotated[
        Path | None, typer.Argument(help="The journal (*.journal) beside a flight's log; else the newest one in --log.")
    ] = None,
    explain: Annotated[bool, typer.Option("--explain", help="Only say what it would do, and why.")] = False,
    connection: Annotated[str | None, typer.Option(help="MAVSDK URL; else the interrupted flight's.")] = None,
    camera: Annotated[str | None, typer.Option(help="v4l2:DEVICE or sim:WORLD; else the interrupted flight's.")] = None,
    log: LogOption = Path("logs"),
    as_json: JsonOption = False,
) -> None:
    """Take an interrupted mission up again, from its journal: after a crash, a takeover, or a change of battery."""
    from mission.journal import DRY_RUN, JournalError, check_ended, newest_journal, read_journal
    from mission.resumption import CannotResumeError, explain_resumption, find_resumption

    try:
        path = journal or newest_journal(log)
        begin, entries = read_journal(path)
        mission_file = _read_mission(Path(begin.mission_path))
        remaining, resumption = find_resumption(begin, entries, mission_file.plan, mission_file.sha256)
    except (JournalError, CannotResumeError) as error:
        _fail(_sentence(str(error)), EXIT_BAD_INPUT)
    typer.echo(f"journal  {path}", err=True)
    for line in explain_resumption(remaining, resumption, begin):
        typer.echo(line, err=not explain)
    if explain:
        return
    try:
        check_ended(path)
    except JournalError as error:
        _fail(str(error), EXIT_BAD_INPUT)
    if begin.camera == DRY_RUN and camera is None and connection is None:
        _fail("That was a dry-run: its vehicle is gone. To try it, fly with lineflight sitl and run.", EXIT_BAD_INPUT)
    _run(mission_file, connection or begin.connection, camera or begin.camera, log, as_json, (remaining, resumption))


def _sentence(words: str) -> str:
    return words[:1].upper() + words[1:].rstrip(".") + "."


@app.command()
def sitl(
    world: WorldOption = None,
    speed: SpeedOption = 1.0,
    port: Annotated[int, typer.Option(min=1, max=65535 - 40, help="UDP port that the vehicle sends to.")] = 14540,
    seed: SeedOption = 1,
    wind: WindOption = 0.0,
    autopilot: Annotated[Literal["px4", "arducopter"], typer.Option(help="Whose MAVLink the vehicle speaks.")] = "px4",
) -> None:
    """Run only the simulated vehicle, until Ctrl-C; any MAVLink program can fly it."""
    from mission.simulated.simulation import SETUP, WorldError, serve_until_stopped, world_path_or_name

    setup = ", ".join(f"{name} {value:g}" for name, value in SETUP.items())
    typer.echo(f"Its parameters are PX4's defaults, but {setup}.", err=True)
    typer.echo(f"The simulated vehicle sends to udp 127.0.0.1:{port}; Ctrl-C ends it.", err=True)
    try:
        summary = serve_until_stopped(world_path_or_name(world), speed, port, seed, wind, autopilot)
    except (WorldError, OSError) as error:
        _fail(str(error), EXIT_BAD_INPUT)
    typer.echo(
        f"{summary.simulated_s:.1f} s flown in {summary.wall_s:.1f} s: {summary.achieved_speed:.2f} times", err=True
    )


@app.command()
def check(
    mission: MissionArgument,
    diagram: Annotated[
        bool, typer.Option("--diagram", help="Draw the flight's state machine instead (Mermaid).")
    ] = False,
) -> None:
    """Validate a mission file, explain it, and estimate its flight."""
    mission_file = _read_mission(mission)
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
        _fail(f"{mission}: this mission is refused; see what failed above", EXIT_BAD_INPUT)


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
        _fail(str(error), EXIT_BAD_INPUT)
    if n_unreadable:
        raise typer.Exit(EXIT_FAILED_FILE)


@app.command()
def inspect(log: Annotated[Path, typer.Argument(help="A flight log (.mcap).")], as_json: JsonOption = False) -> None:
    """Say what happened in a flight."""
    try:
        report = _read_report(log)
    except LogError as error:
        _fail(str(error), EXIT_BAD_INPUT)
    _print_report(report, as_json=as_json)


def _read_mission(path: Path) -> "MissionFile":
    from mission.plan_file import MissionFileError, read_mission

    try:
        return read_mission(path)
    except MissionFileError as error:
        _fail("\n".join(error.lines()), EXIT_BAD_INPUT)


def _fly(setup: "FlightSetup") -> "FlightOutcome":
    from rich.console import Console

    from mission.flight import fly
    from mission.guard import GuardError
    from mission.watch import Watch

    try:
        with Watch(setup.mission.plan, Console(stderr=True)) as watch:
            return asyncio.run(fly(setup, watch.show, watch.tell_checks))
    except LogError as error:
        _fail(str(error), EXIT_FAILED_FILE)
    except GuardError as error:
        _fail(str(error), EXIT_NOT_READY)


def _finish(outcome: "FlightOutcome", *, as_json: bool, simulation: "Simulation | None") -> NoReturn:
    """Print the report, draw the picture, and exit with the code that tells how the flight ended.

    What cannot be read or drawn afterwards is said, and changes nothing about how the flight ended.
    """
    if outcome.log_failure is not None:
        sys.stderr.write(outcome.log_failure + "\n")
    speed = None if simulation is None or simulation.summary is None else simulation.summary.achieved_speed
    try:
        report = _read_report(outcome.log)
    except LogError as error:
        sys.stderr.write(f"{error}\nThe mission {outcome.ended.result}: {outcome.ended.reason}.\n")
        raise typer.Exit(_exit_code(outcome)) from None
    picture = _draw(outcome.log, simulation) if report.tasks else None
    if as_json:
        from mission.log.summary import to_json

        extra = {"log": str(outcome.log), "picture": None if picture is None else str(picture), "achieved_speed": speed}
        typer.echo(json.dumps(to_json(report) | extra))
    else:
        _print_report(report, as_json=False)
        typer.echo(f"log      {outcome.log}")
        if picture is not None:
            typer.echo(f"picture  {picture}")
        if speed is not None:
            typer.echo(f"speed    {speed:.2f} times real time")
    raise typer.Exit(_exit_code(outcome))


def _exit_code(outcome: "FlightOutcome") -> int:
    from mission.records import Result

    result = outcome.ended.result
    if result is Result.FAILED and not outcome.may_have_armed:
        return EXIT_NOT_READY
    return {Result.COMPLETED: 0, Result.INTERRUPTED: EXIT_INTERRUPTED, Result.TAKEN_OVER: EXIT_TAKEN_OVER}.get(
        result, EXIT_ENDED_EARLY
    )


def _draw(log: Path, simulation: "Simulation | None") -> Path | None:
    """The flight's picture, beside the log; None, with a word, when there can be none."""
    from mission.flight_picture import PictureError, write_picture

    try:
        return write_picture(log, None if simulation is None else simulation.world)
    except PictureError as error:
        sys.stderr.write(f"{error}\n")
        return None


def _read_report(log: Path) -> "FlightReport":
    from mission.log.reader import read_flight
    from mission.log.summary import summarise

    return summarise(read_flight(log))


def _print_report(report: "FlightReport", *, as_json: bool) -> None:
    from mission.log.summary import to_json

    if as_json:
        typer.echo(json.dumps(to_json(report)))
        return
    from rich.console import Console

    from mission.log.report import print_report

    print_report(report, Console())


def _fail(message: str, code: int) -> NoReturn:
    sys.stderr.write(message.rstrip() + "\n")
    raise typer.Exit(code)


if __name__ == "__main__":
    main()
