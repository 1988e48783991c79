"""Reads power lines from OpenStreetMap data: GeoJSON, or what the Overpass API answers."""

import json
import math
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

SUPPORTS = ("tower", "pole", "portal")
_WAYS = ("line", "minor_line", "cable")


class PowerMapError(Exception):
    """The data cannot be used; the message is one sentence for a person."""


@dataclass(frozen=True, slots=True)
class MapNode:
    """A place [degrees] that a line passes, with its tags; without any where the map has none."""

    latitude_deg: float
    longitude_deg: float
    tags: Mapping[str, str]

    @property
    def key(self) -> tuple[float, float]:
        """Its place, to the centimetre: by it, lines and supports find each other."""
        return round(self.latitude_deg, 7), round(self.longitude_deg, 7)


@dataclass(frozen=True, slots=True)
class MapLine:
    """A power line on the map."""

    nodes: tuple[MapNode, ...]
    tags: Mapping[str, str]


@dataclass(frozen=True, slots=True)
class PowerMap:
    """The lines above the ground, and how many cables lie in it."""

    lines: tuple[MapLine, ...]
    n_underground: int


def read_power_map(path: Path) -> PowerMap:
    """Read the file. Raises PowerMapError when it is none of both kinds, or has no power line."""
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise PowerMapError(f"There is no file {path}.") from None
    except (OSError, UnicodeDecodeError) as error:
        raise PowerMapError(f"The file {path} cannot be read as text: {error}.") from error
    except (json.JSONDecodeError, RecursionError) as error:
        raise PowerMapError(f"The file {path} is not JSON; export GeoJSON, or Overpass data as [out:json].") from error
    try:
        if isinstance(data, dict) and data.get("type") == "FeatureCollection":
            found = list(_geojson_lines(data["features"]))
        elif isinstance(data, dict) and isinstance(data.get("elements"), list):
            found = list(_overpass_lines(data["elements"]))
        else:
            raise PowerMapError(f"The file {path} is neither a GeoJSON FeatureCollection nor Overpass data.")
    except (KeyError, TypeError, ValueError, AttributeError, IndexError) as error:
        raise PowerMapError(f"The file {path} is broken: {type(error).__name__} at {error}.") from error
    lines = [line for line in found if _is_overhead(line.tags)]
    if not lines:
        under = f"; its {len(found)} cables lie under ground" if found else ""
        raise PowerMapError(f"The file {path} has no way with power=line or power=minor_line{under}.")
    return PowerMap(tuple(_join(lines)), len(found) - len(lines))


def _geojson_lines(features: Iterable[dict[str, object]]) -> Iterable[MapLine]:
    ways: list[tuple[list[list[float]], dict[str, str]]] = []
    supports: dict[tuple[float, float], MapNode] = {}
    for feature in features:
        geometry, tags = feature["geometry"], _text(feature.get("properties"))
        if not isinstance(geometry, dict) or not isinstance(geometry.get("coordinates"), list):
            continue
        power, kind, coordinates = tags.get("power"), geometry["type"], geometry["coordinates"]
        if power in SUPPORTS and kind == "Point":
            node = _node(coordinates[1], coordinates[0], tags)
            supports[node.key] = node
        elif power in _WAYS and kind == "LineString":
            ways.append((coordinates, tags))
        elif power in _WAYS and kind == "MultiLineString":
            ways += [(part, tags) for part in coordinates]
    for points, tags in ways:
        nodes = [_node(point[1], point[0], {}) for point in points]
        yield MapLine(tuple(supports.get(node.key, node) for node in nodes), tags)


def _overpass_lines(elements: Iterable[dict[str, object]]) -> Iterable[MapLine]:
    nodes: dict[object, MapNode] = {}
    ways: list[dict[str, object]] = []
    for element in elements:
        if element.get("type") == "node":
            nodes[element["id"]] = _node(element["lat"], element["lon"], _text(element.get("tags")))
        elif element.get("type") == "way" and _text(element.get("tags")).get("power") in _WAYS:
            ways.append(element)
    for way in ways:
        members, geometry = way.get("nodes"), way.get("geometry")
        if isinstance(members, list) and all(member in nodes for member in members):
            yield MapLine(tuple(nodes[member] for member in members), _text(way.get("tags")))
        elif isinstance(geometry, list):
            by_place = {node.key: node for node in nodes.values()}
            bare = [_node(point["lat"], point["lon"], {}) for point in geometry if point is not None]
            yield MapLine(tuple(by_place.get(node.key, node) for node in bare), _text(way.get("tags")))
        else:
            raise ValueError(f"way {way.get('id')}, whose nodes are not in the file: ask for (._;>;);out;")


def _node(latitude: object, longitude: object, tags: dict[str, str]) -> MapNode:
    if not isinstance(latitude, int | float) or not isinstance(longitude, int | float):
        raise TypeError(f"the place {latitude}, {longitude}")
    if not (abs(latitude) <= 89.0 and abs(longitude) <= 180.0):
        raise ValueError(f"the place {latitude}, {longitude}")
    return MapNode(float(latitude), float(longitude), tags)


def _text(tags: object) -> dict[str, str]:
    """Tags as text; some exports keep the way's tags in a mapping of its own."""
    if not isinstance(tags, dict):
        return {}
    inner = tags.get("tags")
    return {str(key): str(value) for key, value in (inner if isinstance(inner, dict) else tags).items()}


def _is_overhead(tags: Mapping[str, str]) -> bool:
    if tags.get("power") == "cable":
        return tags.get("location") in ("overhead", "overground")
    return tags.get("location") not in ("underground", "underwater")


def _join(lines: list[MapLine]) -> list[MapLine]:
    """Join ways of the same kind where just two of them meet: maps cut lines wherever a tag changes."""
    left = [line for line in lines if len(line.nodes) >= 2]
    n_ends = Counter(node.key for line in left for node in (line.nodes[0], line.nodes[-1]))
    joined: list[MapLine] = []
    while left:
        line = left.pop(0)
        for _ in ("at its end", "at its beginning"):
            while (other := _next_of(line, left, n_ends)) is not None:
                left.remove(other)
                nodes = other.nodes if other.nodes[0].key == line.nodes[-1].key else other.nodes[::-1]
                line = MapLine((*line.nodes, *nodes[1:]), line.tags)
            line = MapLine(line.nodes[::-1], line.tags)
        joined.append(line)
    return joined


def _next_of(line: MapLine, others: list[MapLine], n_ends: Counter[tuple[float, float]]) -> MapLine | None:
    """The other way of its kind that begins or ends where this one ends, unless more do."""
    end = line.nodes[-1].key
    near = [other for other in others if end in (other.nodes[0].key, other.nodes[-1].key)]
    if len(near) != 1 or n_ends[end] != 2 or _kind(near[0].tags) != _kind(line.tags):
        return None
    return near[0]


def _kind(tags: Mapping[str, str]) -> tuple[str | None, ...]:
    return tuple(tags.get(key) for key in ("power", "voltage", "cables", "wires", "circuits"))


def number(text: str | None) -> float | None:
    """The greatest number of a tag, which may be a list with units: 110000;20000 or 25 m; None for no number."""
    numbers = []
    for word in (text or "").replace(",", ".").split(";"):
        try:
            numbers.append(float(word.strip().split(" ")[0].removesuffix("m")))
        except (ValueError, IndexError):
            continue
    finite = [value for value in numbers if math.isfinite(value)]
    return max(finite, default=None)
