"""A comparison's figures in words for people: what each is called, and its value with its unit. Pure."""

import re

_LABELS = {
    "duration_s": "duration",
    "lateral_mean_m": "off the true line, mean",
    "lateral_p95_m": "off the true line, p95",
    "lateral_max_m": "off the true line, at most",
    "yaw_error_median_deg": "true heading error, median",
    "yaw_error_p95_deg": "true heading error, p95",
    "frames": "frames",
    "estimates_percent": "frames with a line",
    "doubtful_frames": "doubtful frames",
    "latency_p50_ms": "vision latency, median",
    "latency_p95_ms": "vision latency, p95",
    "latency_p99_ms": "vision latency, p99",
    "setpoint_rate_hz": "setpoints",
    "setpoint_gap_max_ms": "longest gap between setpoints",
    "landing_distance_m": "end from the start",
    "events": "events",
    "excursions": "excursions",
}
_STRAIGHTNESS = re.compile(r"leg_(\d+)_straightness_(mean|p95)_m")
_UNITS = {"_ms": ("ms", 1), "_hz": ("Hz", 1), "_deg": ("°", 2), "_percent": ("%", 1)}
_UNITS |= {"_m": ("m", 3), "_s": ("s", 1)}  # after those that end alike
UNKNOWN = "-"


def label_of(name: str) -> str:
    """What a figure is called."""
    leg = _STRAIGHTNESS.fullmatch(name)
    return f"leg {leg[1]}, how straight, {leg[2]}" if leg else _LABELS.get(name, name.replace("_", " "))


def value_words(name: str, value: float | None) -> str:
    """A figure's value with its unit, as 0.120 m; what has none is a count, and whole."""
    return UNKNOWN if value is None else _spelled(name, value, "")


def change_words(name: str, change: float | None) -> str:
    """A change with its sign and unit, of a percentage in points; what is too small to be shown is no change."""
    if change is None:
        return UNKNOWN
    words = _spelled(name, change, "+").replace("%", "points")
    return words if any(digit in "123456789" for digit in words) else "same"


def _spelled(name: str, value: float, sign: str) -> str:
    unit, digits = next((spell for end, spell in _UNITS.items() if name.endswith(end)), ("", 0))
    return f"{value:{sign}.{digits}f}" + ("" if not unit else unit if unit == "°" else f" {unit}")
