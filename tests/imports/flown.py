"""A flight of the simulated autopilot that we log, and that the autopilot logs with a clock of its own."""

from dataclasses import dataclass, field, replace
from pathlib import Path

from pymavlink.dialects.v20 import all as dialect

from drivers.clock import NS_PER_S
from mission.autopilot import FlightMode, LandedState, VehicleState
from mission.log.imported import ImportedState
from mission.records import Attachment, ClockSync
from sitl.autopilot import SimAutopilot
from sitl.mavlink import MavlinkFace
from sitl.modes import Answer, Mode
from sitl.parameters import Parameters
from sitl.vehicle import euler_of
from sitl.wind import Wind
from tests.log.synthetic_flight import START_NS, write_log

STEP_S = 0.004
OFFSET_S = START_NS / NS_PER_S - 3.5
"""Flight time less autopilot time, where the autopilot's clock shows nothing."""
DRIFT = 40e-6
LATENCY_S = 0.04
ROUND_TRIP_NS = 6_000_000
# When the application asks for what [s, boot]; the legs are north, east of where it is then, and yaw [rad].
TAKEOFF_S, LAND_S, END_S = 6.0, 72.0, 95.0
LEGS = ((22.0, (12.0, 0.0, 0.0)), (34.0, (12.0, 0.0, 1.6)), (39.0, (12.0, 18.0, 1.6)), (56.0, (-3.0, 10.0, -2.0)))


@dataclass
class Flown:
    """Both sides of the flight: the autopilot's own estimates and bytes, and what we recorded of them."""

    estimates: list[ImportedState] = field(default_factory=list)
    frames: list[tuple[float, bytes]] = field(default_factory=list)
    states: list[VehicleState] = field(default_factory=list)
    syncs: list[ClockSync] = field(default_factory=list)
    modes: list[tuple[int, str]] = field(default_factory=list)
    targets: list[tuple[int, tuple[float, float, float, float]]] = field(default_factory=list)


def flight_ns(boot_s: float) -> int:
    """The truth about the clocks."""
    return round((boot_s + OFFSET_S + DRIFT * boot_s) * NS_PER_S)


def fly(seed: int = 3, wind_m_s: float = 4.0) -> Flown:
    """Take off, fly the legs, land. Times of the estimates are the autopilot's own [ns, boot]."""
    autopilot = SimAutopilot(wind=Wind(wind_m_s, seed), seed=seed, parameters=Parameters({"MIS_TAKEOFF_ALT": 8.0}))
    face = MavlinkFace(autopilot)
    station = dialect.MAVLink(None, srcSystem=245, srcComponent=190)
    flown, legs = Flown(), list(LEGS)
    start_m: tuple[float, float, float] | None = None
    target: tuple[float, float, float, float] | None = None
    for step in range(round(END_S / STEP_S)):
        boot_s = autopilot.boot_s
        if step % 250 == 0:
            beat = station.heartbeat_encode(dialect.MAV_TYPE_GCS, dialect.MAV_AUTOPILOT_INVALID, 0, 0, 0)
            packed = beat.pack(station)
            face.receive(packed)
            flown.frames.append((boot_s, packed))
            ahead_ns = round(boot_s * NS_PER_S) - flight_ns(boot_s)
            flown.syncs.append(ClockSync(flight_ns(boot_s), ahead_ns + 50_000 * (step % 3), ROUND_TRIP_NS))
        if boot_s >= TAKEOFF_S and not autopilot.is_armed and start_m is None:
            assert autopilot.arm() is Answer.ACCEPTED
            assert autopilot.takeoff() is Answer.ACCEPTED
        if legs and boot_s >= legs[0][0]:
            start_m = autopilot.estimate.position_m if start_m is None else start_m
            _, (north_m, east_m, yaw_rad) = legs.pop(0)
            target = (start_m[0] + north_m, start_m[1] + east_m, start_m[2], yaw_rad)
            autopilot.set_position_setpoint(*target)
            assert autopilot.set_mode(Mode.OFFBOARD) is Answer.ACCEPTED
        if target is not None and boot_s >= LAND_S:
            assert autopilot.land() is Answer.ACCEPTED
            target = None
        if target is not None and step % 12 == 0:
            autopilot.set_position_setpoint(*target)
            flown.targets.append((round(boot_s * NS_PER_S), target))
        autopilot.step(STEP_S)
        _note(flown, autopilot, step)
        flown.frames += [(autopilot.boot_s + LATENCY_S, frame) for frame in face.service()]
    return flown


def _note(flown: Flown, autopilot: SimAutopilot, step: int) -> None:
    estimate = autopilot.estimate
    attitude = euler_of(estimate.quaternion)
    boot_ns = round(autopilot.boot_s * NS_PER_S)
    if not flown.modes or flown.modes[-1][1] != autopilot.mode.name:
        flown.modes.append((boot_ns, autopilot.mode.name))
    if step % 5 == 0:  # 50 Hz, as PX4 logs it
        flown.estimates.append(ImportedState(boot_ns, *estimate.position_m, *estimate.velocity_m_s, *attitude))
    if step % 12 == 0:  # about the control loop's 20 Hz
        flown.states.append(
            VehicleState(
                flight_ns(autopilot.boot_s + LATENCY_S),
                *estimate.position_m,
                *estimate.velocity_m_s,
                *attitude,
                FlightMode.OFFBOARD,
                autopilot.is_armed,
                LandedState.IN_AIR,
                autopilot.battery.remaining,
                is_connected=True,
                boot_ns=boot_ns,
            )
        )


def write_ours(path: Path, flown: Flown, *, with_syncs: bool = True, with_boot: bool = True) -> None:
    """Write our own log of the flight."""
    states = flown.states if with_boot else [replace(state, boot_ns=None) for state in flown.states]
    records: list[tuple[int, object]] = [(state.t_ns, state) for state in states]
    if with_syncs:
        records += [(sync.t_ns, sync) for sync in flown.syncs]
    records.append((0, Attachment("parameters.json", "application/json", b'{"MPC_XY_P": 0.95}')))
    assert write_log(path, records).failure is None
