"""A flight's map as KML 2.2 (OGC 07-147r2), for Google Earth and the like. Altitudes are above mean sea level."""

import re
import xml.etree.ElementTree as ET

from mission.export.flight_map import Feature, FlightMap, Kind
from mission.export.times import iso_utc

_NAMESPACE = "http://www.opengis.net/kml/2.2"
_FOLDERS = {
    Kind.TRACK: "Track",
    Kind.PHOTOGRAPH: "Photographs",
    Kind.EVENT: "Events",
    Kind.KNOWN_LINE: "The line as known",
    Kind.TRUE_LINE: "The true line (simulated)",
}
_LINES = {Kind.TRACK: ("ff00a5ff", 3), Kind.KNOWN_LINE: ("ff50ff50", 2), Kind.TRUE_LINE: ("ffffffff", 1)}  # aabbggrr
_NOT_IN_XML = re.compile(r"[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def kml(flight_map: FlightMap) -> bytes:
    """Write a flight's map as a KML document with a folder for each kind of feature, in UTF-8."""
    root = ET.Element("kml", xmlns=_NAMESPACE)
    document = ET.SubElement(root, "Document")
    _add(document, "name", flight_map.name)
    for kind, (colour, width_px) in _LINES.items():
        line = ET.SubElement(ET.SubElement(document, "Style", id=str(kind)), "LineStyle")
        _add(line, "color", colour)
        _add(line, "width", str(width_px))
    for kind, title in _FOLDERS.items():
        features = [feature for feature in flight_map.features if feature.kind is kind]
        if features:
            folder = ET.SubElement(document, "Folder")
            _add(folder, "name", title)
            for feature in features:
                folder.append(_placemark(feature))
    ET.indent(root, " ")
    text: bytes = ET.tostring(root, encoding="utf-8", xml_declaration=True)
    return text + b"\n"


def _placemark(feature: Feature) -> ET.Element:
    """A feature's placemark; KML's schema wants its elements in this order."""
    placemark = ET.Element("Placemark")
    _add(placemark, "name", feature.name)
    if "message" in feature.facts:
        _add(placemark, "description", str(feature.facts["message"]))
    if feature.begin_ns is not None and feature.end_ns is None:
        _add(ET.SubElement(placemark, "TimeStamp"), "when", iso_utc(feature.begin_ns))
    elif feature.begin_ns is not None and feature.end_ns is not None:
        span = ET.SubElement(placemark, "TimeSpan")
        _add(span, "begin", iso_utc(feature.begin_ns))
        _add(span, "end", iso_utc(feature.end_ns))
    if feature.kind in _LINES:
        _add(placemark, "styleUrl", f"#{feature.kind}")
    if feature.facts:
        data = ET.SubElement(placemark, "ExtendedData")
        for name, value in feature.facts.items():
            _add(ET.SubElement(data, "Data", name=name), "value", str(value))
    geometry = ET.SubElement(placemark, "Point" if len(feature.places) == 1 else "LineString")
    _add(geometry, "altitudeMode", "absolute")
    positions = (f"{lon:.8f},{lat:.8f},{alt:.3f}" for lat, lon, alt in feature.places.tolist())
    _add(geometry, "coordinates", " ".join(positions))
    return placemark


def _add(parent: ET.Element, name: str, text: str) -> None:
    ET.SubElement(parent, name).text = _NOT_IN_XML.sub("", text)
