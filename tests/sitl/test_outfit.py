"""What a vehicle is outfitted with follows from the world and from what is asked for."""

import dataclasses
import math

import numpy as np
import pytest

from sitl import outfit as outfit_module
from sitl.airframes import AirframeError
from sitl.outfit import open_field, outfit
from sitl.place import Origin
from sitl.setup import SETUP
from sitl.world.height_grid import HeightGrid
from sitl.world.records import World

STEP_S = 0.004
PLACE = Origin(0.5, 0.25, 700.0)
FIELD = dataclasses.replace(open_field(PLACE, 0.7), terrain=HeightGrid.flat(-200.0, -200.0, 200.0, 200.0, 4.0))


def test_it_stands_at_the_worlds_start() -> None:
    sim = outfit(FIELD, airframe="x500", parameters=SETUP | {"MIS_TAKEOFF_ALT": 7.0})
    assert sim.origin == PLACE
    assert sim.vehicle.euler_rad[2] == pytest.approx(0.7)
    assert sim.vehicle.airframe.radius_m == 0.38
    assert sim.battery.pack.capacity_ah == 5.0
    assert sim.parameters.get("MIS_TAKEOFF_ALT") == 7.0
    assert sim.parameters.get("COM_OBL_RC_ACT") == SETUP["COM_OBL_RC_ACT"]


def test_an_unknown_airframe_is_refused() -> None:
    with pytest.raises(AirframeError, match="x600"):
        outfit(FIELD, airframe="x600")


def winds(world: World = FIELD, **options: float | bool) -> list[tuple[float, float, float]]:
    """Half an hour of wind 5 m up, 60 m south of the start, sampled twice a second."""
    wind = outfit(world, **options).wind  # type: ignore[arg-type]
    return [wind.step(0.5, 5.0, 6.0, (-60.0, 0.0, -5.0)) for _ in range(3_600)]


def test_the_wind_blows_from_where_it_is_told_to() -> None:
    blown = np.array(winds(wind_m_s=6.0, wind_from_rad=math.pi / 2)).mean(axis=0)
    assert blown == pytest.approx((0.0, -5.76, 0.0), abs=0.3)


def test_the_seed_decides_and_gust_fronts_come_when_asked_for() -> None:
    assert winds(wind_m_s=6.0, seed=3) == winds(wind_m_s=6.0, seed=3) != winds(wind_m_s=6.0, seed=4)
    plain, gusty = (np.array(winds(wind_m_s=6.0, seed=3, gust_fronts=asked)) for asked in (False, True))
    more = np.linalg.norm(gusty - plain, axis=1)
    assert 0.2 < np.mean(more > 0.0) < 0.8
    assert 1.5 < more.max() < 3.0


def test_the_lee_acts_where_the_world_has_something_that_stands(monkeypatch: pytest.MonkeyPatch) -> None:
    up_m = FIELD.terrain.up_m.copy()
    up_m[50:52, :] = 12.0  # a wood's edge right across the field, at its middle
    wooded = HeightGrid(-200.0, -200.0, 4.0, up_m)
    in_the_open = np.array(winds(wind_m_s=6.0, wind_from_rad=0.0))
    monkeypatch.setattr(outfit_module, "surface_of", lambda world: wooded)
    in_the_lee = np.array(winds(wind_m_s=6.0, wind_from_rad=0.0))
    upwind = np.array(winds(wind_m_s=6.0, wind_from_rad=math.pi))
    assert -in_the_open[:, 0].mean() == pytest.approx(5.76, abs=0.3)
    assert -in_the_lee[:, 0].mean() == pytest.approx(0.5 * 5.76, abs=0.8)
    assert in_the_lee[:, 2].std() > 1.2 * in_the_open[:, 2].std()
    assert upwind[:, 0].mean() == pytest.approx(5.76, abs=0.3)


def test_still_air_needs_no_lee() -> None:
    sim = outfit(FIELD)
    sim.step(STEP_S)
    assert sim.wind.lee is None
