"""Which lines count as the one that is followed, and where its middle is."""

import math
from dataclasses import replace

import pytest

from drivers.clock import NS_PER_S
from mission.autopilot import Setpoint
from mission.build import guidance_settings
from mission.guidance import Bearing
from mission.known_line import Found, KnownLine, View
from mission.plan import GuidancePlan
from mission.tasks.height_hold import HeightHold
from mission.tasks.task import Observation, Sight
from tests.mission.test_tasks import state_at

GUIDANCE = guidance_settings(GuidancePlan(height_over_line_m=6.0))
EAST = math.pi / 2
FRAME_NS = NS_PER_S // 30
PLACES_M = (-0.8, 0.0, 0.8)


def view(
    north_m: float,
    places_m: tuple[float, ...] = PLACES_M,
    *,
    t_ns: int = 0,
    depth_m: float = 6.0,
    heading_rad: float = EAST,
    east_m: float = 0.0,
    climb_m: float = 0.0,
) -> View:
    """A vehicle at `north_m` sees conductors that run east at `places_m` south of the origin."""
    bearings = tuple(Bearing(heading_rad, (place_m + north_m) / (depth_m + climb_m)) for place_m in places_m)
    middle = Bearing(heading_rad, 0.5 * (bearings[0].slope + bearings[-1].slope))
    return View(t_ns, north_m, east_m, -16.0 - climb_m, 16.0 + climb_m, middle, bearings, (-0.8, 0.8))


def flown_to(
    north_m: float = 0.0, *, depth_m: float = 6.0, spacing_m: float | None = None
) -> tuple[KnownLine, int, Found | None]:
    """A line to which a vehicle has flown from the south; the time, and what it saw last."""
    known, found, t_ns = KnownLine(), None, 0
    guidance = replace(GUIDANCE, conductor_spacing_m=spacing_m)
    for k in range(round((north_m + 5.0) / 0.08) + 1):
        t_ns = k * FRAME_NS
        found = known.see(view(-5.0 + 0.08 * k, t_ns=t_ns, depth_m=depth_m), guidance)
    known.begin()
    return known, t_ns, found


def test_any_line_may_be_it_at_first_and_how_far_below_is_not_known() -> None:
    found = KnownLine().see(view(-4.0), GUIDANCE)
    assert found is not None
    assert found.depth_m is None
    assert found.line.offset_m(-4.0, 0.0, EAST) == pytest.approx(-4.0)


def test_the_way_to_it_tells_how_far_below_it_is() -> None:
    _, _, found = flown_to(depth_m=8.0)
    assert found is not None
    assert found.depth_m == pytest.approx(8.0, rel=0.03)
    assert found.line.offset_m(0.0, 0.0, EAST) == pytest.approx(0.0, abs=0.05)


def test_what_lies_on_the_ground_is_no_line() -> None:
    _, _, found = flown_to(depth_m=16.0)
    assert found is None


def test_a_part_of_the_line_tells_where_all_of_it_is() -> None:
    known, t_ns, _ = flown_to()
    found = known.see(view(0.3, (0.8,), t_ns=t_ns + FRAME_NS), GUIDANCE)
    assert found is not None
    assert found.line.offset_m(0.0, 0.0, EAST) == pytest.approx(0.0, abs=0.1)


def test_a_conductor_too_many_moves_nothing() -> None:
    known, t_ns, _ = flown_to()
    for k in range(1, 40):
        found = known.see(view(0.0, (*PLACES_M, 2.4), t_ns=t_ns + k * FRAME_NS), GUIDANCE)
        assert found is not None
        assert found.line.offset_m(0.0, 0.0, EAST) == pytest.approx(0.0, abs=0.1)


@pytest.mark.parametrize(("aside_m", "after_s", "is_it"), [(2.5, 0.1, False), (2.5, 10.0, True), (6.0, 1000.0, False)])
def test_a_line_does_not_jump_sideways_but_the_position_drifts(aside_m: float, after_s: float, is_it: bool) -> None:
    for sign in (-1, 1):
        known, t_ns, _ = flown_to()
        moved = view(0.0, tuple(place_m + sign * aside_m for place_m in PLACES_M), t_ns=t_ns + int(after_s * NS_PER_S))
        assert (known.see(moved, GUIDANCE) is not None) is is_it


@pytest.mark.parametrize("turn_deg", [-60.0, -30.0, 30.0, 60.0])
def test_a_span_begins_where_the_last_one_ends(turn_deg: float) -> None:
    heading_rad = EAST + math.radians(turn_deg)
    known, t_ns, _ = flown_to()
    # Abreast of the vehicle the next span passes where it has come to from a bend 3 m back.
    aside_m = -3.0 * math.sin(math.radians(turn_deg))
    turned = view(0.0, tuple(p - aside_m for p in PLACES_M), t_ns=t_ns + FRAME_NS, heading_rad=heading_rad)
    assert known.see(turned, GUIDANCE) is None  # one view may be wrong
    found = known.see(replace(turned, t_ns=t_ns + 2 * FRAME_NS), GUIDANCE)
    assert found is not None
    assert math.cos(found.line.heading_rad - heading_rad) == pytest.approx(1.0)
    assert found.line.offset_m(0.0, 0.0, heading_rad) == pytest.approx(-aside_m, abs=0.1)
    far_away = view(0.0, tuple(p + 25.0 for p in PLACES_M), t_ns=t_ns, heading_rad=heading_rad)
    known, _, _ = flown_to()
    assert [known.see(far_away, GUIDANCE) for _ in range(5)] == [None] * 5


def test_a_line_across_is_another_one() -> None:
    known, t_ns, _ = flown_to()
    assert known.see(view(0.0, t_ns=t_ns + FRAME_NS, heading_rad=EAST + math.radians(80.0)), GUIDANCE) is None


def test_before_one_is_followed_another_direction_is_looked_at_when_it_stays() -> None:
    known = KnownLine()
    for k in range(5):
        known.see(view(-4.0, t_ns=k * FRAME_NS), GUIDANCE)
    seen = [known.see(view(-4.0, t_ns=(5 + k) * FRAME_NS, heading_rad=0.8), GUIDANCE) for k in range(3)]
    assert [found is not None for found in seen] == [False, False, True]


def test_the_known_line_is_found_beyond_a_bend_that_shows_another_one() -> None:
    known, t_ns, _ = flown_to()
    across = view(0.0, tuple(p + 25.0 for p in PLACES_M), t_ns=t_ns + FRAME_NS, heading_rad=EAST + math.radians(40.0))
    found = known.see(replace(across, next_span=Bearing(EAST, 0.0)), GUIDANCE)
    assert found is not None
    assert not found.is_placed
    assert found.line.heading_rad == pytest.approx(EAST)


def test_it_may_be_forgotten() -> None:
    known, t_ns, _ = flown_to()
    elsewhere = view(0.0, tuple(place_m + 9.0 for place_m in PLACES_M), t_ns=t_ns + FRAME_NS)
    assert known.see(elsewhere, GUIDANCE) is None
    known.forget()
    assert known.see(elsewhere, GUIDANCE) is not None


def test_the_height_is_told_by_the_spacing_when_all_conductors_are_seen() -> None:
    known, t_ns, found = flown_to(spacing_m=0.8, depth_m=6.6)
    guidance = replace(GUIDANCE, conductor_spacing_m=0.8)
    assert found is not None
    assert found.height_m == pytest.approx(6.6, rel=0.01)
    part = known.see(view(0.0, (0.0, 0.8), t_ns=t_ns + FRAME_NS, depth_m=6.6), guidance)
    assert part is not None
    assert part.height_m is None


def test_a_spacing_that_contradicts_the_way_flown_tells_no_height() -> None:
    _, _, found = flown_to(spacing_m=1.6, depth_m=6.0)
    assert found is not None
    assert found.depth_m == pytest.approx(6.0, rel=0.03)
    assert found.height_m is None


def test_a_climb_changes_no_place() -> None:
    known, t_ns, _ = flown_to(north_m=1.0)
    for k in range(1, 60):
        found = known.see(view(1.0, t_ns=t_ns + k * FRAME_NS, climb_m=0.05 * k), GUIDANCE)
    assert found is not None
    assert found.depth_m == pytest.approx(6.0 + 0.05 * 59, rel=0.05)
    assert found.line.offset_m(0.0, 0.0, EAST) == pytest.approx(0.0, abs=0.1)


@pytest.mark.parametrize("rise_m_s", [0.15, 0.6])
def test_uphill_the_height_over_the_conductors_is_held(rise_m_s: float) -> None:
    """The line rises by 12 m under a vehicle that follows it: neither knows that it is not the vehicle that sinks."""
    guidance = replace(GUIDANCE, conductor_spacing_m=0.8)
    known, t_ns, _ = flown_to(spacing_m=0.8)
    hold, setpoint, line_m = HeightHold(guidance), Setpoint(0.0, 0.0, -16.0, 0.0), 10.0
    clearances_m = []
    for k in range(1, 2400):
        line_m = min(22.0, line_m + rise_m_s / 30)
        height_m = -setpoint.down_m
        above = view(0.05 * math.sin(k / 20), t_ns=t_ns + k * FRAME_NS, depth_m=height_m - line_m)
        seen = replace(above, down_m=-height_m, ground_m=height_m)
        found = known.see(seen, guidance)
        sight = Sight(seen.t_ns, EAST, 0.0, 0.0, -height_m, found)
        setpoint = hold.step(setpoint, Observation(1 / 30, state_at(setpoint), sight))
        clearances_m.append(height_m - line_m)
    assert min(clearances_m) > 5.0
    assert clearances_m[-1] == pytest.approx(6.0, abs=0.5)


def test_a_wrong_first_line_is_left_when_it_is_not_seen_any_more() -> None:
    known = KnownLine()
    known.see(view(0.0, heading_rad=EAST - math.radians(80.0)), GUIDANCE)
    known.begin()
    found = [known.see(view(0.0, t_ns=k * NS_PER_S // 10), GUIDANCE) for k in range(1, 40)]
    assert not any(found[:15])
    assert all(found[-10:])


def test_what_was_flown_over_elsewhere_does_not_keep_the_line_from_being_found() -> None:
    """A wire along the way, 10 m up and soon over; then the line, across."""
    known, found = KnownLine(), None
    for k in range(40):
        along = view(-4.0 + 0.08 * k, (0.0,), t_ns=k * FRAME_NS, heading_rad=EAST + 1.2)
        found = known.see(along, GUIDANCE)
    assert found is not None
    assert found.depth_m is not None
    for k in range(90):
        found = known.see(view(-5.0 + 0.08 * k, t_ns=10 * NS_PER_S + k * FRAME_NS), GUIDANCE)
    assert found is not None
    assert found.depth_m == pytest.approx(6.0, rel=0.1)


def test_a_field_of_rows_is_no_line() -> None:
    rows = tuple(0.75 * k - 9.0 for k in range(25))
    known = KnownLine()
    seen = [known.see(view(-3.0 + 0.08 * k, rows, t_ns=k * FRAME_NS, depth_m=16.0), GUIDANCE) for k in range(60)]
    assert not any(seen)
