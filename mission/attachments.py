"""The files that a flight log keeps whole: what was flown, with which software, on which computer."""

import importlib.metadata
import json
import os
import platform
import sys
from dataclasses import asdict
from pathlib import Path

from mission.plan import MissionPlan
from mission.plan_file import MissionFile
from mission.records import Attachment

_PACKAGES = ("lineflight", "foxglove-sdk", "mavsdk", "mcap", "numba", "numpy", "opencv-contrib-python-headless")
_MODEL_FILES = (Path("/sys/firmware/devicetree/base/model"), Path("/sys/class/dmi/id/product_name"))


def flight_attachments(mission: MissionFile, plan: MissionPlan) -> list[Attachment]:
    """The mission file as it was read, `plan` with every default filled in, the camera, versions and host facts."""
    return [
        Attachment("mission.yaml", "application/yaml", mission.text.encode()),
        _json("plan.json", plan.model_dump(mode="json")),
        _json("camera.json", asdict(mission.camera)),
        _json("versions.json", _versions()),
        _json("host.json", _host()),
    ]


def _json(name: str, content: object) -> Attachment:
    return Attachment(name, "application/json", json.dumps(content, indent=1).encode())


def _versions() -> dict[str, str]:
    found = {"python": sys.version.split()[0]}
    for package in _PACKAGES:
        try:
            found[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:  # a packager may split or rename them
            found[package] = "not installed under this name"
    return found


def _host() -> dict[str, str | int | None]:
    return {
        "computer": _computer(),
        "system": platform.system(),
        "kernel": platform.release(),
        "architecture": platform.machine(),
        "n_cores": os.cpu_count(),
        "memory_bytes": os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"),
    }


def _computer() -> str | None:
    """What the board or the computer calls itself; None where it does not tell."""
    for path in _MODEL_FILES:
        try:
            return path.read_text(errors="replace").strip("\0 \n")
        except OSError:
            continue
    return None
