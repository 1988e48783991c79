"""Writes a world file for power lines of OpenStreetMap."""

import itertools
import json
import math
from dataclasses import dataclass
from pathlib import Path

from sitl.place import Origin
from sitl.world.power_fit import fit
from sitl.world.power_line_guess import guess
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
    origin, yaw_rad = _start(main, support - 1, rough)
    near = _within(_moved(main, origin), radius_m, keep=support - 1)
    if near.supports.index(main.supports[support - 1]) + 1 in fit(guess(near.line, near.supports), near.places).missing:
        raise PowerMapError(
            f"The span after support {support} of {source} is too long for such supports on level ground; "
            "give another --start-support."
        )
    others = [_within(_moved(part, origin), radius_m) for part in laid if part is not main]
    lines = [near, *sorted((part for part in others if len(part.places) > 1), key=lambda part: -part.length_m)]
    texts = [text for part in lines[:_TOP_LINES] if (text := _line_text(part))]
    return "\n".join([*_head(power_map, source, origin, yaw_rad), *itertools.chain.from_iterable(texts)]) + "\n"


def _start(main: _Laid, span: int, rough: Origin) -> tuple[Origin, float]:
    """Where on Earth the vehicle starts, beside the middle of that span of `main`, and its yaw [rad]."""
    (north, east), heading_rad = _middle(main.places[span], main.places[span + 1])
    yaw_rad = math.remainder(heading_rad - math.pi / 2.0, 2.0 * math.pi)
    start = (north - _BESIDE_M * math.cos(yaw_rad), east - _BESIDE_M * math.sin(yaw_rad), 0.0)
    latitude_rad, longitude_rad, _ = rough.global_of(start)
    told = [number(node.tags.get("ele")) for node in main.supports[span : span + 2]]
    return Origin(latitude_rad, longitude_rad, next((up_m for up_m in told if up_m is not None), 0.0)), yaw_rad


def _head(power_map: PowerMap, source: Path, origin: Origin, yaw_rad: float) -> list[str]:
    under = power_map.n_underground
    return [
        f"# Written by lineflight world import from {source.name}; what each line's tags say, or do not, is above it.",
        *([f"# {under} cables under ground were left out."] if under else []),
        "# The map tells no ground: it is level here; terrain: may name a height map.",
        "version: 2",
        f"description: {_quoted(f'Power lines from {source.name}.')}",
        f"origin: {{latitude_deg: {math.degrees(origin.latitude_rad):.7f}, "
        f"longitude_deg: {math.degrees(origin.longitude_rad):.7f}, altitude_m: {origin.altitude_m:.1f}}}"
        + ("" if origin.altitude_m else "  # no tag ele tells the altitude"),
        f"start_yaw_deg: {math.degrees(yaw_rad):.2f}  # at the line, in the middle between two supports",
        "ground: {style: pasture, seed: 1}",
        "lines:",
    ]


def _lay(line: MapLine, origin: Origin) -> list[_Laid]:
    """The line's supports on the ground, cut in parts where it turns too sharply for one support."""
    # Each node should be a support; where most are told to be one, the others are bends of a drawing hand.
    is_told = sum(node.tags.get("power") in SUPPORTS for node in line.nodes) >= 0.5 * len(line.nodes)
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
    """The line's item in the file; nothing where no span of it can be hung."""
    found = guess(part.line, part.supports)
    fitted = fit(found, part.places)
    if len(fitted.missing) == len(part.places) - 1:
        return []
    name = part.line.tags.get("name") or part.line.tags.get("ref") or ""
    conductors = f"n: {found.n}, wire: {found.wire}" + (f", n_bundle: {found.n_bundle}" if found.n_bundle > 1 else "")
    comment = "the sag: of 18 % of the wire's strength at 15 degrees C"
    if fitted.tension_n is not None:
        conductors += f", tension_n: {fitted.tension_n:.0f}, tension_at_c: 25, temperature_c: 25"
        comment = f"so tight that its span of {fitted.longest_m:.0f} m keeps off level ground"
    missing = ", ".join(str(span) for span in fitted.missing)
    return [
        *(f"  # {reason}" for reason in found.reasons),
        f"  - name: {_quoted(name[:100])}",
        "    points_ne_m:",
        *(f"      - [{north_m:.2f}, {east_m:.2f}]" for north_m, east_m in part.places),
        f"    support: {{kind: {found.kind}, height_m: {found.height_m:g}, head: {found.head}}}",
        f"    conductors: {{{conductors}}}  # {comment}",
        *([f"    missing_spans: [{missing}]  # too long for such supports on level ground"] if missing else []),
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
