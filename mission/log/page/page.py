"""Put a flight on one page: a single HTML file that opens from a USB stick, without a network."""

import base64
import html
import importlib.resources
import json
from dataclasses import dataclass
from typing import Any

from mission.log.flight_report import FlightReport
from mission.log.page.data import page_data
from mission.log.page.frames import page_frames
from mission.log.reader import Flight
from mission.log.task_spans import flight_start_ns


@dataclass(frozen=True, slots=True)
class Ground:
    """A picture of the ground from above, north up, as JPEG, and the rectangle [m] that it shows."""

    jpeg: bytes
    north_m: float
    west_m: float
    height_m: float
    width_m: float


def flight_page(flight: Flight, report: FlightReport, ground: Ground | None = None) -> str:
    """The page of a flight as HTML; its frames are read from the flight's log. Raises LogError."""
    data = page_data(flight, report) | {
        "frames": page_frames(flight, flight_start_ns(flight)),
        "ground": None if ground is None else _ground(ground),
    }
    return fill("page", f"{flight.mission.name}, {data['begun']}", data)


def fill(name: str, title: str, data: dict[str, Any]) -> str:
    """The template `name` with its style, its script, plotly.js, and `data` for the script."""
    parts = {
        "%%TITLE%%": html.escape(title),
        "%%STYLE%%": _own("page.css"),
        "%%DATA%%": _json_in_html(data),
        "%%SCRIPT%%": _own(f"{name}.js"),
        "%%PLOTLY%%": importlib.resources.files("plotly").joinpath("package_data/plotly.min.js").read_text("utf-8"),
    }
    page = _own(f"{name}.html")
    pieces = []
    for mark, text in parts.items():  # in the template's order: what is filled in is not looked at again
        before, page = page.split(mark, 1)
        pieces += [before, text]
    return "".join([*pieces, page])


def _json_in_html(data: dict[str, Any]) -> str:
    """JSON that may stand in a <script> element, whatever its strings hold.

    There `</script` would end the element, and `<!--` with `<script` would keep it from ending (HTML, 4.12.1.3): so
    every `<` is escaped, which JSON has in strings alone. What is beyond ASCII is escaped as well, U+2028 too, which
    ends a line in older JavaScript.
    """
    return json.dumps(data, separators=(",", ":"), allow_nan=False, ensure_ascii=True).replace("<", "\\u003c")


def _own(file: str) -> str:
    return importlib.resources.files(__package__).joinpath(file).read_text("utf-8")


def _ground(ground: Ground) -> dict[str, Any]:
    return {
        "image": "data:image/jpeg;base64," + base64.b64encode(ground.jpeg).decode(),
        "north_m": ground.north_m,
        "west_m": ground.west_m,
        "height_m": ground.height_m,
        "width_m": ground.width_m,
    }
