"""Writes a world file for power lines of OpenStreetMap."""

import itertools
import json
import math
from dataclasses import dataclass
from pathlib import Path

from sitl.place import Origin
from sitl.world.power_line_guess import Guess, guess
from sitl.world.power_map import SUPPORTS, MapLine, MapNode, PowerMap, PowerMapError, number
from sitl.world.records import PointNe

_BESIDE_M = 15.0
_LEAST_SPAN_M = 8.0
_SHARPEST_RAD = math.radians(115.0)
_TOP_LINES = 40


@dataclass(frozen=True, slots=True)
class _Laid:
    """A line's supports, with their places [m]."""

    line: MapLine
    supports: tuple[MapNode, ...]
    places: tuple[PointNe, ...]

    @property
    def length_m(self) -> float:
        return sum(math.dist(a, b) for a, b in itertools.pairwise(self.places))


def world_text(power_map: PowerMap, source: Path, start_support: int | None, radius_m: float) -> str:
    """The text of a world file: the longest line first, with the start 15 m beside the middle of one of its spans.

    `start_support` is the support that the vehicle meets the line after, counted from 1; by default that before the
    middle span. What lies farther than `radius_m` from the start is left out. Raises PowerMapError when no line has
    such a span.
    """
    first = power_map.lines[0].nodes[0]
    rough = Origin(math.radians(first.latitude_deg), math.radians(first.longitude_deg), 0.0)
    laid = [part for line in power_map.lines for part in _lay(line, rough)]
    if not laid:
        raise PowerMapError(f"The lines of {source} have no span of {_LEAST_SPAN_M:g} m or more.")
    main = max(laid, key=lambda part: part.length_m)
    n_spans = len(main.places) - 1
    support = (n_spans + 1) // 2 if start_support is None else start_support
    if not 1 <= support <= n_spans:
        raise PowerMapError(
            f"There is no span after support {support}: the longest line of {source} has {n_spans + 1} supports, "
            f"so that --start-support goes from 1 to {n_spans}."
        )
    (north, east), heading_rad = _middle(main.places[support - 1], main.places[support])
    yaw_rad = math.remainder(heading_rad - math.pi / 2.0, 2.0 * math.pi)
    start = (north - _BESIDE_M * math.cos(yaw_rad), east - _BESIDE_M * math.sin(yaw_rad))
    latitude_rad, longitude_rad, _ = rough.global_of((*start, 0.0))
    elevations = [number(node.tags.get("ele")) for node in (main.supports[support - 1], main.supports[support])]
    known = [elevation for elevation in elevations if elevation is not None]
    origin = Origin(latitude_rad, longitude_rad, known[0] if known else 0.0)

    near = _within(_moved(main, origin), radius_m, keep=support - 1)
    others = [_within(_moved(part, origin), radius_m) for part in laid if part is not main]
    kept = [part for part in others if len(part.places) >= 2]
    lines = [near, *sorted(kept, key=lambda part: -part.length_m)][:_TOP_LINES]
    head = [
        f"# Written by lineflight world import from {source.name}: {len(lines)} lines within {radius_m:g} m.",
    ]
    if power_map.n_underground:
        head.append(f"# {power_map.n_underground} cables under ground were left out.")
    head.append("# The map tells no ground: it is flat here; give terrain a height map.")
    if not known:
        head.append("# The map tells no elevation (tag ele): altitude_m is 0.")
    body = [
        "version: 2",
        f"description: {_quoted(f'Power lines from {source.name}.')}",
        f"origin: {{latitude_deg: {math.degrees(origin.latitude_rad):.7f}, "
        f"longitude_deg: {math.degrees(origin.longitude_rad):.7f}, altitude_m: {origin.altitude_m:.1f}}}",
        f"start_yaw_deg: {math.degrees(yaw_rad):.2f}  # at the line, in the middle between two supports",
        "ground: {style: pasture, seed: 1}",
        "lines:",
    ]
    for part in lines:
        body += _line_text(part)
    return "\n".join([*head, *body]) + "\n"


def _lay(line: MapLine, origin: Origin) -> list[_Laid]:
    """The line's supports on the ground, cut in parts where it turns too sharply for one support."""
    is_told = any(node.tags.get("power") in SUPPORTS for node in line.nodes)
    ends = (line.nodes[0], line.nodes[-1])
    chosen = [node for node in line.nodes if not is_told or node in ends or node.tags.get("power") in SUPPORTS]
    parts: list[list[tuple[MapNode, PointNe]]] = [[]]
    for node in chosen:
        place = _place(node, origin)
        part = parts[-1]
        if part and math.dist(part[-1][1], place) < _LEAST_SPAN_M:
            continue
        if len(part) >= 2 and abs(_turn_rad(part[-2][1], part[-1][1], place)) > _SHARPEST_RAD:
            parts.append([part[-1]])
        parts[-1].append((node, place))
    return [
        _Laid(line, tuple(node for node, _ in part), tuple(place for _, place in part))
        for part in parts
        if len(part) >= 2
    ]


def _moved(part: _Laid, origin: Origin) -> _Laid:
    """The same supports, as seen from another origin."""
    return _Laid(part.line, part.supports, tuple(_place(node, origin) for node in part.supports))


def _within(part: _Laid, radius_m: float, keep: int | None = None) -> _Laid:
    """The longest run of supports within the radius around the start; or that around span `keep`."""
    is_near = [math.hypot(*place) <= radius_m or i in (keep, keep + 1 if keep is not None else None)
               for i, place in enumerate(part.places)]  # fmt: skip
    runs: list[list[int]] = [[]]
    for i, near in enumerate(is_near):
        if near:
            runs[-1].append(i)
        elif runs[-1]:
            runs.append([])
    run = max(runs, key=len) if keep is None else next(run for run in runs if keep in run)
    return _Laid(part.line, tuple(part.supports[i] for i in run), tuple(part.places[i] for i in run))


def _line_text(part: _Laid) -> list[str]:
    found: Guess = guess(part.line, part.supports)
    name = part.line.tags.get("name") or part.line.tags.get("ref") or ""
    conductors = f"n: {found.n}, wire: {found.wire}" + (f", n_bundle: {found.n_bundle}" if found.n_bundle > 1 else "")
    return [
        *(f"  # {reason}" for reason in found.reasons),
        f"  - name: {_quoted(name[:100])}",
        "    points_ne_m:",
        *(f"      - [{north_m:.2f}, {east_m:.2f}]" for north_m, east_m in part.places),
        f"    support: {{kind: {found.kind}, height_m: {found.height_m:g}, head: {found.head}}}",
        f"    conductors: {{{conductors}}}  # the sag: of 18 % of the wire's strength at 15 degrees C",
        *([f"    shield_wires: {{n: {found.n_shield}}}  # assumed"] if found.n_shield else []),
    ]


def _place(node: MapNode, origin: Origin) -> PointNe:
    return origin.place_ne_m(math.radians(node.latitude_deg), math.radians(node.longitude_deg))


def _middle(here: PointNe, there: PointNe) -> tuple[PointNe, float]:
    """The point between two places, and the heading from one to the other [rad]."""
    heading_rad = math.atan2(there[1] - here[1], there[0] - here[0])
    return ((here[0] + there[0]) / 2.0, (here[1] + there[1]) / 2.0), heading_rad


def _turn_rad(before: PointNe, here: PointNe, after: PointNe) -> float:
    return math.remainder(_middle(here, after)[1] - _middle(before, here)[1], 2.0 * math.pi)


def _quoted(text: str) -> str:
    """Text as YAML takes it whatever is in it: JSON's way."""
    return json.dumps(text, ensure_ascii=True)
