"""What a flight was flown with, in words for people: its world, wind and seed, the mission file, software, computer."""

import json
import math
from collections.abc import Callable
from typing import Any

from mission.log.reader import Flight
from mission.log.wording import words_of

_CAMERA = "camera_intrinsics"  # a whole JSON object among the metadata
_SHA256_DIGITS = 12

_METADATA: dict[str, tuple[str, Callable[[str], str]]] = {
    "wind_m_s": ("wind", lambda value: f"{value} m/s"),
    "wind_from_deg": ("wind from", lambda value: f"{value}°"),
    "speed": ("speed", lambda value: f"{value} times real time"),
}
"""What a key of the log's metadata is called, and its value with its unit; the others are spelled as they are."""


def flown_with(flight: Flight) -> dict[str, str]:
    """What a flight was flown with by what it is called: what the log's metadata and attachments tell of it."""
    metadata = flight.mission.metadata
    told = {}
    for key, value in metadata.items():
        if "\n" not in value and key != _CAMERA:
            name, spell = _METADATA.get(key, (words_of(key), str))
            told[name] = spell(value)
    told["mission"] = flight.mission.name
    told["mission file"] = f"sha256 {flight.mission.sha256[:_SHA256_DIGITS]}"
    camera = _object(flight.attachments.get("camera.json") or metadata.get(_CAMERA))
    if camera:
        told["frames"] = _camera_words(camera)
    if flight.origin is not None:
        latitude, longitude = math.degrees(flight.origin.latitude_rad), math.degrees(flight.origin.longitude_rad)
        told["origin"] = f"{latitude:.6f}°, {longitude:.6f}°, {flight.origin.altitude_m:.0f} m"
    versions = _object(flight.attachments.get("versions.json"))
    told |= {name: str(versions[name]) for name in sorted(versions, key=lambda name: name != "lineflight")}
    return told | _computer(_object(flight.attachments.get("host.json")))


def settings_of(flight: Flight, attachment: str) -> dict[str, str]:
    """The numbers and words in an attachment that is JSON, each by its dotted name: `plan.json`, `parameters.json`."""
    return dict(_leaves("", _object(flight.attachments.get(attachment))))


def _object(text: bytes | str | None) -> dict[str, Any]:
    """A JSON object; empty where there is none. A log may come from elsewhere, and its words need not be ours."""
    try:
        found = json.loads(text or "{}")
    except ValueError:
        return {}
    return found if isinstance(found, dict) else {}


def _camera_words(camera: dict[str, Any]) -> str:
    try:
        width_px, height_px = int(camera["width_px"]), int(camera["height_px"])
        words = f"{width_px} x {height_px} px"
        if camera["lens"] == "pinhole":
            words += f", {math.degrees(2.0 * math.atan2(0.5 * width_px, float(camera['fx_px']))):.0f}° wide"
        return f"{words}, {camera['lens']} lens"
    except (KeyError, TypeError, ValueError):
        return "not told"


def _computer(host: dict[str, Any]) -> dict[str, str]:
    told = {}
    if host.get("computer"):
        told["computer"] = str(host["computer"])
    if host.get("architecture"):
        told["processor"] = str(host["architecture"])
        if host.get("n_cores"):
            told["processor"] += f", {host['n_cores']} cores" if host["n_cores"] != 1 else ", 1 core"
    if isinstance(host.get("memory_bytes"), int):
        told["memory"] = f"{host['memory_bytes'] / 1e9:.1f} GB"
    if host.get("system"):
        told["system"] = " ".join(str(host[key]) for key in ("system", "kernel") if host.get(key))
    return told


def _leaves(name: str, value: Any) -> list[tuple[str, str]]:
    if isinstance(value, dict):
        named = [(str(key), part) for key, part in value.items()]
    elif isinstance(value, list):
        named = [(str(k), part) for k, part in enumerate(value, start=1)]
    else:
        words = f"{value:g}" if isinstance(value, float) else "none" if value is None else str(value)
        return [(name, words)]
    return [leaf for key, part in named for leaf in _leaves(f"{name}.{key}" if name else key, part)]
