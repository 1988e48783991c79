"""The fence: the table of what breaks it, and properties of polygons."""

import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from mission.geofence import Fence, Point, breach, is_inside, nearest_edge_m, polygon_fault

SQUARE = ((-20.0, -20.0), (-20.0, 20.0), (20.0, 20.0), (20.0, -20.0))
FENCE = Fence(100.0, 50.0, SQUARE, 8.0)
CYLINDER = Fence(100.0, 50.0)


@pytest.mark.parametrize(
    ("fence", "north_m", "east_m", "altitude_m", "is_min_in_force", "words"),
    [
        (CYLINDER, 0.0, 0.0, 0.0, True, None),
        (CYLINDER, 60.0, 80.0, 10.0, True, None),
        (CYLINDER, 60.0, 80.1, 10.0, True, "100 m from the take-off point, allowed are 100 m"),
        (CYLINDER, 0.0, 0.0, 50.0, True, None),
        (CYLINDER, 0.0, 0.0, 50.6, True, "51 m high, allowed are 50 m"),
        (FENCE, 19.9, -19.9, 10.0, True, None),
        (FENCE, 20.1, 0.0, 10.0, True, "outside the fence's polygon, 20 m north and 0 m east"),
        (FENCE, 0.0, -20.1, 10.0, True, "outside the fence's polygon, 0 m north and -20 m east"),
        (FENCE, 0.0, 0.0, 8.0, True, None),
        (FENCE, 0.0, 0.0, 7.9, True, "7.9 m high, at least 8 m are required"),
        (FENCE, 0.0, 0.0, 7.9, False, None),
    ],
)
def test_what_breaks_the_fence(
    fence: Fence, north_m: float, east_m: float, altitude_m: float, is_min_in_force: bool, words: str | None
) -> None:
    found = breach(fence, north_m, east_m, altitude_m, is_min_in_force=is_min_in_force)
    assert found is None if words is None else words in (found or "")


@pytest.mark.parametrize(
    ("polygon", "fault"),
    [
        (SQUARE, None),
        (tuple(reversed(SQUARE)), None),
        (((-5, -5), (-5, 30), (30, 30), (30, 20), (5, 20), (5, -5)), None),
        (((-20, -20), (20, 20), (-20, 20), (20, -20)), "its sides 1 and 3 cross"),
        (((10, 10), (10, 20), (20, 20)), "the take-off point (0, 0) is not within it"),
        (((-9, -9), (-9, 9), (-9, 9), (9, 0)), "corner 2 stands at the same place"),
        (((-9, 0), (9, 0), (-5, 0)), "lie on each other"),
        # a corner that touches another side
        (((-20, -20), (-20, 20), (20, 20), (-20, 0), (20, -20)), "cross"),
    ],
)
def test_polygons_that_are_no_fence(polygon: tuple[Point, ...], fault: str | None) -> None:
    found = polygon_fault([(float(north), float(east)) for north, east in polygon])
    assert found is None if fault is None else fault in (found or "")


ANGLES = st.lists(st.floats(0.0, 2 * math.pi - 0.1), min_size=3, max_size=12, unique=True)
REACH = st.floats(-60.0, 60.0)


def star(angles: list[float], radii_m: list[float]) -> list[Point]:
    """Corners around the origin in the order of their angles; close ones are left out."""
    corners: list[Point] = []
    last = -1.0
    for angle, radius_m in zip(sorted(angles), radii_m, strict=False):
        if angle - last > 0.1:
            corners.append((radius_m * math.cos(angle), radius_m * math.sin(angle)))
            last = angle
    return corners


stars = st.builds(star, ANGLES, st.lists(st.floats(5.0, 50.0), min_size=12, max_size=12)).filter(
    lambda corners: len(corners) >= 3
)


def gaps_rad(polygon: list[Point]) -> list[float]:
    angles = sorted(math.atan2(east, north) for north, east in polygon)
    return [after - before for before, after in zip(angles, [*angles[1:], angles[0] + 2 * math.pi], strict=True)]


@given(stars)
def test_a_star_around_the_take_off_point_is_a_fence(polygon: list[Point]) -> None:
    assume(max(gaps_rad(polygon)) < math.pi - 0.05)
    assert polygon_fault(polygon) is None
    assert polygon_fault(polygon[::-1]) is None


@given(stars, REACH, REACH, st.integers(0, 11), st.floats(-100.0, 100.0), st.floats(-100.0, 100.0))
def test_inside_does_not_depend_on_first_corner_direction_or_place(
    polygon: list[Point], north_m: float, east_m: float, turn: int, shift_n_m: float, shift_e_m: float
) -> None:
    assume(nearest_edge_m(polygon, north_m, east_m) > 1e-6)
    inside = is_inside(polygon, north_m, east_m)
    first = turn % len(polygon)
    assert is_inside([*polygon[first:], *polygon[:first]], north_m, east_m) == inside
    assert is_inside(polygon[::-1], north_m, east_m) == inside
    moved = [(n + shift_n_m, e + shift_e_m) for n, e in polygon]
    assert is_inside(moved, north_m + shift_n_m, east_m + shift_e_m) == inside


@given(stars, st.floats(0.0, 1.0), st.integers(0, 11), st.floats(0.0, 0.99), st.floats(1.01, 5.0))
def test_between_centre_and_outline_is_inside_and_beyond_it_is_outside(
    polygon: list[Point], share: float, side: int, within: float, beyond: float
) -> None:
    assume(max(gaps_rad(polygon)) < math.pi - 0.05)
    (north_a, east_a), (north_b, east_b) = polygon[side % len(polygon)], polygon[(side + 1) % len(polygon)]
    north_m, east_m = north_a + share * (north_b - north_a), east_a + share * (east_b - east_a)
    assume(math.hypot(north_m, east_m) > 0.1)
    fence = Fence(1000.0, 50.0, tuple(polygon))
    assert breach(fence, within * north_m, within * east_m, 10.0, is_min_in_force=True) is None
    assert breach(fence, beyond * north_m, beyond * east_m, 10.0, is_min_in_force=True) is not None


@given(REACH, REACH)
def test_a_square_is_the_box_that_it_is(north_m: float, east_m: float) -> None:
    assume(all(abs(abs(x) - 20.0) > 1e-9 for x in (north_m, east_m)))
    assert is_inside(SQUARE, north_m, east_m) == (max(abs(north_m), abs(east_m)) < 20.0)
