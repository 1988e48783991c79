"""Lines run where they are laid, turn on the bisector, and hang what their file says."""

import itertools
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from sitl.world.errors import WorldError, WrongKey
from sitl.world.line_models import LineModel
from sitl.world.records import Conductor
from sitl.world.route import stands
from sitl.world.stringing import bundle_offsets, runs, sags_m
from tests.sitl.world.worlds import world_of

POLE = "    support: {kind: wood_pole, height_m: 11}\n"
TOWER = "    support: {kind: lattice_tower, height_m: 35}\n"
WIRES = "    conductors: {n: 3, wire: penguin, tension_n: 5000}\n"
STRAIGHT = "  - points_ne_m: [[0, 0], [0, 60], [0, 120], [0, 180], [0, 240]]\n"
TURNING = "  - points_ne_m: [[0, 0], [0, 250], [125, 466.5], [125, 700]]\n"

turns = st.lists(st.floats(-60.0, 60.0), min_size=1, max_size=6)


def line_model(**route: object) -> LineModel:
    return LineModel.model_validate(
        {"route": route, "support": {"kind": "wood_pole"}, "conductors": {"wire": "raven", "sag_m": 0.5}}
    )


def is_smooth(conductor: Conductor, sharpest_rad: float) -> bool:
    steps = np.diff(conductor.points_ned_m, axis=0)
    steps /= np.linalg.norm(steps, axis=1)[:, None]
    return bool(np.all(np.einsum("ij,ij->i", steps[:-1], steps[1:]) > math.cos(sharpest_rad)))


def outermost(conductors: tuple[Conductor, ...], i: int) -> NDArray[np.float64]:
    return np.array([conductor.points_ned_m[i] for conductor in conductors])


@given(angles_deg=turns, heading_deg=st.floats(-180, 180), span_m=st.floats(20, 300))
def test_a_route_turns_at_each_support_by_its_angle(angles_deg: list[float], heading_deg: float, span_m: float) -> None:
    spans_m = [span_m + k for k in range(len(angles_deg) + 1)]
    line = line_model(first_ne_m=[5, 7], heading_deg=heading_deg, spans_m=spans_m, turns_deg=angles_deg)
    laid = stands(line, "lines.0", 0.0)
    places = [stand.place_ne_m for stand in laid]
    assert places[0] == (5.0, 7.0)
    assert [math.dist(a, b) for a, b in itertools.pairwise(places)] == pytest.approx(spans_m)
    directions = [math.atan2(b[1] - a[1], b[0] - a[0]) for a, b in itertools.pairwise(places)]
    assert math.cos(directions[0] - math.radians(heading_deg)) == pytest.approx(1.0)
    for stand, (before, after), angle_deg in zip(laid[1:-1], itertools.pairwise(directions), angles_deg, strict=True):
        assert stand.turn_rad == pytest.approx(math.radians(angle_deg), abs=1e-9)
        # The cross-arm stands on the bisector: as far from the one span as from the other.
        assert math.cos(stand.heading_rad - before) == pytest.approx(math.cos(after - stand.heading_rad))
        assert math.cos(stand.heading_rad - before) > 0.8


@given(angles_deg=turns, yaw_rad=st.floats(-3.0, 3.0), data=st.data())
def test_a_route_meets_the_start_where_it_says(angles_deg: list[float], yaw_rad: float, data: st.DataObject) -> None:
    spans_m = [50.0 + 3.0 * k for k in range(len(angles_deg) + 1)]
    span = data.draw(st.integers(1, len(spans_m)))
    meets = {"distance_m": 15, "span": span, "after_m": 20}
    laid = stands(line_model(meets_start=meets, spans_m=spans_m, turns_deg=angles_deg), "lines.0", yaw_rad)
    here, there = np.array(laid[span - 1].place_ne_m), np.array(laid[span].place_ne_m)
    along = (there - here) / np.linalg.norm(there - here)
    nose = np.array([math.cos(yaw_rad), math.sin(yaw_rad)])
    assert here + 20.0 * along == pytest.approx(15.0 * nose)
    # From left to right.
    assert along == pytest.approx([-nose[1], nose[0]])
    assert [math.dist(a.place_ne_m, b.place_ne_m) for a, b in itertools.pairwise(laid)] == pytest.approx(spans_m)
    assert [stand.turn_rad for stand in laid[1:-1]] == pytest.approx([math.radians(a) for a in angles_deg], abs=1e-9)


def test_a_line_that_turns_back_is_refused() -> None:
    line = LineModel.model_validate(
        {"points_ne_m": [[0, 0], [0, 50], [5, 10]], "support": {"kind": "wood_pole"},
         "conductors": {"wire": "raven", "sag_m": 0.5}}
    )  # fmt: skip
    with pytest.raises(WrongKey, match="turns by") as caught:
        stands(line, "lines.3", 0.0)
    assert caught.value.key == "lines.3.points_ne_m.1"


@pytest.mark.parametrize(
    ("head", "n", "rights_m", "heights_m"),
    [
        ("cross_arm", 1, [0], [11.2]),
        ("cross_arm", 2, [-0.8, 0.8], [10.9, 10.9]),
        ("cross_arm", 3, [-0.8, 0, 0.8], [10.9, 11.2, 10.9]),
        ("cross_arm", 4, [-0.8, -0.8 / 3, 0.8 / 3, 0.8], [10.9] * 4),
        ("delta", 3, [-1.05, 0, 1.05], [10.35, 11.2, 10.35]),
        ("column", 3, [0, -0.51, 0.51], [11.2, 10.5, 9.75]),
    ],
)
def test_a_pole_holds_its_conductors(
    tmp_path: Path, head: str, n: int, rights_m: list[float], heights_m: list[float]
) -> None:
    support = f"    support: {{kind: wood_pole, height_m: 11, head: {head}}}\n"
    line = world_of(tmp_path, STRAIGHT + support + f"    conductors: {{n: {n}, wire: raven, sag_m: 0.4}}\n").line
    # The line runs east: its right is south.
    at_start = np.array([conductor.points_ned_m[0] for conductor in line.conductors])
    assert -at_start[:, 0] == pytest.approx(np.array(rights_m))
    assert -at_start[:, 2] == pytest.approx(np.array(heights_m))
    middle = (min(rights_m) + max(rights_m)) / 2
    assert np.array(line.axis_ne_m) == pytest.approx(np.array([[-middle, 60.0 * k] for k in range(5)]))
    # Each wire lies on the end of an insulator, which stands on the pole.
    for support_record in line.supports:
        pins = [m for m in support_record.members if m.material == "porcelain"]
        assert len(pins) == n
        for pin in pins:
            assert min(np.linalg.norm(c.points_ned_m - pin.end_ned_m, axis=1).min() for c in line.conductors) < 1e-9


def test_a_section_between_angles_has_one_tension(tmp_path: Path) -> None:
    points = "  - points_ne_m: [[0, 0], [0, 40], [0, 120], [60, 180], [60, 240]]\n"
    line = world_of(tmp_path, points + POLE + WIRES).line
    wire = line.conductors[0].points_ned_m
    at = [int(np.hypot(*(wire[:, :2] - s.base_ned_m[:2]).T).argmin()) for s in line.supports]
    parameters = []
    for here, there in itertools.pairwise(at):
        span = wire[here : there + 1]
        along = np.linalg.norm(span[:, :2] - span[0, :2], axis=1)
        bend, _, _ = np.polyfit(along, -span[:, 2], 2)
        parameters.append(1.0 / (2.0 * bend))
    assert parameters[0] == pytest.approx(parameters[1], rel=1e-2)
    assert parameters[2] != pytest.approx(parameters[1], rel=3e-3)


def test_a_missing_span_interrupts_all_conductors(tmp_path: Path) -> None:
    line = world_of(tmp_path, STRAIGHT + POLE + WIRES + "    missing_spans: [3]\n").line
    assert len(line.conductors) == 6
    for conductor in line.conductors:
        easts = conductor.points_ned_m[:, 1]
        assert easts.max() <= 120.0 + 1e-9 or easts.min() >= 180.0 - 1e-9
    assert len(line.supports) == len(line.axis_ne_m) == 5


@given(st.integers(1, 12), st.sets(st.integers(1, 12)))
def test_runs_cover_the_spans_that_are_there(n_spans: int, missing: set[int]) -> None:
    found = runs(n_spans, sorted(missing))
    covered = [k for first, beyond in found for k in range(first, beyond)]
    assert covered == [k for k in range(n_spans) if k + 1 not in missing]
    assert all(first < beyond for first, beyond in found)
    assert all(before[1] < after[0] for before, after in itertools.pairwise(found))


@pytest.mark.parametrize("n_bundle", [2, 3, 4])
def test_the_wires_of_a_bundle_keep_their_spacing(tmp_path: Path, n_bundle: int) -> None:
    bundled = f"    conductors: {{n: 6, wire: hawk, n_bundle: {n_bundle}, bundle_spacing_m: 0.45}}\n"
    line = world_of(tmp_path, "  - points_ne_m: [[0, 0], [0, 250], [0, 500]]\n" + TOWER + bundled).line
    assert len(line.conductors) == 6 * n_bundle
    middles = np.array([c.points_ned_m[75] for c in line.conductors[:n_bundle]])
    gaps = np.linalg.norm(middles - np.roll(middles, 1, axis=0), axis=1)
    assert gaps == pytest.approx(np.full(n_bundle, 0.45), abs=0.005)
    assert np.sum(bundle_offsets(n_bundle, 0.45), axis=0) == pytest.approx([0.0, 0.0], abs=1e-12)


@pytest.mark.parametrize(("head", "n"), [("three_levels", 6), ("three_levels", 3), ("one_level", 3), ("one_level", 6)])
def test_a_tower_is_a_lattice_of_steel(tmp_path: Path, head: str, n: int) -> None:
    tower = f"    support: {{kind: lattice_tower, height_m: 40, head: {head}}}\n"
    wires = f"    conductors: {{n: {n}, wire: hawk}}\n    shield_wires: {{n: 2}}\n"
    line = world_of(tmp_path, "  - points_ne_m: [[0, 0], [0, 280], [0, 560]]\n" + tower + wires).line
    middle = line.supports[1]
    steel = [member for member in middle.members if member.material == "steel"]
    assert 100 <= len(steel) <= 250
    heights = [-end[2] for member in steel for end in (member.start_ned_m, member.end_ned_m)]
    assert min(heights) == pytest.approx(0.0)
    assert max(heights) == pytest.approx(40.0)
    strings = [member for member in middle.members if member.material == "porcelain"]
    assert len(strings) == n
    ends = np.array([[*m.start_ned_m] for m in steel] + [[*m.end_ned_m] for m in steel])
    for string in strings:
        # It hangs straight down from the tip of an arm, or from a chord on the way there.
        assert string.start_ned_m[:2] == pytest.approx(string.end_ned_m[:2])
        assert np.abs(ends[:, 2] - string.start_ned_m[2]).min() < 1e-9
    shields = [conductor for conductor in line.conductors if conductor.is_shield]
    assert len(shields) == 2
    lowest_shield = min(-float(s.points_ned_m[:, 2].max()) for s in shields)
    assert lowest_shield > max(-float(c.points_ned_m[:, 2].max()) for c in line.conductors if not c.is_shield)


def test_at_an_angle_tower_the_strings_lie_along_the_spans(tmp_path: Path) -> None:
    wires = "    conductors: {n: 6, wire: hawk}\n"
    line = world_of(tmp_path, TURNING + TOWER + wires).line
    angle = line.supports[1]
    strings = [member for member in angle.members if member.material == "porcelain"]
    assert len(strings) == 12
    for string in strings:
        assert string.start_ned_m[2] == pytest.approx(string.end_ned_m[2])
        assert math.dist(string.start_ned_m, string.end_ned_m) == pytest.approx(2.0)
    # One wire after the other, through the jumpers below the arms; nothing tears.
    assert len(line.conductors) == 6
    for conductor in line.conductors:
        assert np.linalg.norm(np.diff(conductor.points_ned_m, axis=0), axis=1).max() < 2.5
        assert is_smooth(conductor, math.radians(75.0))
    assert np.array(line.axis_ne_m) == pytest.approx(np.array([s.base_ned_m[:2] for s in line.supports]))


def test_the_legs_of_a_tower_reach_down_to_the_slope(tmp_path: Path) -> None:
    hills = "terrain: {kind: hills, amplitude_m: 25, wavelength_m: 200, seed: 3}\n"
    world = world_of(
        tmp_path, "  - points_ne_m: [[0, 20], [0, 200]]\n" + TOWER + "    conductors: {wire: hawk}\n", hills
    )
    tower = world.supports[0]
    lowest = sorted(
        {end for member in tower.members for end in (member.start_ned_m, member.end_ned_m)}, key=lambda end: -end[2]
    )[:4]
    feet = [end for end in lowest if abs(-end[2] - world.terrain.at(*end[:2])) < 1e-6]
    assert len(feet) >= 2
    assert -tower.base_ned_m[2] == pytest.approx(world.terrain.at(*tower.base_ned_m[:2]))


def test_a_custom_wire_hangs_as_the_same_named_one(tmp_path: Path) -> None:
    own = "{diameter_m: 0.01431, mass_kg_m: 0.433, area_mm2: 125.1, modulus_gpa: 81, expansion_per_k: 19.2e-6}"
    named = world_of(tmp_path, STRAIGHT + POLE + WIRES)
    custom = world_of(tmp_path, STRAIGHT + POLE + WIRES.replace("penguin", own))
    for one, other in zip(named.conductors, custom.conductors, strict=True):
        np.testing.assert_allclose(one.points_ned_m, other.points_ned_m, atol=1e-9)
        assert one.diameter_m == other.diameter_m


def test_a_hot_day_shows_in_the_line(tmp_path: Path) -> None:
    line = LineModel.model_validate(
        {"points_ne_m": [[0, 0], [0, 80], [0, 170]], "support": {"kind": "wood_pole"},
         "conductors": {"wire": "penguin", "tension_n": 6000}}
    )  # fmt: skip
    laid = stands(line, "lines.0", 0.0)
    sags = []
    for temperature_c in (-10.0, 15.0, 60.0):
        hung = line.conductors.model_copy(update={"temperature_c": temperature_c})
        sags.append(max(sags_m(laid, [(0, 2)], hung)))
    assert sags[0] < sags[1] < sags[2]
    assert sags[1] == pytest.approx(90.0**2 * 0.433 * 9.80665 / (8 * 6000), rel=1e-3)


@pytest.mark.parametrize(
    ("lines", "key"),
    [
        (STRAIGHT + POLE + "    conductors: {wire: penguin, tension_n: 40}\n", "lines.0.conductors"),
        (STRAIGHT + POLE + "    conductors: {wire: penguin, n: 7}\n", "lines.0.conductors.n"),
        (STRAIGHT + POLE + WIRES + "    missing_spans: [5]\n", "lines.0"),
        (STRAIGHT + POLE + WIRES + "    missing_spans: [1, 2, 3, 4]\n", "lines.0"),
        (STRAIGHT + POLE + WIRES + "    shield_wires: {n: 1}\n", "lines.0"),
        (STRAIGHT + TOWER + "    conductors: {wire: hawk, n: 5}\n", "lines.0"),
        (POLE.replace("    s", "  - s") + WIRES, "lines.0"),
        ("  - points_ne_m: [[0, 0], [0, 0.5]]\n" + POLE + WIRES, "lines.0.points_ne_m.1"),
        (STRAIGHT + POLE + WIRES + "  - points_ne_m: [[9, 0], [9, 900]]\n" + POLE + WIRES, "lines.1.conductors"),
        (STRAIGHT + "    support: {kind: cactus}\n" + WIRES, "lines.0.support"),
        (STRAIGHT + "    support: {kind: wood_pole, height_m: 99}\n" + WIRES, "lines.0.support.height_m"),
    ],
)  # fmt: skip
def test_a_line_that_cannot_be_names_its_key(tmp_path: Path, lines: str, key: str) -> None:
    with pytest.raises(WorldError, match=r"mine\.yaml is wrong at ") as caught:
        world_of(tmp_path, lines)
    assert f" {key}:" in str(caught.value)
    assert "\n" not in str(caught.value)
