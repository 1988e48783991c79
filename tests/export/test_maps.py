"""The flight on a map: KML and GeoJSON."""

import json
import math
import xml.etree.ElementTree as ET
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from mission.export.errors import ExportError
from mission.export.flight_map import Feature, FlightMap, Kind, map_of
from mission.export.geojson import geojson
from mission.export.kml import kml
from mission.export.poses import Floats
from mission.export.times import iso_utc
from mission.log.reader import Flight, read_images
from mission.records import Event, Severity
from tests.log.synthetic_flight import LINE, LINE_NORTH_M, ORIGIN, TASKS

KML = "{http://www.opengis.net/kml/2.2}"
# The order of OGC 07-147r2's schema.
IN_FEATURE = ["name", "description", "TimeStamp", "TimeSpan", "styleUrl", "Style", "ExtendedData", "Point",
              "LineString", "Folder", "Placemark"]  # fmt: skip
EARTH_M = 6_371_000.0


@pytest.fixture(scope="module")
def flight_map(flight: Flight) -> FlightMap:
    return map_of(flight)


def of_kind(flight_map: FlightMap, kind: Kind) -> list[Feature]:
    return [feature for feature in flight_map.features if feature.kind is kind]


def local_neu_m(places: Floats) -> Floats:
    """Degrees back to metres from the origin, as on a globe: good to a few thousandths here."""
    latitude_rad, longitude_rad = np.radians(places[:, 0]), np.radians(places[:, 1])
    north_m = (latitude_rad - ORIGIN.latitude_rad) * EARTH_M
    east_m = (longitude_rad - ORIGIN.longitude_rad) * EARTH_M * math.cos(ORIGIN.latitude_rad)
    return np.stack([north_m, east_m, places[:, 2] - ORIGIN.altitude_m], axis=1)


def test_the_track_has_a_piece_for_each_task_and_no_gap(flight_map: FlightMap) -> None:
    pieces = of_kind(flight_map, Kind.TRACK)
    assert [piece.facts["task"] for piece in pieces] == [task for task, _, _, _ in TASKS]
    assert pieces[2].name == "3 move until"
    for piece, (_, _, (north_m, east_m, down_m, _), duration_s) in zip(pieces, TASKS, strict=True):
        assert piece.begin_ns is not None
        assert piece.end_ns is not None
        assert (piece.end_ns - piece.begin_ns) / 1e9 == pytest.approx(duration_s)
        np.testing.assert_allclose(local_neu_m(piece.places)[-1], (north_m, east_m, -down_m), atol=0.4)
    for before, after in pairwise(pieces):
        np.testing.assert_allclose(before.places[-1], after.places[0], atol=1e-9)


def test_the_track_is_thinned_but_followed(flight: Flight, flight_map: FlightMap) -> None:
    piece = of_kind(flight_map, Kind.TRACK)[4]
    places = local_neu_m(piece.places)
    steps_m = np.linalg.norm(np.diff(places, axis=0), axis=1)
    assert len(places) < 400 / 2
    assert steps_m[:-1].min() >= 0.19
    assert steps_m.max() < 0.5
    turning = of_kind(flight_map, Kind.TRACK)[3]  # on the spot
    assert len(turning.places) == 2


def test_photographs_stand_where_they_were_taken(flight: Flight, flight_map: FlightMap) -> None:
    taken = of_kind(flight_map, Kind.PHOTOGRAPH)
    times_ns = [t_ns for t_ns, _ in read_images(flight)]
    assert len(taken) == len(times_ns) > 10
    truth = {pose.t_ns: pose for pose in flight.truth}
    for feature, t_ns in zip(taken, times_ns, strict=True):
        pose = truth[t_ns]
        assert feature.begin_ns == t_ns + flight.mission.unix_minus_flight_ns
        neu_m = (pose.north_m, pose.east_m, -pose.down_m)
        np.testing.assert_allclose(local_neu_m(feature.places), [neu_m], atol=0.2)
        assert feature.facts["heading_deg"] == pytest.approx(math.degrees(pose.yaw_rad) % 360, abs=0.01)
        assert feature.facts["height_m"] == pytest.approx(-pose.down_m, abs=1e-3)
    assert len({feature.name for feature in taken}) == len(taken)


def test_events_and_lines_are_on_the_map(flight_map: FlightMap) -> None:
    (event,) = of_kind(flight_map, Kind.EVENT)
    assert (event.name, event.facts["message"]) == ("line found", "A power line lies ahead.")
    np.testing.assert_allclose(local_neu_m(event.places)[0, :2], (LINE_NORTH_M, 0.0), atol=0.05)
    known = of_kind(flight_map, Kind.KNOWN_LINE)
    assert len(known) == 2  # it was followed twice
    for line in known:
        np.testing.assert_allclose(local_neu_m(line.places)[:, 0], LINE_NORTH_M, atol=0.05)
        np.testing.assert_allclose(local_neu_m(line.places)[:, 2], 10.0, atol=0.05)  # 6 m below 16 m
    true = of_kind(flight_map, Kind.TRUE_LINE)
    assert len(true) == len(LINE.conductors_ned_m)
    north_m, east_m, down_m = LINE.conductors_ned_m[0][-1]
    np.testing.assert_allclose(local_neu_m(true[0].places)[-1], (north_m, east_m, -down_m), atol=0.2)


def test_a_flight_without_tasks_is_one_piece(flight: Flight) -> None:
    (piece,) = of_kind(map_of(replace(flight, tasks_started=(), tasks_ended=())), Kind.TRACK)
    assert len(piece.places) > 100


def test_geojson_is_a_collection_of_lon_lat_alt(flight_map: FlightMap) -> None:
    read: dict[str, Any] = json.loads(geojson(flight_map))
    assert read["type"] == "FeatureCollection"
    assert len(read["features"]) == len(flight_map.features)
    for entry, feature in zip(read["features"], flight_map.features, strict=True):
        geometry = entry["geometry"]
        positions = [geometry["coordinates"]] if geometry["type"] == "Point" else geometry["coordinates"]
        assert geometry["type"] == ("Point" if len(feature.places) == 1 else "LineString")
        np.testing.assert_allclose(np.array(positions)[:, [1, 0, 2]], feature.places, atol=1e-3)
        np.testing.assert_allclose(np.array(positions)[:, [1, 0]], feature.places[:, :2], atol=1e-8)
        assert (entry["type"], entry["properties"]["kind"]) == ("Feature", feature.kind.value)
        assert feature.facts.items() <= entry["properties"].items()
    track = read["features"][0]["properties"]
    assert flight_map.features[0].begin_ns is not None
    assert track["begin"] == iso_utc(flight_map.features[0].begin_ns)


def test_kml_holds_every_feature_in_the_order_of_its_schema(flight_map: FlightMap) -> None:
    root = ET.fromstring(kml(flight_map))  # noqa: S314
    assert root.tag == f"{KML}kml"
    placemarks = list(root.iter(f"{KML}Placemark"))
    assert [mark.findtext(f"{KML}name") for mark in placemarks] == [feature.name for feature in flight_map.features]
    for element in [*placemarks, *root.iter(f"{KML}Folder"), *root.iter(f"{KML}Document")]:
        order = [IN_FEATURE.index(child.tag.removeprefix(KML)) for child in element]
        assert order == sorted(order)
    for mark, feature in zip(placemarks, flight_map.features, strict=True):
        geometry = mark[-1]
        assert geometry.findtext(f"{KML}altitudeMode") == "absolute"
        text = geometry.findtext(f"{KML}coordinates") or ""
        positions = np.array([[float(number) for number in position.split(",")] for position in text.split()])
        np.testing.assert_allclose(positions[:, [1, 0]], feature.places[:, :2], atol=1e-8)
        np.testing.assert_allclose(positions[:, 2], feature.places[:, 2], atol=1e-3)
        data = {entry.get("name"): entry.findtext(f"{KML}value") for entry in mark.iter(f"{KML}Data")}
        assert data == {name: str(value) for name, value in feature.facts.items()}
    styles = {style.get("id") for style in root.iter(f"{KML}Style")}
    assert {(url.text or "").removeprefix("#") for url in root.iter(f"{KML}styleUrl")} <= styles


def test_kml_takes_any_words(flight: Flight) -> None:
    words = "5 < 6 & \x00\x1b\ufffe “ä”"
    event = Event(flight.states[9].t_ns, "strange", Severity.INFO, words)
    root = ET.fromstring(kml(map_of(replace(flight, events=(event,)))))  # noqa: S314
    assert "5 < 6 &  “ä”" in [element.text for element in root.iter(f"{KML}description")]


def test_without_an_origin_there_is_no_map(flight_without_origin: Flight) -> None:
    with pytest.raises(ExportError, match="where on Earth the local frame"):
        map_of(flight_without_origin)


def test_times_are_utc() -> None:
    assert iso_utc(1_767_225_599_999_900_000) == "2025-12-31T23:59:59.999Z"
    assert iso_utc(1_767_225_600_000_000_000) == "2026-01-01T00:00:00.000Z"
