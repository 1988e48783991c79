"""Runs the simulated vehicle in its own process: steps it in time with the flight's clock, and serves its MAVLink."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from drivers.clock import NS_PER_S, ScaledClock
from sitl.arducopter import ArduCopterFace
from sitl.contact import Obstacles
from sitl.mavlink import MavlinkFace
from sitl.outfit import open_field, outfit
from sitl.place import Origin
from sitl.pose import Pose, PoseBlock
from sitl.udp import UdpLink
from sitl.vehicle import Vehicle
from sitl.witness import Contact, Testimony, Witness
from sitl.world.file import load_world

AutopilotName = Literal["px4", "arducopter"]
_FACES: dict[AutopilotName, type[MavlinkFace]] = {"px4": MavlinkFace, "arducopter": ArduCopterFace}
_STEP_NS = 4_000_000  # 250 Hz of flight time
_STEP_S = _STEP_NS / NS_PER_S
_MAX_BURST = 50  # steps without a look at the clock; the sockets are served after each
_FORGIVE_WALL_NS = NS_PER_S // 4  # of lateness; more is forgiven


@dataclass(frozen=True, slots=True)
class SitlSettings:
    """How the simulated vehicle is run.

    `port` is the application's UDP port; `wind_m_s` the mean wind at 20 ft, whose direction `seed` draws;
    `start_yaw_rad` the heading at start; `origin` places the world's NED frame, where the vehicle stands at start;
    `pose_block` names the shared memory that gets the true pose (None: nobody looks); `parameters` are set over PX4's
    defaults; `autopilot` whose face it shows. `world` is the name or path of the world it flies in, which has its own
    start and origin then (None: nothing stands around); `airframe` one of sitl.airframes; `wind_from_rad` where the
    wind blows from, clockwise from north, instead of what `seed` draws; `gust_fronts` adds single gusts.
    """

    port: int
    seed: int
    wind_m_s: float
    clock: ScaledClock
    start_yaw_rad: float
    origin: Origin
    pose_block: str | None
    parameters: tuple[tuple[str, float | int], ...] = ()
    autopilot: AutopilotName = "px4"
    world: str | None = None
    airframe: str = "f550"
    wind_from_rad: float | None = None
    gust_fronts: bool = False


@dataclass(frozen=True, slots=True)
class SitlSummary:
    """How much flight was simulated [s], in how much wall time [s], and so how fast; and what it came near to."""

    simulated_s: float
    wall_s: float
    testimony: Testimony | None = None

    @property
    def achieved_speed(self) -> float:
        """Flight time over wall time; below the clock's speed where the machine was too slow."""
        return self.simulated_s / self.wall_s if self.wall_s > 0 else 0.0


def run(
    settings: SitlSettings, should_stop: Callable[[], bool], tell_contact: Callable[[Contact], None] | None = None
) -> SitlSummary:
    """Fly until `should_stop` says so; `tell_contact` hears at once what the vehicle touches.

    Raises OSError when the port is taken, FileNotFoundError without a pose block, and what load_world and outfit raise.

    Steps 4 ms of flight time, paced by the clock. When late it catches up; debt beyond a quarter of a second of wall
    time is forgiven, and shows in the summary's speed.
    """
    clock = settings.clock
    world = (
        open_field(settings.origin, settings.start_yaw_rad) if settings.world is None else load_world(settings.world)
    )
    witness = Witness(Obstacles(world), tell_contact)
    autopilot = outfit(
        world,
        airframe=settings.airframe,
        wind_m_s=settings.wind_m_s,
        wind_from_rad=settings.wind_from_rad,
        seed=settings.seed,
        gust_fronts=settings.gust_fronts,
        parameters=dict(settings.parameters),
        speed=max(1.0, clock.speed),
        witness=witness,
    )
    pose_block = PoseBlock.attach(settings.pose_block) if settings.pose_block is not None else None
    forgive_ns = round(_FORGIVE_WALL_NS * clock.speed)
    n_steps = 0
    try:
        with UdpLink(_FACES[settings.autopilot](autopilot), settings.port) as link:
            began_s = time.monotonic()
            flight_ns = clock.now_ns()
            while not should_stop():
                now_ns = clock.now_ns()
                if now_ns - flight_ns > forgive_ns:
                    flight_ns = now_ns - forgive_ns
                witness.began_ns = flight_ns - n_steps * _STEP_NS
                for _ in range(min(_MAX_BURST, (now_ns - flight_ns) // _STEP_NS)):
                    autopilot.step(_STEP_S)
                    link.service()
                    flight_ns += _STEP_NS
                    n_steps += 1
                    if pose_block is not None:
                        pose_block.write(_pose(autopilot.vehicle, flight_ns))
                ahead_ns = flight_ns + _STEP_NS - clock.now_ns()
                if ahead_ns > 0:
                    time.sleep(clock.wall_s(ahead_ns / NS_PER_S))
            return SitlSummary(n_steps * _STEP_S, time.monotonic() - began_s, witness.summary)
    finally:
        if pose_block is not None:
            pose_block.close()


def _pose(vehicle: Vehicle, t_ns: int) -> Pose:
    n, e, d = vehicle.position_m
    return Pose(t_ns, n, e, d, vehicle.quaternion)
