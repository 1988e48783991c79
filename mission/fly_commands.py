"""`lineflight dry-run`, `run`, `resume` and `sitl`: what flies."""

import asyncio
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, NoReturn

import typer

from mission.ending import EXIT_BAD_INPUT, EXIT_FAILED_FILE, EXIT_NOT_READY, fail, finish, read_mission
from mission.live_options import (
    LiveAddressOption,
    LiveFoxglovePortOption,
    LiveOption,
    LivePortOption,
    live_settings,
    serve_live,
    tell_live,
)
from mission.log.errors import LogError

if TYPE_CHECKING:
    from mission.flight import FlightOutcome, FlightSetup
    from mission.live.settings import LiveSettings
    from mission.plan import MissionPlan
    from mission.plan_file import MissionFile
    from mission.resumption import Resumption
    from mission.simulated.scenario import Scenario

MissionArgument = Annotated[Path, typer.Argument(help="The mission file (YAML); missions/ holds examples.")]
SpeedOption = Annotated[float, typer.Option(min=0.1, max=20, help="Times faster than real time.")]
SeedOption = Annotated[int, typer.Option(min=0, help="Seed of wind, sensors and image noise.")]
WindOption = Annotated[float, typer.Option(min=0, max=20, help="Mean wind in m/s, with the gusts that belong to it.")]
WorldOption = Annotated[str | None, typer.Option(help="A world's name or file; by default medium_voltage.")]
# sitl.world.light.LightName, without its import
LightName = Literal["noon", "low_sun", "overcast", "dusk"]
LightOption = Annotated[LightName | None, typer.Option(help="The light of the day; by default the world's own.")]
WindFromOption = Annotated[
    float | None, typer.Option(min=-360, max=360, help="Degrees from north where the wind blows from; else by seed.")
]
GustFrontsOption = Annotated[bool, typer.Option("--gust-fronts", help="Single strong gusts, once a minute or twice.")]
# sitl.airframes.AirframeName, without its import
AirframeName = Literal["f550", "x500"]
AirframeOption = Annotated[AirframeName, typer.Option(help="The simulated vehicle.")]
LogOption = Annotated[Path, typer.Option(help="The folder for logs.")]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON instead of tables.")]


def dry_run(
    mission: MissionArgument,
    speed: SpeedOption = 1.0,
    seed: SeedOption = 1,
    wind: WindOption = 0.0,
    world: WorldOption = None,
    light: LightOption = None,
    wind_from: WindFromOption = None,
    gust_fronts: GustFrontsOption = False,
    airframe: AirframeOption = "f550",
    virtual_time: Annotated[
        bool,
        typer.Option("--virtual-time", help="In one process, without MAVLink: as fast as it can, and always the same."),
    ] = False,
    log: LogOption = Path("logs"),
    live: LiveOption = False,
    live_port: LivePortOption = None,
    live_address: LiveAddressOption = None,
    live_foxglove_port: LiveFoxglovePortOption = None,
    as_json: JsonOption = False,
) -> None:
    """Fly a mission with the simulated vehicle in a rendered world."""
    mission_file = read_mission(mission)
    from mission.simulated.scenario import Scenario
    from mission.simulated.simulation import WorldError, world_path_or_name

    if virtual_time and speed != 1.0:
        fail("--virtual-time goes as fast as it can: leave out --speed.", EXIT_BAD_INPUT)
    if virtual_time and live:
        fail("--virtual-time goes too fast to be watched: leave out --live, or --virtual-time.", EXIT_BAD_INPUT)
    watched = live_settings(live, live_port, live_address, live_foxglove_port)
    scenario = Scenario(world_path_or_name(world), light, seed, wind, _radians(wind_from), gust_fronts, airframe)
    try:
        if virtual_time:
            _fly_virtually(mission_file, scenario, log, as_json=as_json)
        _fly_beside(mission_file, scenario, speed, log, watched, as_json=as_json)
    except WorldError as error:
        fail(str(error), EXIT_BAD_INPUT)


def _fly_virtually(mission_file: "MissionFile", scenario: "Scenario", log: Path, *, as_json: bool) -> NoReturn:
    """Fly in virtual time, in this process."""
    from rich.console import Console

    from mission.simulated.virtual_flight import fly_virtually
    from mission.watch import Watch

    try:
        with Watch(mission_file.plan, Console(stderr=True)) as watch:
            outcome, aftermath = fly_virtually(mission_file, scenario, log, watch.show, watch.tell_checks)
    except LogError as error:
        fail(str(error), EXIT_FAILED_FILE)
    finish(outcome, as_json=as_json, aftermath=aftermath)


def _fly_beside(
    mission_file: "MissionFile",
    scenario: "Scenario",
    speed: float,
    log: Path,
    watched: "LiveSettings | None",
    *,
    as_json: bool,
) -> NoReturn:
    """Fly over MAVLink, with the simulated vehicle in a process of its own."""
    from drivers.clock import ScaledClock
    from mission.flight import FlightSetup
    from mission.simulated.simulation import Simulation, true_line

    clock = ScaledClock(speed, ScaledClock().now_ns())
    with Simulation(scenario, clock) as simulation:
        setup = FlightSetup(
            mission=mission_file,
            connection=simulation.connection,
            open_camera=simulation.camera_opener(mission_file.camera, mission_file.plan.camera.rate_hz),
            clock=clock,
            log_folder=log,
            metadata={
                "command": "dry-run",
                "world": scenario.world or simulation.world.name,
                "speed": f"{speed:g}",
            }
            | scenario.metadata,
            true_line=true_line(simulation.world),
            truth=simulation.truth,
        )
        outcome = _fly_watched(setup, watched)
    finish(outcome, as_json=as_json, aftermath=simulation.aftermath)


def run(
    mission: MissionArgument,
    connection: Annotated[
        str | None, typer.Option(help="MAVSDK URL, e.g. serial:///dev/ttyAMA0:921600; else the mission's.")
    ] = None,
    camera: Annotated[str | None, typer.Option(help="v4l2:DEVICE, file:PATH or sim:WORLD; else the mission's.")] = None,
    log: LogOption = Path("logs"),
    live: LiveOption = False,
    live_port: LivePortOption = None,
    live_address: LiveAddressOption = None,
    live_foxglove_port: LiveFoxglovePortOption = None,
    as_json: JsonOption = False,
) -> None:
    """Fly a mission with a real vehicle, PX4 SITL, or `lineflight sitl`."""
    mission_file = read_mission(mission)
    watched = live_settings(live, live_port, live_address, live_foxglove_port)
    plan = mission_file.plan
    _run(mission_file, connection or plan.vehicle.connection, camera or plan.camera.source, log, as_json, None, watched)


def _run(
    mission_file: "MissionFile",
    connection: str,
    camera: str,
    log: Path,
    as_json: bool,
    resumed: "tuple[MissionPlan, Resumption] | None",
    watched: "LiveSettings | None",
) -> NoReturn:
    """Fly a mission, or what is left of it, with a vehicle that flies elsewhere."""
    from mission.flight import FlightSetup
    from mission.live_camera import CameraError, LiveCamera

    try:
        source = LiveCamera(camera, mission_file.plan.camera, mission_file.camera)
    except CameraError as error:
        fail(str(error), EXIT_BAD_INPUT)
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
        outcome = _fly_watched(setup, watched)
    finish(outcome, as_json=as_json)


def resume(
    journal: Annotated[
        Path | None, typer.Argument(help="The journal (*.journal) beside a flight's log; else the newest one in --log.")
    ] = None,
    explain: Annotated[bool, typer.Option("--explain", help="Only say what it would do, and why.")] = False,
    connection: Annotated[str | None, typer.Option(help="MAVSDK URL; else the interrupted flight's.")] = None,
    camera: Annotated[str | None, typer.Option(help="v4l2:DEVICE or sim:WORLD; else the interrupted flight's.")] = None,
    log: LogOption = Path("logs"),
    live: LiveOption = False,
    live_port: LivePortOption = None,
    live_address: LiveAddressOption = None,
    live_foxglove_port: LiveFoxglovePortOption = None,
    as_json: JsonOption = False,
) -> None:
    """Take an interrupted mission up again, from its journal: after a crash, a takeover, or a change of battery."""
    from mission.journal import DRY_RUN, JournalError, check_ended, newest_journal, read_journal
    from mission.resumption import CannotResumeError, explain_resumption, find_resumption

    watched = live_settings(live, live_port, live_address, live_foxglove_port)
    try:
        path = journal or newest_journal(log)
        begin, entries = read_journal(path)
        mission_file = read_mission(Path(begin.mission_path))
        remaining, resumption = find_resumption(begin, entries, mission_file.plan, mission_file.sha256)
    except (JournalError, CannotResumeError) as error:
        fail(_sentence(str(error)), EXIT_BAD_INPUT)
    typer.echo(f"journal  {path}", err=True)
    for line in explain_resumption(remaining, resumption, begin):
        typer.echo(line, err=not explain)
    if explain:
        return
    try:
        check_ended(path)
    except JournalError as error:
        fail(str(error), EXIT_BAD_INPUT)
    if begin.camera == DRY_RUN and camera is None and connection is None:
        fail("That was a dry-run: its vehicle is gone. To try it, fly with lineflight sitl and run.", EXIT_BAD_INPUT)
    resumed = remaining, resumption
    _run(mission_file, connection or begin.connection, camera or begin.camera, log, as_json, resumed, watched)


def _radians(degrees: float | None) -> float | None:
    return None if degrees is None else math.radians(degrees)


def _sentence(words: str) -> str:
    return words[:1].upper() + words[1:].rstrip(".") + "."


def sitl(
    world: WorldOption = None,
    speed: SpeedOption = 1.0,
    port: Annotated[int, typer.Option(min=1, max=65535 - 40, help="UDP port that the vehicle sends to.")] = 14540,
    seed: SeedOption = 1,
    wind: WindOption = 0.0,
    wind_from: WindFromOption = None,
    gust_fronts: GustFrontsOption = False,
    airframe: AirframeOption = "f550",
    autopilot: Annotated[Literal["px4", "arducopter"], typer.Option(help="Whose MAVLink the vehicle speaks.")] = "px4",
) -> None:
    """Run only the simulated vehicle, until Ctrl-C; any MAVLink program can fly it."""
    from mission.simulated.scenario import Scenario
    from mission.simulated.simulation import SETUP, WorldError, serve_until_stopped, world_path_or_name

    setup = ", ".join(f"{name} {value:g}" for name, value in SETUP.items())
    typer.echo(f"Its parameters are PX4's defaults, but {setup}.", err=True)
    typer.echo(f"The simulated vehicle sends to udp 127.0.0.1:{port}; Ctrl-C ends it.", err=True)
    try:
        summary = serve_until_stopped(
            Scenario(world_path_or_name(world), None, seed, wind, _radians(wind_from), gust_fronts, airframe),
            speed,
            port,
            autopilot,
        )
    except (WorldError, OSError) as error:
        fail(str(error), EXIT_BAD_INPUT)
    typer.echo(
        f"{summary.simulated_s:.1f} s flown in {summary.wall_s:.1f} s: {summary.achieved_speed:.2f} times", err=True
    )


def _fly_watched(setup: "FlightSetup", watched: "LiveSettings | None") -> "FlightOutcome":
    from rich.console import Console

    from mission.flight import fly
    from mission.guard import GuardError
    from mission.live.settings import LiveError
    from mission.watch import Watch

    try:
        with serve_live(watched) as live, Watch(setup.mission.plan, Console(stderr=True)) as watch:
            if live is not None and watched is not None:
                tell_live(live, watched)
            return asyncio.run(fly(setup, watch.show, watch.tell_checks, live))
    except LiveError as error:
        fail(str(error), EXIT_BAD_INPUT)
    except LogError as error:
        fail(str(error), EXIT_FAILED_FILE)
    except GuardError as error:
        fail(str(error), EXIT_NOT_READY)
