"""A simulated vehicle with all that belongs to it, made for a world."""

from collections.abc import Mapping

from sitl.airframes import airframe_of
from sitl.autopilot import SimAutopilot
from sitl.contact import Obstacles
from sitl.gust_front import GustFronts
from sitl.lee import Lee
from sitl.parameters import Parameters
from sitl.place import Origin
from sitl.setup import SETUP
from sitl.vehicle import GroundHeight, Vehicle, flat_ground
from sitl.wind import COVER_ROUGHNESS_M, ROUGHNESS_M, Wind
from sitl.witness import Witness
from sitl.world.height_grid import HeightGrid
from sitl.world.light import LIGHTS
from sitl.world.records import Ground, World
from sitl.world.surface import surface_of


def outfit(
    world: World,
    *,
    airframe: str = "f550",
    wind_m_s: float = 0.0,
    wind_from_rad: float | None = None,
    seed: int = 1,
    gust_fronts: bool = False,
    parameters: Mapping[str, float | int] = SETUP,
    speed: float = 1.0,
    witness: Witness | None = None,
) -> SimAutopilot:
    """A vehicle that stands at the world's start, ready to be stepped.

    `witness` sees what it comes near to and touches (SimAutopilot.witness; by default one is made for the world).

    `airframe` is one of sitl.airframes; `wind_m_s` the mean wind at 20 ft, which blows from `wind_from_rad`
    (clockwise from north; None: `seed` draws it); `gust_fronts` adds single gusts now and then; `parameters` are set
    over PX4's defaults; `speed` is how many times faster than the wall clock it will be stepped.
    Raises AirframeError, KeyError and TypeError for a wrong parameter, ValueError for a wind below 0.
    """
    wind = Wind(
        wind_m_s,
        seed,
        wind_from_rad,
        roughness_m=COVER_ROUGHNESS_M.get(world.ground.style, ROUGHNESS_M),
        fronts=GustFronts(seed) if gust_fronts else None,
    )
    surface = surface_of(world)
    if wind_m_s > 0.0 and surface is not world.terrain:
        wind.lee = Lee(surface, world.terrain, wind.from_rad, wind.roughness_m)
    return SimAutopilot(
        Vehicle(airframe_of(airframe), yaw_rad=world.start_yaw_rad, ground=ground_of(world.terrain)),
        wind,
        seed=seed,
        parameters=Parameters(dict(parameters)),
        origin=world.origin,
        speed=speed,
        witness=witness or Witness(Obstacles(world)),
    )


def open_field(origin: Origin, start_yaw_rad: float) -> World:
    """A world in which nothing stands, on level ground."""
    return World(
        name="open field",
        origin=origin,
        start_yaw_rad=start_yaw_rad,
        lines=(),
        terrain=HeightGrid.flat(-1.0, -1.0, 1.0, 1.0, 2.0),
        ground=Ground("pasture", 0),
        strips=(),
        buildings=(),
        trees=(),
        light=LIGHTS["noon"],
    )


def ground_of(terrain: HeightGrid) -> GroundHeight:
    """The terrain as a vehicle stands on it. It is asked for the same place several times a step: the last is kept."""
    if not terrain.up_m.any():
        return flat_ground
    last = (0.0, 0.0, -terrain.at(0.0, 0.0))

    def down_m(north_m: float, east_m: float) -> float:
        nonlocal last
        if north_m != last[0] or east_m != last[1]:
            last = (north_m, east_m, -terrain.at(north_m, east_m))
        return last[2]

    return down_m
