"""A flight's map as GeoJSON (RFC 7946).

Positions are longitude, latitude [deg], altitude [m]. RFC 7946 counts altitudes from the ellipsoid; autopilots tell
them above mean sea level, and without a model of the geoid they stay so: the file says so itself.
"""

import json
from typing import Any

from mission.export.flight_map import Feature, FlightMap
from mission.export.times import iso_utc


def geojson(flight_map: FlightMap) -> bytes:
    """Write a flight's map as a FeatureCollection, one feature a line, in UTF-8."""
    head = {"type": "FeatureCollection", "name": flight_map.name, "altitudes": "metres above mean sea level"}
    features = ",\n".join(_json(_feature(feature)) for feature in flight_map.features)
    return (_json(head)[:-1] + ', "features": [\n' + features + "\n]}\n").encode()


def _feature(feature: Feature) -> dict[str, Any]:
    positions = [[round(lon, 8), round(lat, 8), round(alt, 3)] for lat, lon, alt in feature.places.tolist()]
    geometry = (
        {"type": "Point", "coordinates": positions[0]}
        if len(positions) == 1
        else {"type": "LineString", "coordinates": positions}
    )
    times: dict[str, str] = {}
    if feature.begin_ns is not None:
        times["time" if feature.end_ns is None else "begin"] = iso_utc(feature.begin_ns)
    if feature.end_ns is not None:
        times["end"] = iso_utc(feature.end_ns)
    properties = {"kind": str(feature.kind), "name": feature.name, **times, **feature.facts}
    return {"type": "Feature", "geometry": geometry, "properties": properties}


def _json(content: object) -> str:
    return json.dumps(content, ensure_ascii=False, allow_nan=False)
