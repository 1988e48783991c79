"""The simulated vehicle beside the mission: its process, its camera and its truth."""

import contextlib
import functools
import multiprocessing
import os
import signal
import socket
import threading
from collections.abc import Callable
from dataclasses import replace
from multiprocessing.connection import Connection
from multiprocessing.synchronize import Event as ProcessEvent
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from drivers.camera.camera import Camera, Intrinsics
from drivers.clock import ScaledClock
from mission.autopilot import VehicleState
from mission.records import Event, TrueLine, TruePose
from mission.simulated.aftermath import Aftermath, contact_event
from mission.simulated.scenario import Scenario
from sitl.camera import SimCamera
from sitl.control import quaternion_of
from sitl.pose import Pose, PoseBlock
from sitl.render.map import render_map
from sitl.server import AutopilotName, SitlSettings, SitlSummary, run
from sitl.setup import SETUP
from sitl.witness import Contact
from sitl.world.file import DEFAULT_WORLD, WorldError, load_world
from sitl.world.records import World

__all__ = [
    "SETUP",
    "Simulation",
    "TelemetryCamera",
    "World",
    "WorldError",
    "draw_map",
    "serve_until_stopped",
    "true_line",
]

VEHICLE_PORT_ABOVE = 40
"""The simulated vehicle binds this far above the application's port, as PX4 SITL does (14580 and 14540)."""

_STOP_TIMEOUT_S = 5.0


class Simulation:
    """A simulated vehicle in a process of its own. A context manager; raises WorldError for a bad world."""

    def __init__(self, scenario: Scenario, clock: ScaledClock) -> None:
        self.world = load_world(scenario.world, scenario.light)
        self._scenario = scenario
        self._clock = clock
        self._port = free_udp_port()
        self._poses = PoseBlock.create()
        self._stop = multiprocessing.get_context("spawn").Event()
        self._news, self._child_news = multiprocessing.get_context("spawn").Pipe(duplex=False)
        settings = sitl_settings(self.world, scenario, clock, self._port, self._poses.name)
        self._process = multiprocessing.get_context("spawn").Process(
            target=_serve, args=(settings, self._stop, self._child_news), name="lineflight-sitl", daemon=True
        )
        self.summary: SitlSummary | None = None

    @property
    def connection(self) -> str:
        """Where MAVSDK finds the vehicle."""
        return f"udpin://127.0.0.1:{self._port}"

    def camera_opener(self, camera: Intrinsics, rate_hz: float) -> Callable[[], Camera]:
        """What opens the simulated camera in the vision worker."""
        return sim_camera_opener(self._scenario, self._poses.name, self._clock, camera, rate_hz)

    def truth(self) -> list[TruePose | Event]:
        """Where the vehicle truly is (nothing before its first step), and what it has touched since the last call."""
        pose = self._poses.read()
        truth: list[TruePose | Event] = []
        if pose is not None:
            truth.append(TruePose(pose.t_ns, pose.north_m, pose.east_m, pose.down_m, pose.yaw_rad))
        with contextlib.suppress(EOFError):  # it has died
            while self._news.poll():
                self._hear(truth)
        return truth

    @property
    def aftermath(self) -> Aftermath:
        """What is known of the flight when it is over."""
        summary = self.summary
        if summary is None:
            return Aftermath(self.world, None, None)
        return Aftermath(self.world, summary.achieved_speed, summary.testimony)

    def __enter__(self) -> Self:
        self._process.start()
        self._child_news.close()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stop.set()
        with contextlib.suppress(EOFError):  # it died without a word: then there is no summary
            while self.summary is None and self._news.poll(_STOP_TIMEOUT_S):
                self._hear([])
        self._process.join(_STOP_TIMEOUT_S)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()
        self._news.close()
        self._poses.close()

    def _hear(self, truth: list[TruePose | Event]) -> None:
        """Take one message of the vehicle's process. Raises EOFError when it has died."""
        message: Contact | SitlSummary = self._news.recv()
        if isinstance(message, SitlSummary):
            self.summary = message
        else:
            truth.append(contact_event(message))


class TelemetryCamera:
    """A simulated camera on a vehicle that flies elsewhere, posed by its telemetry. Raises WorldError for a bad world.

    The autopilot's local origin is taken for the world's, and its estimate for the truth.
    """

    def __init__(self, world: str | None, clock: ScaledClock, camera: Intrinsics, rate_hz: float) -> None:
        load_world(world)
        self._poses = PoseBlock.create()
        self.open_camera = sim_camera_opener(Scenario(world), self._poses.name, clock, camera, rate_hz)

    def feed(self, state: VehicleState) -> None:
        """Publish the vehicle's state as the camera's pose."""
        quaternion = quaternion_of(state.roll_rad, state.pitch_rad, state.yaw_rad)
        self._poses.write(Pose(state.t_ns, state.north_m, state.east_m, state.down_m, quaternion))

    def close(self) -> None:
        """Let go of the poses; the camera must be closed before."""
        self._poses.close()


def sim_camera_opener(
    scenario: Scenario, pose_block: str, clock: ScaledClock, camera: Intrinsics, rate_hz: float
) -> Callable[[], Camera]:
    """What opens a simulated camera that hangs on the poses of `pose_block`; picklable."""
    return functools.partial(
        SimCamera, scenario.world, pose_block, clock, camera, rate_hz, scenario.seed, light=scenario.light
    )


def sitl_settings(
    world: World, scenario: Scenario, clock: ScaledClock, port: int, pose_block: str | None
) -> SitlSettings:
    """The simulated vehicle of a world."""
    return SitlSettings(
        port=port,
        seed=scenario.seed,
        wind_m_s=scenario.wind_m_s,
        wind_from_rad=scenario.wind_from_rad,
        gust_fronts=scenario.has_gust_fronts,
        airframe=scenario.airframe,
        world=scenario.world or DEFAULT_WORLD,
        clock=clock,
        start_yaw_rad=world.start_yaw_rad,
        origin=world.origin,
        pose_block=pose_block,
        parameters=tuple(SETUP.items()),
    )


def true_line(world: World) -> TrueLine:
    """The world's power line as the log keeps it."""
    return TrueLine(
        axis_ne_m=world.line.axis_ne_m,
        conductors_ned_m=tuple(
            tuple((float(n), float(e), float(d)) for n, e, d in conductor.points_ned_m)
            for conductor in world.conductors
        ),
        supports_ned_m=tuple(support.top_ned_m for support in world.supports),
    )


def draw_map(world: World, bounds_ne_m: tuple[float, float, float, float], px_per_m: float) -> NDArray[np.uint8]:
    """The world from above, north up, BGR; bounds are south, west, north, east [m]."""
    return render_map(world, bounds_ne_m, px_per_m)


def free_udp_port() -> int:
    """A UDP port that nobody on this machine uses now, for the application; the vehicle's own is VEHICLE_PORT_ABOVE."""
    while True:
        with (
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as application,
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as vehicle,
        ):
            application.bind(("127.0.0.1", 0))
            port = int(application.getsockname()[1])
            with contextlib.suppress(OSError, OverflowError):
                vehicle.bind(("127.0.0.1", port + VEHICLE_PORT_ABOVE))
                return port


def serve_until_stopped(scenario: Scenario, speed: float, port: int, autopilot: AutopilotName = "px4") -> SitlSummary:
    """Run the simulated vehicle in this process until SIGINT or SIGTERM. Raises WorldError."""
    stop = threading.Event()
    for signal_number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(signal_number, lambda _number, _frame: stop.set())
    clock = ScaledClock(speed, ScaledClock().now_ns())
    settings = sitl_settings(load_world(scenario.world), scenario, clock, port, None)
    return run(replace(settings, autopilot=autopilot), stop.is_set)


def _serve(settings: SitlSettings, stop: ProcessEvent, news: Connection) -> None:
    # Ctrl-C reaches every process of the terminal: the vehicle must go on flying until the mission has landed it.
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    parent = os.getppid()

    def tell(message: Contact | SitlSummary) -> None:
        with contextlib.suppress(BrokenPipeError):  # the mission has died, and nobody listens
            news.send(message)

    tell(run(settings, lambda: stop.is_set() or os.getppid() != parent, tell))


def world_path_or_name(text: str | None) -> str | None:
    """A world given on the command line; a path is made absolute, because other processes open it."""
    if text is not None and Path(text).suffix in {".yaml", ".yml"}:
        return str(Path(text).resolve())
    return text
