"""Small world files for the tests."""

from pathlib import Path

from sitl.world.file import load_world
from sitl.world.records import World

HEAD = """\
version: 2
origin: {latitude_deg: 4.9, longitude_deg: -73.9, altitude_m: 2580}
"""


def write(folder: Path, text: str) -> str:
    """Write a world file; its path."""
    path = folder / "mine.yaml"
    path.write_text(text, encoding="utf-8")
    return str(path)


def world_of(folder: Path, lines: str, more: str = "") -> World:
    """The world with these items under `lines:`, and more keys."""
    return load_world(write(folder, f"{HEAD}{more}lines:\n{lines}"))
