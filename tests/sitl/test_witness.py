"""A flight among obstacles: what it came near to is told, a touch is the end of it, a landing is none."""

import dataclasses
import math

import numpy as np
import pytest

from sitl.airframes import AIRFRAMES
from sitl.autopilot import SimAutopilot
from sitl.contact import Obstacles
from sitl.modes import Mode
from sitl.outfit import ground_of, open_field, outfit
from sitl.place import Origin
from sitl.vehicle import Vehicle
from sitl.witness import Contact, Witness
from sitl.world.height_grid import HeightGrid
from sitl.world.records import Conductor, PowerLine, Tree, World

STEP_S = 0.004
FIELD = open_field(Origin(), 0.0)
WIRE = Conductor(0.02, np.array([[20.0, -50.0, -8.0], [20.0, 50.0, -8.0]]))
WORLD = dataclasses.replace(FIELD, lines=(PowerLine(((20.0, -50.0), (20.0, 50.0)), (), (WIRE,)),))
TREE = dataclasses.replace(FIELD, trees=(Tree("broadleaf", 12.0, 0.0, 10.0, 3.0),))


def take_off(sim: SimAutopilot, height_m: float) -> None:
    sim.set_parameter("MIS_TAKEOFF_ALT", height_m)
    run(sim, 5.0)
    sim.arm()
    sim.takeoff()
    run(sim, 10.0 + height_m / 1.5)


def run(sim: SimAutopilot, time_s: float) -> None:
    for _ in range(round(time_s / STEP_S)):
        sim.step(STEP_S)


def fly_to(sim: SimAutopilot, north_m: float, height_m: float, time_s: float) -> None:
    for n in range(round(time_s / STEP_S)):
        if n % 25 == 0:
            sim.set_position_setpoint(north_m, 0.0, -height_m, 0.0)
            sim.set_mode(Mode.OFFBOARD)
        sim.step(STEP_S)


@pytest.mark.parametrize("airframe", list(AIRFRAMES))
def test_over_the_wire_and_home_it_tells_how_near_it_came(airframe: str) -> None:
    sim = outfit(WORLD, airframe=airframe)
    take_off(sim, 12.0)
    fly_to(sim, 25.0, 12.0, 8.0)
    sim.land()
    run(sim, 40.0)
    assert sim.witness is not None
    seen = sim.witness.summary
    assert seen.contact is None
    assert seen.support is None
    assert seen.other is None
    assert seen.conductor is not None
    # It passed 4 m above, give or take what it errs by and sinks; afterwards it stood 5 m beside, 8 m below.
    assert seen.conductor.distance_m == pytest.approx(4.0, abs=1.2)
    assert seen.conductor.position_ned_m[0] == pytest.approx(20.0, abs=1.5)
    assert 0.0 < seen.conductor.t_ns / 1e9 < sim.boot_s
    assert not sim.is_armed
    assert not sim.vehicle.is_broken


def test_a_touched_wire_brings_it_down() -> None:
    sim = outfit(WORLD)
    take_off(sim, 8.0)
    fly_to(sim, 30.0, 8.0, 10.0)
    assert sim.witness is not None
    contact = sim.witness.summary.contact
    assert contact is not None
    assert contact.what == "conductor"
    # The vehicle's radius before the wire, or at most a look and a step nearer.
    north_m, _, down_m = contact.position_ned_m
    assert math.hypot(north_m - 20.0, down_m + 8.0) == pytest.approx(0.41, abs=0.08)
    assert sim.vehicle.is_broken
    assert sim.vehicle.position_m[2] == 0.0
    assert sim.vehicle.thrust_n < 1e-6
    assert not sim.is_armed
    before = sim.witness.summary
    run(sim, 1.0)
    assert sim.witness.summary == before


def test_a_touched_tree_is_named() -> None:
    sim = outfit(TREE)
    take_off(sim, 6.5)
    fly_to(sim, 30.0, 6.5, 6.0)
    assert sim.witness is not None
    summary = sim.witness.summary
    assert summary.contact is not None
    assert summary.contact.what == "tree"
    assert summary.other is not None
    assert summary.other.distance_m < sim.vehicle.airframe.radius_m


def test_without_a_witness_it_flies_through() -> None:
    sim = outfit(WORLD)
    sim.witness = None
    take_off(sim, 8.0)
    fly_to(sim, 30.0, 8.0, 8.0)
    assert sim.vehicle.position_m[0] > 28.0


@pytest.mark.parametrize(("speed_m_s", "what"), [(1.0, None), (6.0, "ground")])
def test_meeting_the_ground_hard_is_a_crash_and_a_landing_is_none(speed_m_s: float, what: str | None) -> None:
    vehicle, witness = Vehicle(), Witness(Obstacles(FIELD))
    vehicle.position_m, vehicle.velocity_m_s, vehicle.is_on_ground = (0.0, 0.0, -0.5), (0.0, 0.0, speed_m_s), False
    vehicle.thrust_n = vehicle.airframe.mass_kg * 9.80665
    contacts = []
    for n in range(500):
        vehicle.step(STEP_S, vehicle.airframe.hover_thrust, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        contacts.append(witness.look(n * STEP_S, vehicle))
    assert [contact.what for contact in contacts if contact is not None] == ([what] if what else [])


def test_a_contact_is_told_once_when_it_happens() -> None:
    told: list[Contact] = []
    vehicle, witness = Vehicle(), Witness(Obstacles(WORLD), told.append)
    witness.began_ns = 5_000_000_000
    vehicle.position_m = (20.0, 0.0, -12.0)
    witness.look(1.0, vehicle)
    assert not told
    vehicle.position_m = (20.0, 0.0, -8.1)
    contact = witness.look(2.0, vehicle)
    vehicle.position_m = (20.0, 0.0, -7.9)
    witness.look(3.0, vehicle)
    assert told == [contact]
    assert told[0].t_ns == 7_000_000_000


def test_times_are_the_flights() -> None:
    vehicle, witness = Vehicle(), Witness(Obstacles(WORLD))
    witness.began_ns = 5_000_000_000
    vehicle.position_m = (20.0, 0.0, -12.0)
    assert witness.look(2.0, vehicle) is None
    assert witness.summary.conductor is not None
    assert witness.summary.conductor.t_ns == 7_000_000_000


def test_a_broken_vehicle_falls_tumbling_and_lies() -> None:
    vehicle = Vehicle()
    vehicle.position_m, vehicle.is_on_ground = (0.0, 0.0, -30.0), False
    vehicle.velocity_m_s, vehicle.thrust_n = (5.0, 0.0, 0.0), 20.0
    vehicle.crash()
    tilts_rad = []
    for _ in range(round(6.0 / STEP_S)):
        vehicle.step(STEP_S, 1.0, (1.0, 1.0, 1.0), (0.0, 0.0, 0.0))
        tilts_rad.append(max(abs(angle) for angle in vehicle.euler_rad[:2]))
    assert max(tilts_rad) > math.radians(60)
    assert vehicle.position_m[2] == 0.0
    assert vehicle.velocity_m_s == (0.0, 0.0, 0.0)
    assert tilts_rad[-1] == tilts_rad[-2] > 0.0


def test_it_stands_and_lands_on_the_terrain() -> None:
    up_m = np.zeros((41, 41), dtype=np.float32)
    up_m[24:, :] = 6.0  # a terrace, north of 20 m
    world: World = dataclasses.replace(FIELD, terrain=HeightGrid(-100.0, -100.0, 5.0, up_m))
    sim = outfit(world)
    take_off(sim, 12.0)
    fly_to(sim, 40.0, 12.0, 10.0)
    sim.land()
    run(sim, 25.0)
    assert sim.vehicle.is_on_ground
    assert not sim.is_armed
    assert sim.vehicle.position_m[2] == -6.0
    assert not sim.vehicle.is_broken


def test_the_ground_is_the_terrain_at_every_place() -> None:
    draw = np.random.default_rng(1)
    terrain = HeightGrid(-50.0, -50.0, 5.0, draw.uniform(-3.0, 9.0, (21, 21)).astype(np.float32))
    ground = ground_of(terrain)
    for north_m, east_m in draw.uniform(-70.0, 70.0, (100, 2)).tolist():
        for _ in range(2):
            assert ground(north_m, east_m) == -terrain.at(north_m, east_m)
