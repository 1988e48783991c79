"""Conductors told apart by their places and depths, from slopes seen along a way across them."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mission.wires import Wire, Wires

FRAME_S = 1 / 30
EVERYWHERE = (-math.inf, math.inf)
VIEW = (-0.8, 0.8)
DEEPEST_M = 12.0

Things = list[tuple[float, float]]
"""Place and depth [m] of each."""


def cross(
    things: Things,
    asides_m: np.ndarray,
    *,
    wires: Wires | None = None,
    noise: float = 0.0,
    hides: Callable[[int, int], bool] = lambda frame, k: False,
    deepest_m: float = DEEPEST_M,
) -> Wires:
    """What is known after a way across; `hides` says whether a frame misses thing `k`."""
    wires = wires or Wires(6.0, 4.5)
    rng = np.random.default_rng(4)
    for frame, aside_m in enumerate(asides_m.tolist()):
        wires.forecast(FRAME_S, 0.0)
        slopes = sorted(
            slope + noise * rng.standard_normal()
            for k, (place_m, depth_m) in enumerate(things)
            if not hides(frame, k) and VIEW[0] < (slope := (place_m - aside_m) / depth_m) < VIEW[1]
        )
        wires.see(slopes, aside_m, VIEW, 0.0)
        wires.choose_members(deepest_m)
    return wires


WAY_M = np.arange(-8.0, 1.0, 0.08)
THREE: Things = [(-0.8, 6.5), (0.0, 6.5), (0.8, 6.5)]


@given(place_m=st.floats(-2.0, 2.0), depth_m=st.floats(3.0, 25.0))
def test_a_way_across_tells_place_and_depth(place_m: float, depth_m: float) -> None:
    (wire,) = cross([(place_m, depth_m)], WAY_M).all
    assert wire.is_depth_known
    assert wire.depth_m == pytest.approx(depth_m, rel=0.05)
    assert wire.place_m == pytest.approx(place_m, abs=0.1)


def test_a_short_way_tells_no_depth() -> None:
    wires = cross(THREE, np.arange(-3.0, -2.7, 0.02))
    assert len(wires.members) == 3
    assert not wires.is_depth_known


def test_the_middle_is_halfway_between_the_outermost_though_a_part_is_seen() -> None:
    def hides(frame: int, k: int) -> bool:
        return (frame + k) % 3 == 0

    wires = cross(THREE, WAY_M, noise=0.01, hides=hides)
    assert len(wires.members) == 3
    assert wires.middle_m == pytest.approx(0.0, abs=0.08)


def test_conductors_at_different_depths_have_a_common_middle() -> None:
    """The apparent middle of what is in view is not it: a tower with one conductor above two."""
    things = [(-4.4, 23.0), (3.4, 18.5), (4.4, 23.0)]
    wires = cross(things, np.arange(-20.0, -2.0, 0.08), wires=Wires(16.0, 12.0), deepest_m=28.0)
    assert [wire.depth_m for wire in wires.members] == pytest.approx([23.0, 18.5, 23.0], rel=0.05)
    assert wires.middle_m == pytest.approx(0.0, abs=0.2)


def test_what_lies_on_the_ground_is_no_conductor() -> None:
    wires = cross([*THREE, (2.2, 16.0)], WAY_M)
    assert len(wires.all) == 4
    assert [round(wire.place_m, 1) for wire in wires.members] == [-0.8, 0.0, 0.8]


def test_what_is_seen_a_few_times_is_no_conductor_and_is_forgotten() -> None:
    def hides(frame: int, k: int) -> bool:
        return k == 3 and not 90 <= frame < 94

    wires = cross([*THREE, (1.6, 6.5)], WAY_M, hides=hides)
    assert len(wires.members) == 3
    cross(THREE, np.full(100, 0.0), wires=wires)
    assert len(wires.all) == 3


def test_another_line_beside_is_another_one() -> None:
    wires = cross([*THREE, (9.0, 6.5), (9.8, 6.5)], np.arange(-8.0, 6.0, 0.08))
    assert len(wires.all) == 5
    assert [round(wire.place_m, 1) for wire in wires.members] == [-0.8, 0.0, 0.8]


def test_a_conductor_that_is_hard_to_see_stays_one_for_a_while() -> None:
    wires = cross(THREE, WAY_M)
    cross(THREE, np.full(150, 0.0), wires=wires, hides=lambda frame, k: k == 0)
    assert len(wires.members) == 3
    cross(THREE, np.full(900, 0.0), wires=wires, hides=lambda frame, k: k == 0)
    assert len(wires.members) == 2


def test_the_line_is_not_complete_while_the_depth_of_what_is_beside_it_is_not_known() -> None:
    """High above a line, of which one conductor is found late, it takes some way to tell its depth."""
    two: Things = [(-4.4, 23.0), (4.4, 23.0)]
    way_m = np.arange(-16.0, -3.0, 0.08)
    is_late = len(way_m) - 20
    high = Wires(16.0, 12.0)
    wires = cross(two, way_m, wires=high, hides=lambda frame, k: k == 1 and frame < is_late, deepest_m=28.0)
    assert len(wires.members) == 1
    assert wires.is_depth_known
    assert not wires.is_complete
    for aside_m in np.arange(-3.0, 2.0, 0.08).tolist():
        wires.see([(place_m - aside_m) / depth_m for place_m, depth_m in two], aside_m, VIEW, 0.0)
        wires.choose_members(28.0)
    assert len(wires.members) == 2
    assert wires.is_complete


def test_once_settled_a_conductor_stays_one_however_deep_it_seems() -> None:
    wires = cross(THREE, WAY_M)
    wires.choose_members(3.0)
    assert not wires.members
    wires = cross(THREE, WAY_M)
    wires.is_settled = True
    wires.choose_members(3.0)
    assert len(wires.members) == 3


def test_a_drift_of_the_position_moves_what_is_out_of_view_as_well() -> None:
    """The vehicle stands 3 m beside the line and sees two of three; its position drifts by 1 m in 10 s."""
    wires = cross([(-4.0, 6.5), (0.0, 6.5), (4.0, 6.5)], np.arange(-10.0, 3.0, 0.08))
    wires.is_settled = True
    assert len(wires.members) == 3
    for k in range(300):
        wires.forecast(FRAME_S, 0.0)
        wires.see([(place_m - 3.0) / 6.5 for place_m in (0.0, 4.0)], 3.0 + k / 300, VIEW, 0.0)
        wires.choose_members(DEEPEST_M)
    assert [wire.place_m for wire in wires.members] == pytest.approx([-3.0, 1.0, 5.0], abs=0.25)


def test_after_a_gap_all_of_it_may_have_moved() -> None:
    slopes = [(place_m + 1.2 - 0.5) / 6.5 for place_m in (-0.8, 0.0, 0.8)]
    wires = cross(THREE, WAY_M)
    assert not wires.see([slopes[2]], 0.5, VIEW, 0.0)
    wires = cross(THREE, WAY_M)
    seen = wires.see(slopes, 0.5, VIEW, 1.5)
    assert sum(wire.is_member for wire in seen.values()) == 3
    assert wires.middle_m == pytest.approx(1.2, abs=0.1)
    wires = cross(THREE, WAY_M)
    far = [slope + 3.0 / 6.5 for slope in slopes]
    assert not any(wire.is_member for wire in wires.see(far, 0.5, EVERYWHERE, 1.5).values())


def test_climbing_makes_it_deeper_where_it_is() -> None:
    wire = Wire.at(0.1, 2.0, 6.0)
    place_m = wire.place_m
    wire.forecast(0.0, 3.0)
    assert wire.depth_m == pytest.approx(9.0)
    assert wire.place_m == pytest.approx(place_m)


def test_rows_on_the_ground_that_were_taken_for_each_other_are_no_complete_line() -> None:
    wires = cross(THREE, WAY_M)
    assert wires.is_complete
    crowded = cross(THREE, WAY_M)
    twin = Wire.at(0.0, 0.0, 6.5)
    twin.p, twin.rho_per_m, twin.var_rho, twin.n_hits, twin.seen_s = 0.1 / 6.5, 1 / 6.5, 1e-6, 60, 3.0
    twin.is_member = True
    crowded.all.append(twin)
    assert not crowded.is_complete


def test_the_list_stays_short_and_the_line_finds_room_in_it() -> None:
    rows: Things = [(-60.0 + 1.6 * k, 16.0) for k in range(30)]
    wires = cross([*rows, *THREE], np.arange(-60.0, 0.0, 0.08))
    assert len(wires.all) <= 24
    assert [round(wire.place_m, 1) for wire in wires.members] == [-0.8, 0.0, 0.8]


def test_a_minute_later_what_is_beside_the_line_still_has_to_prove_how_deep_it_is() -> None:
    """Flying along it, the depths become unsure; a kerb 3 m aside on the ground is no conductor for that."""
    wires = cross(THREE, WAY_M)
    wires.is_settled = True
    sway_m = 0.1 * np.sin(np.arange(2400) / 15.0)
    cross(THREE, sway_m, wires=wires)
    cross([*THREE, (3.0, 16.0)], sway_m[:900], wires=wires)
    assert len(wires.all) == 4
    assert len(wires.members) == 3
    assert wires.middle_m == pytest.approx(0.0, abs=0.05)


def test_what_the_vehicle_would_have_to_touch_was_none() -> None:
    """Two ruts that were supposed 6 m below while the vehicle came down by 30 m."""
    wires = Wires(6.0, 4.5)
    for k in range(300):
        wires.forecast(FRAME_S, -0.1)
        height_m = 35.0 - 0.1 * k
        wires.see([-0.9 / height_m, 0.9 / height_m], 0.0, VIEW, 0.0)
        wires.choose_members(0.85 * height_m)
        assert all(0.4 < wire.depth_m < 1e4 and wire.var_rho > 0.0 for wire in wires.all)
        assert isinstance(wires.is_depth_known, bool)


def test_a_jump_of_the_position_by_one_spacing_is_seen_through() -> None:
    """Two of three conductors are where another one was: that is not the most that can be explained."""
    wires = cross(THREE, WAY_M)
    wires.is_settled = True
    for _ in range(30):
        wires.forecast(FRAME_S, 0.0)
        wires.see([(place_m + 0.8) / 6.5 for place_m, _ in THREE], 0.0, VIEW, 0.0)
        wires.choose_members(DEEPEST_M)
    assert wires.middle_m == pytest.approx(0.8, abs=0.1)
    assert len(wires.members) == 3


def test_one_thing_where_a_conductor_might_be_does_not_move_the_line() -> None:
    wires = cross([*THREE, (4.0, 16.0)], WAY_M)
    wires.see([4.0 / 16.0], 0.0, VIEW, 4.0)
    assert wires.middle_m == pytest.approx(0.0, abs=0.05)
