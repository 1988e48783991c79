"""The picture of a flight: things stand where they happened, and any log can be drawn."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mission.log.canvas import ACCENT, Box, Canvas, rounded_mask
from mission.log.picture import HEIGHT_PX, MAP_BOX, WIDTH_PX, choose_frames, draw_summary, flight_view
from mission.log.reader import Flight, read_flight
from mission.log.strip_chart import nice_limit
from mission.log.summary import summarise
from mission.log.track_map import MapBackground, map_view, nice_length_m
from tests.log.synthetic_flight import LINE_NORTH_M, fly, write_log


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Flight:
    path = tmp_path_factory.mktemp("logs") / "flight.mcap"
    write_log(path, list(fly()))
    return read_flight(path, with_images=True)


@pytest.fixture(scope="module")
def picture(flight: Flight) -> np.ndarray:
    return draw_summary(flight, summarise(flight), None)


def pixel_at(flight: Flight, picture: np.ndarray, north_m: float, east_m: float) -> np.ndarray:
    x, y = flight_view(flight).to_px(np.array([[north_m, east_m]]), MAP_BOX)[0]
    return picture[round(y), round(x)]


def is_near(color: np.ndarray, wanted: tuple[int, int, int]) -> bool:
    return bool(np.abs(color.astype(int) - wanted).max() <= 12)


def test_a_picture_is_a_picture_and_the_same_each_time(flight: Flight, picture: np.ndarray) -> None:
    assert (picture.shape, picture.dtype) == ((HEIGHT_PX, WIDTH_PX, 3), np.uint8)
    np.testing.assert_array_equal(picture, draw_summary(flight, summarise(flight), None))


def test_the_followed_leg_is_drawn_where_it_was_flown(flight: Flight, picture: np.ndarray) -> None:
    followed = [pose for pose in flight.truth if abs(pose.north_m - LINE_NORTH_M) < 0.5 and 2 < pose.east_m < 28]
    assert len(followed) > 300
    hits = sum(is_near(pixel_at(flight, picture, pose.north_m, pose.east_m), ACCENT) for pose in followed)
    assert hits > 0.95 * len(followed)
    assert not is_near(pixel_at(flight, picture, LINE_NORTH_M - 6.0, 15.0), ACCENT)


def test_the_view_holds_the_track_with_a_margin_at_any_shape(flight: Flight) -> None:
    for width_px, height_px in ((800, 800), (400, 900), (900, 300)):
        view = map_view(flight, width_px, height_px)
        track = np.array([(pose.north_m, pose.east_m) for pose in flight.truth])
        places = view.to_px(track, Box(0, 0, width_px, height_px))
        assert places.min() > 0
        assert (places.max(axis=0) < (width_px, height_px)).all()
        south_m, west_m, north_m, east_m = view.bounds_ne_m
        assert (north_m - south_m) * view.px_per_m == pytest.approx(height_px)
        assert (east_m - west_m) * view.px_per_m == pytest.approx(width_px)


def test_the_background_lies_under_the_map_north_up(flight: Flight) -> None:
    # The background reaches further than the map and is coarser: blue north of the line, red south of it.
    image = np.zeros((400, 400, 3), np.uint8)
    image[:, :] = (200, 0, 0)
    rows_north_m = 62.0 - (np.arange(400) + 0.5) * 0.25
    image[rows_north_m < LINE_NORTH_M] = (0, 0, 200)
    background = MapBackground(image, (-38.0, -35.0, 62.0, 65.0))
    drawn = draw_summary(replace(flight, line=None), summarise(flight), background)
    north = pixel_at(flight, drawn, LINE_NORTH_M + 1.5, 10.0).astype(int)
    south = pixel_at(flight, drawn, LINE_NORTH_M - 1.5, 10.0).astype(int)
    assert north[0] > 100 > north[2]
    assert south[2] > 100 > south[0]


def test_conductors_are_drawn_where_they_hang(flight: Flight) -> None:
    lit, unlit = (draw_summary(drawn, summarise(flight), None) for drawn in (flight, replace(flight, line=None)))
    x, y = flight_view(flight).to_px(np.array([[LINE_NORTH_M + 1.0, 20.0]]), MAP_BOX)[0].round().astype(int)
    assert lit[y - 1 : y + 2, x].max() > 150
    assert unlit[y - 1 : y + 2, x].max() < 100


def test_the_frames_come_from_the_first_and_the_last_leg(flight: Flight) -> None:
    report = summarise(flight)
    chosen = choose_frames(flight, report)
    times_s = [(seen.t_capture_ns - flight.mission.start_ns) / 1e9 for seen in chosen]
    assert 30.0 < times_s[0] < 50.0
    assert 58.0 < times_s[1] < 78.0
    assert all(seen.jpeg is not None and len(seen.power_lines) for seen in chosen)


def test_power_lines_are_drawn_over_their_frame(flight: Flight, picture: np.ndarray) -> None:
    chosen = choose_frames(flight, summarise(flight))[0]
    box = Box(892, MAP_BOX.y, 332, 249)
    for x1, y1, x2, y2 in chosen.power_lines:
        x, y = box.x + (x1 + x2) / 2 * box.width / 640, box.y + (y1 + y2) / 2 * box.height / 480
        assert is_near(picture[round(y), round(x)], ACCENT)


@pytest.mark.parametrize(
    "left_out",
    [
        {"line": None, "truth": ()},
        {"reports": ()},
        {"tasks_started": (), "tasks_ended": ()},
        {"states": (), "truth": ()},
        {"setpoints": (), "mission_ended": None},
    ],
)
def test_a_flight_that_lacks_something_is_drawn_without_it(flight: Flight, left_out: dict[str, object]) -> None:
    lacking = replace(flight, **left_out)
    picture = draw_summary(lacking, summarise(lacking), None)
    assert picture.shape == (HEIGHT_PX, WIDTH_PX, 3)


def test_a_log_of_nothing_but_its_start_is_drawn(tmp_path: Path) -> None:
    write_log(tmp_path / "a.mcap", [])
    flight = read_flight(tmp_path / "a.mcap", with_images=True)
    assert draw_summary(flight, summarise(flight), None).std() > 0


@given(st.floats(0.01, 1e5))
def test_round_numbers_are_near_and_on_the_right_side(about: float) -> None:
    assert about / 2.5 * (1 - 1e-6) <= nice_length_m(about) <= about * (1 + 1e-6)
    assert about * (1 - 1e-6) <= nice_limit(about) <= about * 2.5 * (1 + 1e-6)
    mantissa = nice_limit(about) / 10 ** math.floor(math.log10(nice_limit(about)) + 1e-9)
    assert round(mantissa, 6) in (1.0, 2.0, 5.0)


def test_text_is_aligned_and_as_wide_as_it_says() -> None:
    canvas = Canvas(400, 60)
    before = canvas.image.copy()
    width_px = canvas.text((20, 40), "Follow lines", 24)
    columns = np.flatnonzero((canvas.image != before).any(axis=(0, 2)))
    assert 20 <= columns.min() <= 24
    assert width_px - 6 <= columns.max() - 20 <= width_px + 2


@given(st.integers(1, 60), st.integers(1, 60), st.integers(0, 12))
def test_rounded_corners_cover_the_middle_and_no_more_than_the_box(width: int, height: int, radius: int) -> None:
    mask = rounded_mask(width, height, radius)
    assert mask.shape == (height, width)
    assert 0 <= mask.min() <= mask.max() <= 1
    np.testing.assert_allclose(mask, mask[::-1, ::-1])
