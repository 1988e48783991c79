"""What a line on the map looks like: its tags, and where it has none, what lines of its voltage usually are."""

import statistics
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from sitl.world.power_map import MapLine, MapNode, number

_BUNDLES = {"single": 1, "double": 2, "triple": 3, "quad": 4}
_DESIGNS = {"one-level": "one_level", "three-level": "three_levels", "portal": "one_level"}
_MEDIUM_V, _HIGH_V, _EXTRA_HIGH_V = 1_500.0, 50_000.0, 170_000.0
PoleKind = Literal["wood_pole", "concrete_pole", "steel_pole"]


@dataclass(frozen=True, slots=True)
class Guess:
    """A line's supports and wires, and why: `reasons` are sentences for the comments of a world file."""

    kind: PoleKind | Literal["lattice_tower"]
    height_m: float
    head: str
    n: int
    n_bundle: int
    wire: str
    n_shield: int
    reasons: tuple[str, ...]


def guess(line: MapLine, supports: Sequence[MapNode]) -> Guess:
    """Look at the tags of a line and its supports; say what was found and what was assumed."""
    reasons: list[str] = []
    voltage_v = _voltage(line, supports, reasons)
    kind = _kind(voltage_v, supports, reasons)
    is_tower = kind == "lattice_tower"
    height_m = _height(voltage_v, is_tower, supports, reasons)
    n = _conductors(line, voltage_v, is_tower, reasons)
    n_bundle = _BUNDLES.get(line.tags.get("wires", ""), 0)
    if n_bundle:
        reasons.append(f"{line.tags['wires']} wires: tag wires")
    else:
        n_bundle = 2 if is_tower and voltage_v >= _EXTRA_HIGH_V else 1
        reasons.append(f"{n_bundle} wires in a conductor: assumed by the voltage")
    wire = "sparrow" if voltage_v < _MEDIUM_V else "raven" if voltage_v < 30_000.0 else "penguin"
    if is_tower:
        wire = "hawk" if voltage_v < _EXTRA_HIGH_V else "drake"
    reasons.append(f"wire {wire}: assumed by the voltage")
    head = "three_levels" if is_tower else "cross_arm"
    designs = Counter(node.tags["design"] for node in supports if node.tags.get("design") in _DESIGNS)
    if is_tower and designs:
        head = _DESIGNS[designs.most_common(1)[0][0]]
        reasons.append(f"head {head}: tag design of its supports")
    managed = Counter(node.tags["line:management"] for node in supports if "line:management" in node.tags)
    if managed:
        told = ", ".join(f"{count} x {what}" for what, count in managed.most_common())
        reasons.append(f"line:management of its supports: {told} (the world keeps to this one line)")
    return Guess(kind, height_m, head, n, n_bundle, wire, int(is_tower), tuple(reasons))


def _voltage(line: MapLine, supports: Sequence[MapNode], reasons: list[str]) -> float:
    voltage_v = number(line.tags.get("voltage"))
    if voltage_v is not None and voltage_v > 0.0:
        reasons.append(f"{voltage_v / 1000:g} kV: tag voltage")
        return voltage_v
    is_high = line.tags.get("power") == "line" and any(node.tags.get("power") == "tower" for node in supports)
    voltage_v = 110_000.0 if is_high else 13_200.0
    reasons.append(f"{voltage_v / 1000:g} kV: assumed, for power={line.tags.get('power')}")
    return voltage_v


def _kind(
    voltage_v: float, supports: Sequence[MapNode], reasons: list[str]
) -> PoleKind | Literal["lattice_tower"]:  # fmt: skip
    kinds = Counter(node.tags["power"] for node in supports if "power" in node.tags)
    structures = Counter(node.tags["structure"] for node in supports if "structure" in node.tags)
    materials = Counter(node.tags["material"] for node in supports if "material" in node.tags)
    structure = structures.most_common(1)[0][0] if structures else ""
    material = materials.most_common(1)[0][0] if materials else ""
    if structure in ("tubular", "solid") or material in ("wood", "concrete"):
        is_tower = False
    elif kinds:
        is_tower = kinds.most_common(1)[0][0] in ("tower", "portal")
    else:
        is_tower = voltage_v >= _HIGH_V
    if is_tower:
        reasons.append("lattice towers: " + ("tags of its supports" if kinds else "assumed by the voltage"))
        return "lattice_tower"
    by_material: dict[str, PoleKind] = {
        "wood": "wood_pole", "concrete": "concrete_pole", "reinforced_concrete": "concrete_pole",
        "steel": "steel_pole", "metal": "steel_pole", "aluminium": "steel_pole",
    }  # fmt: skip
    if material in by_material:
        reasons.append(f"poles of {material}: tag material")
        return by_material[material]
    if structure == "tubular":
        reasons.append("steel poles: tag structure")
        return "steel_pole"
    reasons.append("wooden poles: assumed")
    return "wood_pole"


def _height(voltage_v: float, is_tower: bool, supports: Sequence[MapNode], reasons: list[str]) -> float:
    told = [number(node.tags.get("height")) for node in supports]
    least_m, most_m = (15.0, 80.0) if is_tower else (4.0, 30.0)
    heights_m = [height_m for height_m in told if height_m is not None and least_m <= height_m <= most_m]
    if heights_m:
        height_m = statistics.median(heights_m)
        reasons.append(f"{height_m:g} m high: the median of {len(heights_m)} tags height")
        return height_m
    if is_tower:
        height_m = 28.0 if voltage_v < _EXTRA_HIGH_V else 42.0
    else:
        height_m = 8.0 if voltage_v < _MEDIUM_V else 11.0 if voltage_v < _HIGH_V else 18.0
    reasons.append(f"{height_m:g} m high: assumed by the voltage")
    return height_m


def _conductors(line: MapLine, voltage_v: float, is_tower: bool, reasons: list[str]) -> int:
    cables, circuits = number(line.tags.get("cables")), number(line.tags.get("circuits"))
    if cables is not None and cables >= 1.0:
        wanted, why = int(cables), "tag cables"
    elif circuits is not None and circuits >= 1.0:
        wanted, why = 3 * int(circuits), "three for each of tag circuits"
    elif voltage_v < _MEDIUM_V:
        wanted, why = 4, "assumed for low voltage"
    else:
        wanted, why = 3, "assumed, one circuit"
    n = min(wanted, 6)
    if is_tower and n in (1, 5):
        n = {1: 2, 5: 6}[n]
    more = "" if n == wanted else f"; it says {wanted}, a world has {n}"
    reasons.append(f"{n} conductors: {why}{more}")
    return n
